"""Equilibria at many voltages, most of them found between two others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tympan.fem.equilibrium.constraints import difference, length
from tympan.fem.equilibrium.newton import Solution, moved, simplified_newton
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import UNNOTICED, Outcome, Ramp
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State

#: By what share of its motion an equilibrium may miss the cubic through those around it.
_ASIDE = 0.01

#: Most voltages that one step leads over: the cubic through its ends must be near those between.
#: Set by trial.
_LONGEST = 3
#: Iterations up to which a step was easy, so that the next one leads over more voltages.
_EASY = 1
#: Iterations above which a step was hard, so that the next one leads to one voltage.
_HARD = 3


def voltage_path(model: Model, force: float, voltages: Sequence[float], pressure: float = 0.0,
                 settings: PathSettings = PathSettings(),
                 start: Solution | None = None) -> Iterator[Outcome]:
    """Equilibria at voltages [V] under a force [N], each started from one found before.

    The path is smooth: where it was easy to follow, one step leads over a few voltages, and those
    on the way are found :func:`between` its ends. Voltages at or above one that has no equilibrium
    have none either and are not searched. ``start`` is as for :func:`equilibrium`.
    """
    outcome: Outcome | None = None
    last: Solution | None = None
    number, stride, failed = 0, 1, np.inf
    while number < len(voltages):
        if outcome is not None and voltages[number] >= failed:
            number += 1
            yield outcome
            continue
        leap = leapt(model, last, voltages[number : number + stride], settings) if last else []
        outcomes = leap or [equilibrium(model, force, voltages[number], pressure, last or start,
                                        settings)]
        effort = max(each.solution.iterations for each in outcomes)
        if (stride > 1 and not leap) or effort > _HARD:
            stride = 1
        elif effort <= _EASY:
            stride = min(2 * stride, _LONGEST)
        for outcome in outcomes:
            if outcome.status == "equilibrium":
                last = outcome.solution
            else:
                failed = voltages[number]
            number += 1
            yield outcome


def leapt(model: Model, start: Solution, voltages: Sequence[float],
          settings: PathSettings = PathSettings()) -> list[Outcome]:
    """Equilibria at several voltages [V] by one natural step to the last of them.

    An empty list if there is no such step, or an equilibrium on the way is not found.
    """
    *inner, last = voltages
    end = Ramp(model, "voltage", last**2, settings).natural(start) if inner else None
    if end is None:
        return []
    solutions = [between(model, start, end, voltage**2, settings) for voltage in inner]
    if not all(solutions):
        return []
    return [Outcome("equilibrium", solution) for solution in (*solutions, end) if solution]


def between(model: Model, start: Solution, end: Solution, voltage_squared: float,
            settings: PathSettings = PathSettings()) -> Solution | None:
    """The equilibrium at U² [V²] between two a natural step apart; None if not found.

    Where the cubic through both by U², with their rates, is, but for a few corrections by both of
    their tangents. A film slack when mounted may go slack on the way, and is not looked for.
    """
    ends = start.state.voltage_squared, end.state.voltage_squared
    if model.slack_when_mounted or not min(ends) < voltage_squared < max(ends):
        return None
    guess = _interpolated(model, start, end, voltage_squared)
    second = None
    if start.tangent is not None and start.tangent.at_hand and not start.tangent.free:
        second = start.tangent, (ends[1] - voltage_squared) / (ends[1] - ends[0])
    solution = simplified_newton(model, guess, settings=settings.newton, tangent=end.tangent,
                                 second=second)
    if solution is None:
        return None
    # Of films in tension on both sides none is further.
    tense = min(start.thinning_margin(model), end.thinning_margin(model)) == np.inf
    if not tense and solution.thinning_margin(model) < 0:
        return None
    missed, gone = (length(model, difference(model, solution.state, state))
                    for state in (guess, start.state))
    return solution if missed <= _ASIDE * gone + UNNOTICED else None


def _interpolated(model: Model, start: Solution, end: Solution, squared: float) -> State:
    """Hermite's cubic by U² [V²]."""
    low, span = start.state.voltage_squared, end.state.voltage_squared - start.state.voltage_squared
    t = (squared - low) / span
    whole = difference(model, end.state, start.state)
    parts = zip(start.rate(model, "voltage"), whole, end.rate(model, "voltage"), strict=True)
    film, plate = (span * t * (1 - t) ** 2 * first + t * t * (3 - 2 * t) * change
                   - span * t * t * (1 - t) * last for first, change, last in parts)
    return moved(model, start.state.under(voltage=squared), (film, plate))
