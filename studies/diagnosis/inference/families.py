"""Sizes of causes, and of families of causes that readings do not distinguish."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from tympan.fem.rig import Loads
from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import Cause, sizes_of
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.effects.effect import Observable
from tympan.studies.effects.findings import FoundSize


def undecided(cause: Cause, read: set[Observable], suspects: Collection[Cause] = ()
              ) -> tuple[Cause, ...]:
    """List causes of one family that readings do not distinguish; none if they single one out.

    ``read``: the quantities that are read. The cause is among those returned, and the first of its
    family among ``suspects`` comes first. Where no quantity would distinguish them, the list needs
    two suspects.
    """
    family = cause.effect.family
    if family is None or (family.told_by and read.issuperset(family.told_by)):
        return ()
    if family.told_by or family.never_told:
        return (cause,)
    alike = tuple(other for other in suspects if other.effect.family is family)
    return alike if len(alike) > 1 and cause in alike else ()


def found_sizes(fit: Fit, cause: Cause) -> dict[str, FoundSize]:
    """List the parameters of a cause at a fit with their 95 % limits."""
    first = sizes_of(fit.hypothesis, cause).start
    sizes = {}
    for number, parameter in enumerate(cause.effect.parameters, first):
        value, *limits = (parameter.value(size) for size in interval(fit, number))
        sizes[parameter.name] = FoundSize(parameter, value, min(limits), max(limits))
    return sizes


def has_size(fit: Fit, cause: Cause) -> bool:
    """Check whether a cause at a fit is present: the limits of some parameter exclude zero."""
    return any(size.clear for size in found_sizes(fit, cause).values())


def family_size(model: ReadingModel, fits: Mapping[Cause, Fit]) -> FoundSize:
    """Measure a family at the fits of some members, with limits that hold for all of them.

    The value is that of the first member: the mean over the specimens that it changes. The limits
    span those at the 95 % limits of the members' sizes, widened to include equivalent members.
    """
    sizes = [_size(model, fitted, cause) for cause, fitted in fits.items()]
    return replace(sizes[0], low=min(size.low for size in sizes),
                   high=max(size.high for size in sizes))


def one_load_instead(fit: Fit, cause: Cause, table: ReadingTable, loads: Loads
                     ) -> dict[float, tuple[float, float]]:
    """Find the limits of the mass [kg] that one of two loads would need instead, by label [kg].

    Where deflections under two loads were read, with stiffness and permittivity fitted, only the
    ratio of the loads matters: one wrong label has the same effect as a mass on every load. Empty
    with more loads, readings of other kinds, springs, mechanisms or gas: these distinguish the two.
    """
    labels = np.unique(table.states.mass).tolist()
    alone = not (loads.spring or loads.biases or loads.plate_pressure)
    if cause.name != "unaccounted_mass" or len(labels) != 2 or not alone or not table.lengths.all():
        return {}
    more = np.array(interval(fit, sizes_of(fit.hypothesis, cause).start)[1:])

    def instead(label: float, other: float) -> tuple[float, float]:
        carried = loads.unaccounted_mass
        masses = (other + carried) * (label + carried + more) / (other + carried + more) - carried
        return float(masses.min()), float(masses.max())

    first, second = labels
    return {first: instead(first, second), second: instead(second, first)}


def _size(model: ReadingModel, fitted: Fit, cause: Cause) -> FoundSize:
    family = cause.effect.family
    assert family is not None
    place = sizes_of(fitted.hypothesis, cause)
    # Changes by the cause in films whose common factors are 1: the factors are not its effect.
    neutral = fitted.unknowns.copy()
    neutral[place] = 0.0
    without = model.extended(fitted.hypothesis, neutral)

    def at(number: int, size: float) -> float:
        unknowns = fitted.unknowns.copy()
        unknowns[number] = size
        found = model.extended(fitted.hypothesis, unknowns)
        pairs = zip(found.specimens, without.specimens, strict=True)
        return float(np.mean([family.of(there, found.rig) - family.of(before, without.rig)
                              for there, before in pairs if cause.specimen in (None, there.name)]))

    every = [at(number, size) for number in range(place.start, place.stop)
             for size in interval(fitted, number)]
    measure, others = family.measure, [share * size for share in family.alike for size in every]
    return FoundSize(measure, every[0], max(min(others), measure.low),
                     min(max(others), measure.high))
