"""Equilibria at many voltages; most of them are found between two others."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import LoadRamp, Outcome
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.span import GivenLoad, Span
from tympan.fem.membrane.model import Model

#: Largest number of voltages in one step: the cubic through its ends must be accurate at all of
#: them. Set by trial.
_LONGEST = 3
#: Largest number of iterations of an easy step; the next step then has more voltages.
_EASY = 1
#: Number of iterations above which a step was hard; the next step then has one voltage.
_HARD = 3


def voltage_path(model: Model, force: float, voltages: Sequence[float], pressure: float = 0.0,
                 settings: PathSettings = PathSettings(),
                 start: Solution | None = None) -> Iterator[Outcome]:
    """Yield equilibria at voltages [V] under a force [N], each started from an earlier one.

    The path is smooth. After an easy step, one step covers several voltages, and the equilibria on
    the way are found between its ends (:class:`Span`). If a voltage has no equilibrium, higher ones
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
    """Solve for equilibria at several voltages [V] with one step to the last of them.

    The list is empty if the step fails or an equilibrium on the way is not found.
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
