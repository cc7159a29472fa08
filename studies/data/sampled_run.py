"""Samples of a run as recorded, and faults that are found without any physics.

A voltage with one value in a sample and another in the next jumped at any time between the two, all
equally probable. The middle is used (:meth:`SampledRun.switched`); the effect of half a sample
either way on readings is a common error (:meth:`SampledRun.unsure`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.studies.columns import Sheet
from tympan.studies.files import words_beside

#: Sentences on runs, by key.
WORDS = words_beside(__file__)

#: Least jump of the voltage between samples, over its peak: smaller ones are a ramp or noise.
_JUMP = 0.02
#: Fewest samples that show how a record is sampled.
_MANY = 50
#: Share of equal steps from which a record is evenly sampled.
_EVEN = 0.9
#: Relative difference within which steps count as equal.
_ALIKE = 0.02
#: Most consecutive missing samples that do no harm.
_HARMLESS = 5

#: Number of equal values at an extreme from which a sensor is saturated.
_OFTEN = 10
#: Least ratio of the number of values at an extreme to that of any other value, since a display
#: rounds.
_MORE = 8


@dataclass(frozen=True, eq=False)
class SampledRun:
    """A run's samples: times since its first [s], nominal voltages [V], displacements [m].

    ``rest``: time before the first sample [s]; ``line``: that of each in its file; ``specimen``,
    ``mass`` [kg] and ``run``: as in the file.
    """

    time: Array
    voltage: Array
    displacement: Array
    rest: float
    line: Numbers
    specimen: str = ""
    mass: float = 0.0
    run: str = ""

    @property
    def name(self) -> str:
        """Specimen, mass and run in words."""
        return f"{self.specimen}, {1e3 * self.mass:.4g} g, {self.run}"

    @property
    def step(self) -> float:
        """Median time between samples [s], 0 for a single one."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0

    @property
    def even(self) -> bool:
        """Whether there are many samples, nearly all evenly spaced."""
        step = np.diff(self.time)
        return len(step) >= _MANY and self.step > 0 and bool(
            np.mean(np.abs(step / self.step - 1) < _ALIKE) >= _EVEN)

    @property
    def holds(self) -> list[tuple[int, int]]:
        """First sample of each hold between jumps, and the sample after its last."""
        return list(pairwise([0, *self.jumps.tolist(), len(self.time)]))

    @property
    def jumps(self) -> Numbers:
        """Numbers of the first samples after the voltage jumped."""
        change = np.abs(np.diff(self.voltage))
        slow = np.minimum(np.r_[inf, change[:-1]], np.r_[change[1:], inf])
        large = change > _JUMP * np.abs(self.voltage).max(initial=0.0)
        return np.flatnonzero(large & (slow < 0.1 * change)) + 1

    def switched(self, jump: int) -> float:
        """Estimate the time of a jump [s], given the first sample after it: the middle."""
        return float(0.5 * (self.time[jump - 1] + self.time[jump]))

    def unsure(self, jump: int) -> float:
        """Compute the standard deviation of that: uniform between two samples [s]."""
        return float(self.time[jump] - self.time[jump - 1]) / 12**0.5


def runs_of(transients: Sheet) -> Iterator[SampledRun]:
    """Yield the runs of a file, by specimen, mass and run; an unstated rest is infinite."""
    keys = np.unique(np.stack([np.unique(transients[name], return_inverse=True)[1].ravel()
                               for name in ("specimen", "mass", "run")]), axis=1,
                     return_inverse=True)[1].ravel()
    for number in range(int(keys.max()) + 1):
        rows = np.flatnonzero(keys == number)
        time, rest = transients.t[rows], transients.rest[rows]
        stated = rest[np.isfinite(rest)]
        yield SampledRun(time - time[0], transients.voltage[rows], transients.displacement[rows],
                         float(stated[0]) if len(stated) else inf, transients.line[rows],
                         str(transients.specimen[rows[0]]), float(transients.mass[rows[0]]),
                         str(transients.run[rows[0]]))


@dataclass(frozen=True)
class Faults:
    """Faults of a record in ``words``, "" for none; ``fatal``: it cannot be used."""

    words: str = ""
    fatal: bool = False


def faults(record: SampledRun) -> Faults:
    """Find a clock that runs back or jumps, a saturated sensor, and missing samples."""
    step = np.diff(record.time)
    back = np.flatnonzero(step <= 0)
    if len(back):
        return Faults(WORDS["back"].format(line=record.line[back[0] + 1], count=len(back)), True)
    stuck = _saturated(record.displacement)
    if stuck is not None:
        first, last = stuck
        return Faults(WORDS["saturated"].format(
            first=record.line[first], last=record.line[last],
            value=1e3 * record.displacement[first]), True)
    if not record.even:
        return Faults()
    usual = record.step
    gaps = np.flatnonzero(step > 1.5 * usual)
    missing = step[gaps] / usual - 1
    if len(gaps) and missing.max() > _HARMLESS:
        worst = gaps[int(missing.argmax())]
        return Faults(WORDS["gap"].format(line=record.line[worst + 1], time=step[worst]), True)
    if len(gaps):
        return Faults(WORDS["dropped"].format(count=round(float(missing.sum()))))
    return Faults()


def _saturated(value: Array) -> tuple[int, int] | None:
    """Find the first and last sample at an extreme that far more samples have than any other."""
    if len(value) < _MANY or np.ptp(value) == 0:
        return None
    _, counts = np.unique(value, return_counts=True)
    for place, extreme in ((-1, value.max()), (0, value.min())):
        others = np.delete(counts, place)
        if counts[place] >= max(_OFTEN, _MORE * int(others.max())):
            there = np.flatnonzero(value == extreme)
            return int(there[0]), int(there[-1])
    return None
