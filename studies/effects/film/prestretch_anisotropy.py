"""All films are stretched more along one axis than along the other."""

from __future__ import annotations

from dataclasses import replace

from tympan.geometry.specimen import Film
from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, share: float) -> Setup:
    """λ(1+a) along x, λ/(1+a) along y."""
    def change(film: Film) -> Film:
        x, y = film.prestretch
        return replace(film, prestretch=(x * (1 + share), y / (1 + share)))

    return setup.with_films(change)


register(Effect(
    "prestretch_anisotropy",
    "All films were stretched a little more along one axis of the frame than along the other, at the same area.",
    (Parameter("a", "stretch λ(1+a) along x and λ/(1+a) along y", "", "", width=0.02, low=-0.1,
               high=0.1, sign="signed",
               reason="a grid drawn on the film and read with a ruler, 1 mm in 50 mm; no source"),),
    edit,
))
