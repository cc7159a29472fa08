"""One film has lost part of its prestretch."""

from __future__ import annotations

from dataclasses import replace

from tympan.geometry.specimen import Film
from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, loss: float, which: str) -> Setup:
    """λ(1−δ) of one specimen."""
    def change(film: Film) -> Film:
        x, y = film.prestretch
        return replace(film, prestretch=(x * (1 - loss), y * (1 - loss)))

    return setup.with_films(change, which)


register(Effect(
    "prestretch_loss",
    "The film of one specimen slipped in its frame or was stretched less than the others.",
    (Parameter("delta", "the specimen's stretches are λ(1-delta)", "", "", width=0.02, low=0.0,
               high=0.15,
               sign="positive", reason=(
                   "film slipping by 1 mm under a clamp of a 45 mm frame loses 2 % of its stretch; no source")),),
    edit,
    on_one=True,
))
