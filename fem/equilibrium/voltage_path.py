"""Equilibria at many voltages, most of them found between two others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import LoadRamp, Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.span import GivenLoad, Span
from tympan.fem.membrane.model import Model

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
    on the way are found between its ends, as a :class:`Span` says. Voltages at or above one that
    has no equilibrium have none either and are not searched. ``start`` is as for
    :func:`equilibrium`.
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
    end = LoadRamp(model, "voltage", last**2, settings).natural(start) if inner else None
    if end is None:
        return []
    span = Span(model, start, end, GivenLoad("voltage"), settings.newton)
    solutions = [span.at(voltage**2) for voltage in inner]
    if not all(solutions):
        return []
    return [Outcome("equilibrium", solution) for solution in (*solutions, end) if solution]
