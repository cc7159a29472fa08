"""Families of causes that readings do not tell apart: what is said of them together."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from tympan.studies.diagnosis.evidence.kind import Model
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import Cause, sizes_of
from tympan.studies.effects.effect import Quantity
from tympan.studies.effects.findings import FoundSize


def undecided(cause: Cause, told: set[Quantity], suspects: Collection[Cause] = ()
              ) -> tuple[Cause, ...]:
    """Causes of one family that readings do not tell from each other; none if they tell this one.

    By readings that tell these quantities. The cause is among them, the first of its family among
    ``suspects`` is the first; without quantities that would tell them, it takes two suspects.
    """
    family = cause.effect.family
    if family is None or (family.told_by and told.issuperset(family.told_by)):
        return ()
    if family.told_by or family.never_told:
        return (cause,)
    alike = tuple(other for other in suspects if other.effect.family is family)
    return alike if len(alike) > 1 and cause in alike else ()


def family_size(model: Model, fits: Mapping[Cause, Fit]) -> FoundSize:
    """The measure of a family at fits of some of it, with limits that hold it for all of them.

    The value is that of the first one: the mean of the specimens that it changes. The limits are
    those at the 95 % limits of the causes' sizes, and further by what others have that do as much.
    """
    sizes = [_size(model, fitted, cause) for cause, fitted in fits.items()]
    return replace(sizes[0], low=min(size.low for size in sizes),
                   high=max(size.high for size in sizes))


def _size(model: Model, fitted: Fit, cause: Cause) -> FoundSize:
    family = cause.effect.family
    assert family is not None
    place, stated = sizes_of(fitted.hypothesis, cause), model.setup

    def at(number: int, size: float) -> float:
        unknowns = fitted.unknowns.copy()
        unknowns[number] = size
        found = model.extended(fitted.hypothesis, unknowns)
        pairs = zip(found.specimens, stated.specimens, strict=True)
        return float(np.mean([family.of(there, found.rig) - family.of(before, stated.rig)
                              for there, before in pairs if cause.which in (None, there.name)]))

    every = [at(number, size) for number in range(place.start, place.stop)
             for size in interval(fitted, number)]
    measure, others = family.measure, [share * size for share in family.alike for size in every]
    return FoundSize(measure, every[0], max(min(others), measure.low),
                     min(max(others), measure.high))
