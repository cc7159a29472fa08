"""Detectable effects before readings are made: which ones are seen and distinguished."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import FACTORS, SIZES, Cause
from tympan.studies.diagnosis.inference.projection import orthonormal, taken_by, without
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.result import Knowable
from tympan.studies.effects import EffectParameter

#: Changes of readings by causes, over noise, that stiffness and permittivity do not absorb: columns
#: of their parameters at a typical size, shape (rows, parameters).
Signatures = dict[Cause, Array]

#: Distance in χ² from which an effect among many is seen in 95 % of all cases.
SEEN = 25.0
#: Distance in χ² from which two effects are distinguished at odds of a hundred to one, 2 ln 100.
TOLD = 9.2
#: Distance in χ² below which two effects are indistinguishable.
SAME = 0.5

#: The size at which effects are compared, in standard deviations of their priors.
TYPICAL = 2.0
#: Smallest size that is tried, in standard deviations: changes are then lost in rounding.
_LEAST = 1e-6


def signatures(simulation: ReadingModel, table: ReadingTable, unknowns: Array,
               causes: Sequence[Cause]) -> Signatures:
    """Compute the signatures of causes about a nominal fit, each at its typical size."""
    low, high = simulation.bounds(())
    jacobian = simulation.prediction((), unknowns, table).jacobian[:, (low < unknowns)
                                                                   & (unknowns < high)]
    taken = taken_by(table.noise.whitened(jacobian))
    return {cause: without(taken, np.stack([_shown(simulation, cause, index, unknowns, table)
                                            for index in range(len(cause.effect.parameters))], 1))
            for cause in causes}


def _shown(simulation: ReadingModel, cause: Cause, index: int, unknowns: Array,
           table: ReadingTable, typical: float = TYPICAL) -> Array:
    """Compute residuals of the nominal model for readings with one parameter at its typical size.

    A smaller size, scaled up in proportion, is used where the typical one has no equilibria; the
    result is zero for a film without an equilibrium.
    """
    bounds = simulation.bounds((cause,))
    share = typical
    while abs(share) > _LEAST:
        moved = np.zeros(bounds.shape[1])
        moved[FACTORS] = unknowns[FACTORS]
        moved[SIZES][index] = share * cause.effect.parameters[index].deviation
        values = simulation.predict((cause,), np.clip(moved, *bounds), table)
        if np.isfinite(values).all():
            refitted = fit(simulation, (), table.with_values(values), unknowns[FACTORS])
            if refitted.possible:
                return refitted.residual * typical / share
        share /= 2
    return np.zeros(len(table))


def shows_when_large(simulation: ReadingModel, cause: Cause, nominal: Fit,
                     table: ReadingTable) -> bool:
    """Check whether an effect that is not seen at its typical size is seen at ten times that.

    Either sign counts: near its limit an effect may be hidden on one side only.
    """
    return any(float(np.sum(_shown(simulation, cause, index, nominal.unknowns, table, typical)
                            ** 2)) >= SAME
               for index, parameter in enumerate(cause.effect.parameters)
               for typical in (10 * TYPICAL, -10 * TYPICAL)[: 1 + (parameter.sign == "signed")])


def visibility(signature: Array) -> float:
    """Compute χ² of the typical size of the parameter that shows most."""
    return float((signature**2).sum(0).max())


def distance(signature: Array, other: Array) -> float:
    """Compute χ² of the first's typical readings that the other cannot explain."""
    column = signature[:, np.argmax((signature**2).sum(0))]
    return float(np.sum(without(orthonormal(other), column[:, None]) ** 2))


def classes_of(signs: Signatures) -> tuple[tuple[Cause, ...], tuple[tuple[Cause, ...], ...]]:
    """Separate causes that are not seen at the typical size; group indistinguishable ones.

    Stiffness and permittivity absorb the first; members of a class give the same readings.
    """
    invisible = tuple(cause for cause in signs if visibility(signs[cause]) < SAME)
    classes: list[list[Cause]] = []
    for cause in signs:
        if cause in invisible:
            continue
        home = next((group for group in classes
                     if all(distance(signs[cause], signs[other]) < SAME
                            and distance(signs[other], signs[cause]) < SAME for other in group)),
                    None)
        if home is None:
            classes.append([cause])
        else:
            home.append(cause)
    return invisible, tuple(tuple(group) for group in classes if len(group) > 1)


def detectable_effects(signs: Signatures) -> list[Knowable]:
    """List the sizes that each effect must reach to be detected, whatever the readings will be."""
    invisible, classes = classes_of(signs)
    alike = {cause: group for group in classes for cause in group}
    effects = []
    for cause, signature in signs.items():
        distances = {other: distance(signature, signs[other]) for other in signs
                     if other.name != cause.name and other not in invisible
                     and other not in alike.get(cause, ())}
        rival = min(distances, key=lambda other: distances[other], default=None)
        parameter = cause.effect.parameters[int(np.argmax((signature**2).sum(0)))]
        apart = visibility(signature) if rival is None else distances[rival]
        effects.append(Knowable(
            effect=str(cause), parameter=parameter.name, unit=parameter.unit,
            seen_from=_reached(parameter, SEEN, visibility(signature)),
            told_from=_reached(parameter, TOLD, apart),
            rival=None if rival is None else str(rival),
            prior_width=parameter.shown(parameter.width)))
    return effects


def _reached(parameter: EffectParameter, needed: float, have: float) -> float | None:
    """Find the value at which χ² is as needed, from the χ² that it has at the typical size."""
    if parameter.switch:
        return 1.0 if have >= needed else None
    power = 0.25 if parameter.sign == "even" else 0.5
    typical = TYPICAL * parameter.deviation
    size = typical * (needed / have) ** power if have > 1e-9 else np.inf
    if size > max(map(abs, parameter.limits)):
        return None
    return parameter.shown(parameter.value(size))
