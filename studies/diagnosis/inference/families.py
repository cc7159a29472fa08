"""What is told of a cause that readings do not tell from others of its family: how much they do."""

from __future__ import annotations

import numpy as np

from tympan.studies.diagnosis.evidence.kind import Model
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.hypothesis import Cause, sizes_of
from tympan.studies.effects.effect import Family, Quantity
from tympan.studies.effects.findings import FoundSize


def undecided(cause: Cause, told: set[Quantity]) -> Family | None:
    """The family of a cause, where readings that tell these quantities do not tell its members."""
    family = cause.effect.family
    return None if family is None or told.issuperset(family.told_by) else family


def family_size(model: Model, fitted: Fit, cause: Cause, family: Family) -> FoundSize:
    """The measure of a family at the fit of one of it, with limits that hold it for all of them.

    The mean of the specimens that the cause changes. The limits are those at the 95 % limits of the
    cause's sizes, and further by what others have that do as much.
    """
    place, stated = sizes_of(fitted.hypothesis, cause), model.setup.specimens

    def at(number: int, size: float) -> float:
        unknowns = fitted.unknowns.copy()
        unknowns[number] = size
        found = model.extended(fitted.hypothesis, unknowns).specimens
        return float(np.mean([family.of(there) - family.of(before)
                              for there, before in zip(found, stated, strict=True)
                              if cause.which in (None, there.name)]))

    every = [at(number, size) for number in range(place.start, place.stop)
             for size in interval(fitted, number)]
    measure, (fewest, most) = family.measure, family.alike
    return FoundSize(measure, every[0], max(fewest * min(every), measure.low),
                     min(most * max(every), measure.high))
