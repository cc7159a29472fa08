"""Readings at rest, ramp by ramp, and the smooth curve of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.studies.columns import Sheet

#: Highest degree of the smooth curves about which rows scatter, in the voltage's square.
DEGREE = 4
#: The median of what is normal without its sign, over the standard deviation.
MEDIAN = 0.6745
#: Share of a reading's variance below which a curve meets it whatever it is: rounding.
_MET = 1e-6


def groups(*columns: Array) -> Numbers:
    """Number of each row's group: of those that have all columns alike, as they come."""
    numbers: dict[tuple[object, ...], int] = {}
    keys = zip(*(column.tolist() for column in columns), strict=True)
    return np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.int64)


@dataclass(frozen=True, eq=False)
class VoltageRamp:
    """Readings on one way up or down: their rows, what was read [m] and smooth columns."""

    rows: Numbers
    read: Array
    columns: Array

    @cached_property
    def _basis(self) -> Array:
        return np.asarray(np.linalg.qr(self.columns)[0])

    @property
    def off(self) -> Array:
        """Residuals of the curve of all readings [m]."""
        return np.asarray(self.read - self._basis @ (self._basis.T @ self.read))

    @property
    def studentised(self) -> Array:
        """The same over what noise of 1 leaves of each; 0 of a reading that is met by any curve."""
        left = 1 - np.sum(self._basis**2, axis=1)
        return np.where(left > _MET, self.off / np.sqrt(np.maximum(left, _MET)), 0.0)

    def without(self, place: int) -> VoltageRamp:
        keep = np.arange(len(self.rows)) != place
        return VoltageRamp(self.rows[keep], self.read[keep], self.columns[keep])

    def expected(self, place: int) -> float:
        """Value of the curve of all others at a reading's place [m]."""
        left = 1 - float(np.sum(self._basis[place] ** 2))
        return float(self.read[place] - self.off[place] / left)


def ramps(static: Sheet, rows: Numbers) -> Iterator[VoltageRamp]:
    """The ways up or down that have more readings than a smooth curve takes."""
    ramp = groups(static.specimen[rows], static.mass[rows], static.run[rows], static.repeat[rows])
    for number in range(int(ramp.max(initial=-1)) + 1):
        some = rows[ramp == number]
        turns = np.sign(np.diff(static.voltage[some], prepend=-np.inf))
        way = np.cumsum(np.r_[True, turns[1:] * turns[:-1] < 0])
        for one in range(1, int(way[-1]) + 1):
            here = some[way == one]
            squared = static.voltage[here] ** 2
            degree = min(DEGREE, len(np.unique(squared)) - 2)
            if degree < 1 or len(here) < degree + 2:
                continue
            yield VoltageRamp(here, static.displacement[here],
                       np.vander(squared / squared.max(), degree + 1))
