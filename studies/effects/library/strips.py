"""Effects on coupons: their warmth and their width."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from tympan.studies.effects.effect import EffectParameter, Observable, Setup, effect


@effect("The film is stiffer or softer at another temperature, law and branches alike.",
        finding="The film gets {p:stiffer/softer} as it gets warmer, by {p} a degree about room "
                "temperature",
        check="stretch two strips of the same film at two temperatures and compare their curves",
        shows_in=(Observable.TEMPERATURE,))
def temperature(setup: Setup, p: Annotated[float, EffectParameter(
        "power of the absolute temperature with which stiffness grows", "", width=1.0, low=-50.0,
        high=50.0, reason=(
            "entropy elasticity has p = 1, a modulus N k T (Treloar, The Physics of Rubber "
            "Elasticity, 3rd ed., 1975); a tape that relaxes faster in the warmth has p below 0"),
        told_in="%", tell=lambda p: (1 + 1 / 293.15) ** p - 1)]) -> Setup:
    """Make the stiffness of all films depend on temperature."""
    return setup.with_films(
        lambda film: replace(film, temperature_power=film.temperature_power + p))


def _shared(first: float, second: float) -> float:
    return 1 - (1 - first) * (1 - second)


@effect("The grips hold the width of strips that are said to be free to narrow.",
        finding="The strips are held in their width, {w} of the way from a uniaxial test to pure "
                "shear",
        check="measure the width of a stretched strip half-way between the grips",
        shows_in=(Observable.STRESS,))
def width_not_free(setup: Setup, w: Annotated[float, EffectParameter(
        "share of the logarithm of the width that the grips hold", "", width=0.1, low=0.0, high=1.0,
        reason=("grips hold a strip's ends over about half its width: a tenth of one that is five "
                "times as long as wide; no source"), told_in="%")]) -> Setup:
    """Hold a part of the width of strips that should be free."""
    return setup.with_rig(width_held=_shared(setup.rig.width_held, w))


@effect("Strips narrow that are said to be held in their width, as in pure shear.",
        finding="The strips narrow, {w} of the way from pure shear to a uniaxial test",
        check="measure the width of a stretched strip half-way between the grips",
        shows_in=(Observable.STRESS,))
def width_not_held(setup: Setup, w: Annotated[float, EffectParameter(
        "share of a uniaxial strip's logarithm of the width by which they narrow", "", width=0.1,
        low=0.0, high=1.0, reason=(
            "the free edges of a sheet narrow over about half its length: a tenth of one that is "
            "five times as wide as long; no source"), told_in="%")]) -> Setup:
    """Let strips narrow that should be held in their width."""
    return setup.with_rig(width_let=_shared(setup.rig.width_let, w))
