"""All effects with parameters and priors: as data, for a terminal, as a page."""

from __future__ import annotations

from importlib import resources
from math import isinf
from typing import Any

import jinja2

from tympan.studies.effects import EFFECTS, EffectParameter

#: What the size of a value is where its power is not 1.
_INVERSE = "1/square of "


def listing() -> dict[str, Any]:
    """Every effect as a JSON object by its name; limits that are infinite are None."""
    return {effect.name: {
        "explanation": effect.explanation, "on_one_specimen": effect.on_one,
        "needs_columns": list(effect.columns), "lumped_model_only": effect.lumped,
        "parameters": {item.name: _parameter(item) for item in effect.parameters}}
        for effect in EFFECTS.values()}


def text() -> str:
    """Every effect in a few lines."""
    return _written("text")


def markdown() -> str:
    """The page ``docs/effects.md``."""
    return _written("page")


def _written(part: str) -> str:
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, trim_blocks=True,
                                     lstrip_blocks=True)
    environment.filters |= {"named": named, "prior": _prior}
    words = resources.files("tympan.studies.effects").joinpath("listing.txt")
    template = environment.from_string(words.read_text(encoding="utf-8"))
    return str(getattr(template.module, part)(EFFECTS.values())).removesuffix("\n")


def _parameter(item: EffectParameter) -> dict[str, Any]:
    low, high, width, least = (None if isinf(value) else float(f"{item.shown(value):.9g}")
                               for value in (item.low, item.high, item.width, item.least))
    return {"meaning": item.meaning, "unit": item.unit, "sign": item.sign, "least": least,
            "prior": {"distribution": _distribution(item), "of": _INVERSE * (item.power < 0)
                      + item.name, "width": width, "low": low, "high": high,
                      "reason": item.reason}}


def _distribution(item: EffectParameter) -> str:
    return "normal" if item.limits[0] < 0 else "half-normal"


def named(item: EffectParameter) -> str:
    """A parameter's name with its unit."""
    return f"{item.name} [{item.unit}]" if item.unit else item.name


def _prior(item: EffectParameter) -> str:
    width, low, high = (f"{item.shown(value):.6g}" for value in (item.width, item.low, item.high))
    of = f" in {_INVERSE}{item.name}" if item.power < 0 else ""
    unit = f" {item.unit}" if item.unit else ""
    return f"{_distribution(item)}{of}, width {width}{unit}, from {low} to {high}{unit}"
