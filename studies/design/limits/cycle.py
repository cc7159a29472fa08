"""Limits over a cycle of the voltage, from none to the working one and back.

A film's stress is largest without voltage, its field at the working one, and others may be largest
between. What a limit measures is sampled along the way; where it is largest between the ends, that
place is sought. The search keeps the limit at both ends and at that place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tympan.studies.case import voltage_ramp
from tympan.studies.design.limits.kinds import DesignLimit
from tympan.studies.design.limits.state import DesignState, Evaluation

#: Voltages at which a limit is looked at, evenly by their squares, both ends among them: what it
#: measures is a smooth function of the square, and three about the largest find its place.
_SAMPLES = 5


def cycle_voltages(working: float, between: bool) -> list[float]:
    """Nominal voltages from none to the working one, with those ``between`` or without [V]."""
    return [float(voltage) for voltage
            in working * np.sqrt(np.linspace(0, 1, _SAMPLES if between else 2))]


def kept_limit(limit: DesignLimit, states: Sequence[DesignState], bound: float) -> Evaluation:
    """A limit of a design in its states from none to the working voltage.

    What has a load has three c: without voltage, at the working one, and where it is largest
    between; where it is not larger there, the higher end stands for it, so that c is continuous.
    """
    working = states[-1]
    if limit.load is None:
        only = limit.evaluate(working, bound)
        at = working.case.voltage if limit.of_voltage else None
        return only._replace(at_V=at, voltages=(at,) * len(only.c))
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
    return Evaluation(worst.value, np.concatenate([each.c for each in evaluations]),
                      np.concatenate([each.slopes for each in evaluations]),
                      at_V=places[2].case.voltage,
                      voltages=tuple(state.case.voltage for state, each in
                                     zip(places, evaluations, strict=True) for _ in each.c),
                      between=inside)


def _highest_between(limit: DesignLimit, states: Sequence[DesignState], loads: Sequence[float],
                     highest: int) -> DesignState:
    """Place where a parabola through the highest load and its neighbours is highest."""
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
