"""Residuals of models over the films, on the films' plans."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from tympan.base.arrays import Columns
from tympan.reports import look as style
from tympan.reports.colouring import COLOURINGS, Colouring, about_zero
from tympan.studies.diagnosis.result import LoadedFilm
from tympan.studies.film_surface import FilmSurface

#: Room above an axis for its title [mm].
_TITLE = 8.0
#: Height of a film's plan [mm].
_PANEL = 46.0
#: Room between two rows of plans [mm].
_GAP = 7.0
#: Room below for the colour bar with its words [mm].
_BAR = 17.0

#: Room on the left for the names of films and loads [mm].
_LEFT = 24.0
#: Room on the right [mm].
_RIGHT = 3.0
#: Room between two plans side by side [mm].
_BETWEEN = 6.0

#: Width of the colour bar of the residuals [mm].
_BAR_WIDTH = 60.0
#: Height of a colour bar [mm].
_BAR_HEIGHT = 2.5

#: Colours of values above, below and at 0.
_COLOURS = "RdBu_r"
#: Share of residuals within the scale, so that a few outliers do not make all others pale.
_SHARE = 0.98

#: Quantities that colour films: the common ones, and the difference of the extended model.
FILM_COLOURINGS = {**COLOURINGS, "more": Colouring(
    "deflection, extended − nominal", "deflection, extended − nominal", "µm",
    lambda film: 1e6 * (film.values["displacement"][:, 2] - film.values["nominal_deflection"]),
    about_zero, _COLOURS)}
_STILL = ("stress", "deflection", "more")


def titled_films(films: Sequence[LoadedFilm]) -> dict[str, FilmSurface]:
    """Name films by specimen and load."""
    return {f"{item.specimen}, {1e3 * item.mass_kg:.4g} g, {item.voltage_V / 1e3:.4g} kV": item.film
            for item in films if item.film is not None}


def compose_loaded_films(films: Mapping[str, FilmSurface]) -> Figure:
    """Draw films in the direction of the load: a row for each, a column for each quantity.

    A quantity has one scale. One that equals the baseline model everywhere has no column.
    """
    figure = style.new_figure(_TITLE + len(films) * (_PANEL + _GAP) + _BAR)
    shown = [quantity for quantity in (FILM_COLOURINGS[key] for key in _STILL)
             if any(np.ptp(quantity.of(film)) for film in films.values())]
    width = (style.WIDTH - _LEFT - _RIGHT - (len(_STILL) - 1) * _BETWEEN) / len(_STILL)
    for column, quantity in enumerate(shown):
        values = [quantity.of(film) for film in films.values()]
        scale = quantity.scale(min(map(np.min, values)), max(map(np.max, values)))
        start = _LEFT + column * (width + _BETWEEN)
        for row, (name, film) in enumerate(films.items()):
            axes = style.place_axes(figure, start, _TITLE + row * (_PANEL + _GAP), width, _PANEL)
            x, y, _ = 1e3 * film.mounted.T
            axes.tripcolor(Triangulation(x, y, film.triangles), values[row], shading="gouraud",
                           cmap=quantity.colours, vmin=scale.low, vmax=scale.high,
                           rasterized=True)
            words = name.replace(", ", "\n", 1) + "\ny (mm)"
            axes.set(aspect="equal", ylabel=words if column == 0 else "",
                     xlabel="x (mm)" if row == len(films) - 1 else "")
        style.colour_bar(figure, start + 3, _TITLE + len(films) * (_PANEL + _GAP) + 5.0,
                         (width - 6, _BAR_HEIGHT), scale, quantity.colours, quantity.title)
    return figure


def compose_film_maps(readings: Columns, outlines: Mapping[str, Any]) -> Figure:
    """Draw deflections minus each model's predictions: a row for each specimen and state.

    The scale is symmetric about 0. ``outlines``: for each specimen by name the points of "frame"
    and "plate" [mm], (n, 2).
    """
    states = list(dict.fromkeys(zip(*(readings[name].tolist() for name in
                                      ("specimen", "mass", "voltage")), strict=True)))
    residuals = [1e6 * (readings["read"] - readings[model]) for model in ("baseline", "extended")]
    reach = max(float(np.quantile(np.abs(residuals[0]), _SHARE)), 1e-3)
    figure = style.new_figure(_TITLE + len(states) * (_PANEL + _GAP) + _BAR)
    width = (style.WIDTH - _LEFT - _RIGHT - _BETWEEN) / 2
    titles = "baseline model, stiffness and permittivity fitted", "extended model"
    for row, (name, mass, voltage) in enumerate(states):
        rows = ((readings["specimen"] == name) & (readings["mass"] == mass)
                & (readings["voltage"] == voltage))
        for column, (title, values) in enumerate(zip(titles, residuals, strict=True)):
            axes = style.place_axes(figure, _LEFT + column * (width + _BETWEEN),
                                    _TITLE + row * (_PANEL + _GAP), width, _PANEL)
            _plan(axes, outlines[name])
            drawn = axes.scatter(1e3 * readings["x"][rows], 1e3 * readings["y"][rows],
                                 c=values[rows], cmap=_COLOURS, vmin=-reach, vmax=reach, s=11,
                                 linewidths=0.1, edgecolors=style.GREY)
            axes.set_title(title if row == 0 else "", loc="left", weight="bold")
            words = f"{name}\n{1e3 * mass:.4g} g, {voltage / 1e3:.3g} kV\ny (mm)"
            axes.set(ylabel=words if column == 0 else "",
                     xlabel="x (mm)" if row == len(states) - 1 else "")
            axes.tick_params(labelbottom=row == len(states) - 1, labelleft=column == 0)
    top = _TITLE + len(states) * (_PANEL + _GAP)
    bar = style.place_axes(figure, (style.WIDTH - _BAR_WIDTH) / 2, top + 5.0, _BAR_WIDTH,
                           _BAR_HEIGHT)
    figure.colorbar(drawn, cax=bar, orientation="horizontal", extend="both",
                    label="read − model, each scan's zero taken off (µm)")
    return figure


def _plan(axes: Axes, outlines: Mapping[str, Any]) -> None:
    """Draw frame and plate, to scale."""
    for name in ("frame", "plate"):
        points = np.array([*outlines[name], outlines[name][0]])
        axes.plot(*points.T, color=style.GREY, linewidth=0.8)
    axes.set_aspect("equal")
    axes.margins(0.04)
