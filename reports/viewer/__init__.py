"""Rotatable films within a page, without network: data, and a script that draws them."""

from __future__ import annotations

from collections.abc import Mapping

from tympan.reports.colouring import COLOURINGS, Colouring
from tympan.reports.template import template, text_of
from tympan.reports.viewer.payload import payload
from tympan.studies.film_surface import FilmSurface


def viewer(films: Mapping[str, FilmSurface],
           colourings: Mapping[str, Colouring] = COLOURINGS) -> str:
    """Write HTML of films by their names, for a page that has the common style.

    Without scripts or WebGL it shows nothing, so the page also needs a static picture.
    """
    return template("reports/viewer/viewer.html").render(
        films=payload(films, colourings), script=text_of("reports/viewer/viewer.js"),
        hatched=any(film.values["tension"].any() for film in films.values()))
