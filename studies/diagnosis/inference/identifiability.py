"""What can be known from some readings before they are made.

What effects must reach to be seen and told apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.inference.fit import fit
from tympan.studies.diagnosis.inference.residual_tests import orthonormal, without
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.hypothesis import FACTORS, SIZES, Cause
from tympan.studies.diagnosis.reduced.simulation import Simulation, bounds_of

Array = NDArray[np.float64]

#: Distances in χ²: seen in 95 % of all cases among many effects; told apart at odds of a hundred to
#: one; not at all.
SEEN, TOLD, SAME = 25.0, 9.2, 0.5

#: The size at which effects are compared, in standard deviations of their priors.
TYPICAL = 2.0


@dataclass(frozen=True, eq=False)
class Signature:
    """What a cause does to readings over noise that stiffness and permittivity do not take up.

    ``columns``: of its parameters at a typical size, shape (rows, parameters).
    """

    cause: Cause
    columns: Array

    @property
    def strength(self) -> float:
        """χ² of the typical size, of the parameter that shows most."""
        return float((self.columns**2).sum(0).max())


@dataclass(frozen=True)
class Detectable:
    """What one effect must reach, in its value's unit; None where nothing it may reach is enough.

    ``seen``: to be noticed; ``told``: to be told from ``rival``, the one most like it.
    """

    cause: Cause
    parameter: str
    unit: str
    seen: float | None
    told: float | None
    rival: str | None
    prior: float

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        return {"effect": str(self.cause), "parameter": self.parameter, "unit": self.unit,
                "seen_from": self.seen, "told_from": self.told, "rival": self.rival,
                "prior_width": self.prior}


@dataclass(frozen=True)
class EffectIdentifiability:
    """What readings can tell.

    ``invisible``: causes that stiffness and permittivity take up; ``classes``: causes that make the
    same readings.
    """

    effects: tuple[Detectable, ...]
    invisible: tuple[Cause, ...]
    classes: tuple[tuple[Cause, ...], ...]


def signatures(simulation: Simulation, table: ReadingTable, unknowns: Array,
               causes: Sequence[Cause]) -> list[Signature]:
    """The signatures of causes about a nominal fit, each at its typical size."""
    heave = simulation.heaves((), unknowns, table.states)
    bounds = bounds_of(simulation, ())
    taken = orthonormal(simulation.jacobian((), unknowns, table, heave, bounds) / table.sigma[:,
                                                                                              None])
    found = []
    for cause in causes:
        columns = [_left_over(simulation, cause, index, unknowns, table)
                   for index in range(len(cause.effect.parameters))]
        found.append(Signature(cause, without(taken, np.stack(columns, 1))))
    return found


def _left_over(simulation: Simulation, cause: Cause, index: int, unknowns: Array,
               table: ReadingTable) -> Array:
    """Residuals of the nominal model fitted to readings with one parameter at its typical size.

    At a smaller size, in proportion, where the typical one has no equilibria.
    """
    bounds = bounds_of(simulation, (cause,))
    share = TYPICAL
    while True:
        moved = np.zeros(bounds.shape[1])
        moved[FACTORS] = unknowns[FACTORS]
        moved[SIZES][index] = share * cause.effect.parameters[index].deviation
        values = simulation.predict((cause,), np.clip(moved, *bounds), table)
        if np.isfinite(values).all():
            refitted = fit(simulation, (), table.with_values(values),
                           unknowns[FACTORS])
            if refitted.possible:
                return refitted.residual * TYPICAL / share
        share /= 2


def distance(one: Signature, other: Signature) -> float:
    """χ² that remains of the first's typical readings when the other may explain them."""
    column = one.columns[:, np.argmax((one.columns**2).sum(0))]
    return float(np.sum(without(orthonormal(other.columns), column[:, None]) ** 2))


def classes_of(found: Sequence[Signature]) -> tuple[tuple[Cause, ...],
                                                    tuple[tuple[Cause, ...], ...]]:
    """Causes nobody can see at the typical size, and classes that nobody can tell apart."""
    invisible = [one.cause for one in found if one.strength < SAME]
    seen = [one for one in found if one.strength >= SAME]
    classes: list[list[Signature]] = []
    for one in seen:
        home = next((group for group in classes
                     if all(distance(one, other) < SAME and distance(other, one) < SAME
                            for other in group)), None)
        if home is None:
            classes.append([one])
        else:
            home.append(one)
    return tuple(invisible), tuple(tuple(one.cause for one in group) for group in classes
                                   if len(group) > 1)


def effect_identifiability(simulation: Simulation, table: ReadingTable, unknowns: Array,
             causes: Sequence[Cause]) -> EffectIdentifiability:
    """What a table's readings can tell, whatever they will be."""
    found = signatures(simulation, table, unknowns, causes)
    invisible, classes = classes_of(found)
    alike = {cause: group for group in classes for cause in group}
    effects = []
    for one in found:
        rivals = [other for other in found if other is not one and other.cause not in invisible
                  and other.cause not in alike.get(one.cause, ())
                  and other.cause.name != one.cause.name]
        effects.append(_detectable(one, min(rivals, key=partial(distance, one), default=None)))
    return EffectIdentifiability(tuple(effects), invisible, classes)


def _detectable(one: Signature, nearest: Signature | None) -> Detectable:
    """Sizes at which the strongest parameter is seen and told apart."""
    index = int(np.argmax((one.columns**2).sum(0)))
    parameter = one.cause.effect.parameters[index]
    typical = TYPICAL * parameter.deviation

    def reached(needed: float, have: float) -> float | None:
        power = 0.25 if parameter.sign == "even" else 0.5
        size = typical * (needed / have) ** power if have > 1e-9 else np.inf
        if size > max(map(abs, parameter.limits)):
            return None
        return parameter.shown(parameter.value(size))

    return Detectable(one.cause, parameter.name, parameter.unit, reached(SEEN, one.strength),
                      reached(TOLD, one.strength if nearest is None else distance(one, nearest)),
                      None if nearest is None else str(nearest.cause),
                      parameter.shown(parameter.width))
