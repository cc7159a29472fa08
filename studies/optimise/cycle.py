"""Limits over a cycle of the voltage, from none to the working one and back.

A film's stress is largest without voltage, its field at the working one, and others may be largest
between. What a limit measures is sampled along the way; where it is largest between the ends, that
place is sought. The search keeps the limit at both ends and at that place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tympan.studies.case import voltage_ramp
from tympan.studies.limits.voltages import EndKind
from tympan.studies.optimise.limits import DesignLimit
from tympan.studies.optimise.state import DesignState

Array = NDArray[np.float64]

#: Voltages at which a limit is looked at, evenly by their squares, both ends among them: what it
#: measures is a smooth function of the square, and three about the largest find its place.
_SAMPLES = 5


@dataclass(frozen=True, eq=False)
class KeptLimit:
    """A limit of a design where it comes nearest to its bound: ``value`` [SI], ``at_V`` volts.

    ``c`` ≤ 0, shape (m,), with ∇c (m, parameters), and the ``voltages`` each c is at. Voltages are
    None where the limit depends on none. ``between``: it comes nearest between the cycle's ends.
    ``end``: how the film ends, where the limit is a margin to that.
    """

    value: float
    at_V: float | None
    c: Array
    slopes: Array
    voltages: tuple[float | None, ...]
    between: bool = False
    end: EndKind | None = None


def cycle_voltages(working: float, between: bool) -> list[float]:
    """Nominal voltages from none to the working one, with those ``between`` or without [V]."""
    return [float(voltage) for voltage
            in working * np.sqrt(np.linspace(0, 1, _SAMPLES if between else 2))]


def kept_limit(limit: DesignLimit, states: Sequence[DesignState], bound: float) -> KeptLimit:
    """A limit of a design in its states from none to the working voltage.

    What has a load has three c: without voltage, at the working one, and where it is largest
    between; where it is not larger there, the higher end stands for it, so that c is continuous.
    """
    working = states[-1]
    if limit.load is None:
        value, c, slopes, end = limit.evaluate(working, bound)
        at = working.case.voltage if limit.of_voltage else None
        return KeptLimit(value, at, c, slopes, (at,) * len(c), end=end)
    loads = [limit.load(state) for state in states]
    ends = [replace(states[0], name="without voltage"),
            replace(working, name="at the working voltage")]
    evaluations = [limit.evaluate(state, bound) for state in ends]
    highest = int(np.argmax(loads))
    higher = int(loads[-1] >= loads[0])
    places, worst = [*ends, ends[higher]], evaluations[higher]
    inside = 0 < highest < len(states) - 1
    if inside:
        between = replace(_highest_between(limit, states, loads, highest), name="in between")
        places[2], worst = between, limit.evaluate(between, bound)
    evaluations.append(worst)
    return KeptLimit(worst.value, places[2].case.voltage,
                     np.concatenate([each.c for each in evaluations]),
                     np.concatenate([each.slopes for each in evaluations]),
                     tuple(state.case.voltage for state, each in
                           zip(places, evaluations, strict=True) for _ in each.c), inside)


def _highest_between(limit: DesignLimit, states: Sequence[DesignState], loads: Sequence[float],
                     highest: int) -> DesignState:
    """Where a parabola through the highest load and its neighbours is highest."""
    assert limit.load is not None
    near, about = states[highest], slice(highest - 1, highest + 2)
    squares = np.array([state.case.voltage for state in states[about]]) ** 2
    slope, tilt = np.polyder(np.polyfit(squares / squares[2], loads[about], 2))
    vertex = -tilt / slope * squares[2] if slope < 0 else squares[1]
    voltage = float(np.sqrt(np.clip(vertex, squares[0], squares[2])))
    (case, outcome), = voltage_ramp(near.model, near.case.mass, (voltage,), near.case.rig,
                                    near.path, near.outcome.solution)
    if outcome.status != "equilibrium":
        return near
    there = replace(near, case=case, outcome=outcome)
    return there if limit.load(there) >= loads[highest] else near
