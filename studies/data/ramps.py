"""Static readings, ramp by ramp, and the smooth curve of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.studies.columns import Sheet

#: Highest degree of the smooth curves about which rows scatter, in the voltage's square.
DEGREE = 4
#: Median of the absolute value of a normal variable, over its standard deviation.
MEDIAN = 0.6745
#: Share of a reading's variance below which a curve passes through it in any case: rounding.
_MET = 1e-6


def groups(*columns: Array) -> Numbers:
    """Assign group numbers to rows that are equal in all columns, in order of appearance."""
    numbers: dict[tuple[object, ...], int] = {}
    keys = zip(*(column.tolist() for column in columns), strict=True)
    return np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.int64)


@dataclass(frozen=True, eq=False)
class VoltageRamp:
    """Readings on one way up or down: their rows, their values [m] and smooth columns."""

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
        """Residuals over their deviations for noise of 1; 0 where any curve meets the reading."""
        left = 1 - np.sum(self._basis**2, axis=1)
        return np.where(left > _MET, self.off / np.sqrt(np.maximum(left, _MET)), 0.0)

    def without(self, place: int) -> VoltageRamp:
        keep = np.arange(len(self.rows)) != place
        return VoltageRamp(self.rows[keep], self.read[keep], self.columns[keep])

    def expected(self, place: int) -> float:
        """Evaluate the curve of all other readings at a reading [m]."""
        left = 1 - float(np.sum(self._basis[place] ** 2))
        return float(self.read[place] - self.off[place] / left)


def ramps(static: Sheet, rows: Numbers) -> Iterator[VoltageRamp]:
    """Yield the ways up or down that have more readings than a smooth curve has coefficients."""
    ramp = groups(static.specimen[rows], static.mass[rows], static.run[rows], static.repeat[rows],
                  static.drive[rows])
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
