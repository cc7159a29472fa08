"""List of all effects with parameters and priors, as data and in words."""

from __future__ import annotations

from math import isinf
from typing import Any

from tympan.studies.effects import EFFECTS, Effect, EffectParameter
from tympan.studies.effects.effect import Place

#: Words for the place of an effect that is not known yet.
_SOME = {Place.EVERYTHING: "", Place.SPECIMEN: "the specimen", Place.SEGMENT: "A of the specimen",
         Place.PAIR: "A and B of the specimen"}

#: Words before a value for its size, by its power, and for one with a spread.
_SIZES = {1: "", -1: "1 over ", -2: "1/square of "}
_LOGARITHM = "logarithm of "


def listing() -> dict[str, Any]:
    """List every effect as a JSON object by its name; limits that are infinite are None."""
    return {effect.name: {
        "explanation": effect.explanation, "check": direct_check(effect),
        "on_one_specimen": effect.on_one,
        "needs_columns": list(effect.columns),
        "parameters": {item.name: _parameter(item) for item in effect.parameters}}
        for effect in EFFECTS.whole().values()}


def _parameter(item: EffectParameter) -> dict[str, Any]:
    low, high, width, least = (None if isinf(value) else float(f"{item.shown(value):.9g}")
                               for value in (item.low, item.high, item.width, item.least))
    return {"meaning": item.meaning, "unit": item.unit, "sign": item.sign, "least": least,
            "prior": {"distribution": _distribution(item), "of": _size(item) + item.name,
                      "width": width, "low": low, "high": high, "reason": item.reason}}


def _size(item: EffectParameter) -> str:
    return _LOGARITHM if item.spread else _SIZES[item.power]


def _distribution(item: EffectParameter) -> str:
    return "Cauchy" if item.limits[0] < 0 else "half-Cauchy"


def direct_check(effect: Effect) -> str:
    """Advise how to see an effect directly, on any specimen."""
    return effect.check.format(which=_SOME[effect.place])


def named(item: EffectParameter) -> str:
    """Write a parameter's name with its unit."""
    return f"{item.name} [{item.unit}]" if item.unit else item.name


def prior(item: EffectParameter) -> str:
    """Write the prior knowledge of a parameter in words."""
    width, low, high = (f"{item.shown(value):.6g}" for value in (item.width, item.low, item.high))
    of = f" in {_size(item)}{item.name}" if _size(item) else ""
    unit = f" {item.unit}" if item.unit else ""
    return f"{_distribution(item)}{of}, typical {width}{unit}, from {low} to {high}{unit}"
