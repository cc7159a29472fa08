"""All effects with parameters and priors: as data, for a terminal, as a page."""

from __future__ import annotations

from collections.abc import Iterator
from math import isinf
from typing import Any

from tympan.studies.effects import EFFECTS, Effect, EffectParameter

_INTRODUCTION = """# Effects

Written by `tympan effects --markdown`. An effect is something measured data may hold and the
nominal model leaves out; it is an edit of the specimens or of the rig, so that `tympan solve`
honours it. What is known of a parameter before any data is a normal distribution about no effect,
with the standard deviation and limits given here, and the reason for it. A sign that is even cannot
be seen on a specimen that is its own mirror image. Where a reason says "no source", it is a
judgement: a diagnosis must say whether its verdict moves with it.
"""

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
    return "\n".join(line for effect in EFFECTS.values() for line in _lines(effect))


def markdown() -> str:
    """The page ``docs/effects.md``."""
    return "\n".join([_INTRODUCTION,
                      *(line for effect in EFFECTS.values() for line in _section(effect))])


def _parameter(item: EffectParameter) -> dict[str, Any]:
    low, high, width, least = (None if isinf(value) else float(f"{item.shown(value):.9g}")
                               for value in (item.low, item.high, item.width, item.least))
    return {"meaning": item.meaning, "unit": item.unit, "sign": item.sign, "least": least,
            "prior": {"distribution": _distribution(item), "of": _INVERSE * (item.power < 0)
                      + item.name, "width": width, "low": low, "high": high,
                      "reason": item.reason}}


def _distribution(item: EffectParameter) -> str:
    return "normal" if item.limits[0] < 0 else "half-normal"


def _lines(effect: Effect) -> Iterator[str]:
    notes = ["of one specimen" if effect.on_one else "",
             f"needs {', '.join(effect.columns)}" if effect.columns else "",
             "of the lumped model only" if effect.lumped else ""]
    yield f"{effect.name}\n  {effect.explanation}"
    yield from (f"  {note}" for note in notes if note)
    for item in effect.parameters:
        yield f"  {named(item)}: {item.meaning}; {item.sign}"
        yield f"    prior: {_prior(item)}\n    why: {item.reason}"


def _section(effect: Effect) -> Iterator[str]:
    yield f"## {effect.name}\n"
    notes = [effect.explanation, "It happens to one specimen." if effect.on_one else "",
             f"It needs the column {', '.join(effect.columns)}." if effect.columns else "",
             "It is one of the lumped model only." if effect.lumped else ""]
    yield " ".join(filter(None, notes)) + "\n"
    yield "| parameter | meaning | sign | prior | reason |\n|---|---|---|---|---|"
    for item in effect.parameters:
        yield f"| {named(item)} | {item.meaning} | {item.sign} | {_prior(item)} | {item.reason} |"
    yield ""


def named(item: EffectParameter) -> str:
    """A parameter's name with its unit."""
    return f"{item.name} [{item.unit}]" if item.unit else item.name


def _prior(item: EffectParameter) -> str:
    width, low, high = (f"{item.shown(value):.6g}" for value in (item.width, item.low, item.high))
    of = f" in {_INVERSE}{item.name}" if item.power < 0 else ""
    unit = f" {item.unit}" if item.unit else ""
    return f"{_distribution(item)}{of}, width {width}{unit}, from {low} to {high}{unit}"
