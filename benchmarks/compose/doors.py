"""Doors to one actuator, compared: what each says of it against `solve`, `limits` and `modes`.

Tolerances, designs, sweeps, sensors and lumped models reach films by reduced films, by paths of
their own or by circles. Each is asked of the same film on the same rig under the same loads, so
its numbers are those of the finite elements, as far as its model goes.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.compose.answering import OUTPUT
from benchmarks.compose.questions import MADE

#: Numbers of an actuator by quantity; None where a door has none.
Numbers = Mapping[str, float | None]
#: Columns of a sweep that are limits.
_LIMITS = ("snap_through", "tension", "breakdown", "instability", "pull_in")


@dataclass(frozen=True)
class Door:
    """A door by its question: how its answer reads, and the questions that it is compared with.

    ``of``: what stands before the names of these, "best " for the film that `design` found.
    """

    name: str
    question: str
    read: Callable[[Any, Path], Numbers]
    of: str = ""


def _solve(found: Any, _: Path) -> Numbers:
    if found["status"] != "equilibrium":
        return {}
    stroke = found["stroke_m"]
    return {"deflection": found["deflection_m"], "stroke": stroke,
            "size of the stroke": None if stroke is None else abs(stroke),
            "capacitance": found["capacitance_F"], "largest field": found["max_field_V_per_m"],
            "breakdown margin": found["breakdown_margin"]}


def _first(limits: Any) -> Numbers:
    return {"first limit": limits[limits["first"]]["voltage_V"] if limits["first"] else None}


def _limits(found: Any, _: Path) -> Numbers:
    return _first(found)


def _modes(found: Any, _: Path) -> Numbers:
    heave = [mode["frequency_Hz"] for mode in found["modes"] if mode["name"] == "heave"]
    return {"frequency": heave[0] if heave else None}


def _force(found: Any, _: Path) -> Numbers:
    if not found["loads"]:
        return {}
    crossing = found["loads"][0]["crossings"]
    charged = [each for each in crossing if each["voltage_V"] and each["reached"]]
    return {"blocked force": found["blocked_force_N"], "stroke": found["stroke_m"],
            "deflection": charged[0]["displacement_m"] if charged else None}


def _curve(found: Any, _: Path) -> Numbers:
    return _first(found["curves"][0]["limits"])


def _sense(found: Any, _: Path) -> Numbers:
    state = next((each for each in found["states"] if each["voltage_V"]), None)
    return {} if state is None else {"deflection": state["displacement_m"],
                                     "capacitance": state["capacitance_F"]}


def _tolerance(found: Any, _: Path) -> Numbers:
    names = {"deflection": "deflection_m", "stroke": "stroke_m", "capacitance": "capacitance_F",
             "frequency": "frequency_Hz", "first limit": "limit_V",
             "blocked force": "blocked_force_N"}
    quantities = found["quantities"]
    return {name: quantities[key]["nominal"] for name, key in names.items() if key in quantities}


def _path(found: Any, _: Path) -> Numbers:
    start = found["stations"][0]
    return {"deflection": start["deflection_m"], "stroke": start["stroke_m"],
            "capacitance": start["capacitance_F"]}


def _sensitivity(found: Any, _: Path) -> Numbers:
    return {"deflection": found["quantities"]["heave"]["value"]} \
        if found["status"] == "equilibrium" else {}


def _response(found: Any, _: Path) -> Numbers:
    return {"deflection": found["deflection_m"], "frequency": found["natural_Hz"]}


def _linearise(found: Any, _: Path) -> Numbers:
    linear = found["linear"][0]
    return {"deflection": linear["deflection_m"], "frequency": linear["film_frequency_Hz"]}


def _sweep(_: Any, folder: Path) -> Numbers:
    with (folder / MADE / "sweep.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if float(row["voltage_V"])]
    row = rows[0]
    if row["status"] != "equilibrium":
        return {}
    limits = [value for name in _LIMITS
              if (value := _number(row, f"{name}_V")) is not None]
    return {"deflection": _number(row, "deflection_m"), "stroke": _number(row, "stroke_m"),
            "capacitance": _number(row, "capacitance_F"), "frequency": _number(row, "heave_Hz"),
            "largest field": _number(row, "max_field_V_per_m"),
            "first limit": min(limits, default=None)}


def _number(row: Mapping[str, str], name: str) -> float | None:
    return float(row[name]) if row.get(name) else None


def _designed(column: str) -> Callable[[Any, Path], Numbers]:
    names = {"size of the stroke": "stroke", "largest field": "max_field", "breakdown margin":
             "breakdown_margin", "frequency": "frequency"}

    def read(found: Any, _: Path) -> Numbers:
        quantities = {each["name"]: each[column] for each in found["films"][0]["quantities"]}
        return {name: quantities.get(key) for name, key in names.items()}

    return read


#: Doors that the others are compared with.
_REFERENCES = (Door("solve", "solve", _solve), Door("limits", "limits", _limits),
               Door("modes", "modes", _modes))
#: The reference of what these do not tell.
_HELD = Door("force", "force", lambda found, _: {"blocked force": found["blocked_force_N"]}
             if found["loads"] else {})
DOORS = (
    Door("tolerance's film", "tolerance", _tolerance), Door("sweep's row", "sweep", _sweep),
    Door("design's given film", "design", _designed("given")),
    Door("design's best", "design", _designed("value"), "best "),
    Door("its reduced film", "design", _designed("reduced"), "best "),
    Door("lumped's rest", "lumped linearise", _linearise), Door("sense", "sense", _sense),
    Door("force", "force", _force), Door("curve", "curve", _curve), Door("path", "path", _path),
    Door("sensitivity", "sensitivity", _sensitivity), Door("response", "response", _response))


def numbers(door: Door, case: Path, before: str = "") -> Numbers:
    """Numbers of a door's answer in the folder of a case; none where there is none."""
    folder = case / (before + door.question).replace(" ", "_")
    try:
        answer = json.loads((folder / OUTPUT).read_text(encoding="utf-8"))
        return {name: value for name, value in door.read(answer, folder).items()
                if value is not None}
    except (OSError, ValueError):  # not asked, refused, or failed
        return {}


def differences(folder: Path, cases: Iterable[str]) -> Iterator[str]:
    """Largest relative difference of each door and quantity over cases, by folder's name."""
    found: dict[tuple[str, str], list[tuple[float, str]]] = {}
    for case in cases:
        for of in ("", "best "):
            known = {name: value for door in _REFERENCES
                     for name, value in numbers(door, folder / case, of).items()}
            known |= {} if of else numbers(_HELD, folder / case)
            for door in DOORS:
                if door.of != of:
                    continue
                for name, value in numbers(door, folder / case).items():
                    if name in known and (door.name, name) != (_HELD.name, "blocked force"):
                        found.setdefault((door.name, name), []).append((_apart(value, known[name]),
                                                                        case))
    yield f"{'door':20s} {'quantity':16s} cases    median   largest"
    for (door, name), apart in found.items():
        largest, case = max(apart)
        yield (f"{door:20s} {name:16s} {len(apart):5d}  {median(each for each, _ in apart):.1e}  "
               f" {largest:.1e}  {case}")


def _apart(value: float, known: float) -> float:
    """Relative difference; infinite from nothing."""
    if value == known:
        return 0.0
    return abs(value - known) / abs(known) if known else float("inf")
