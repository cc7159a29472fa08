"""A run's samples as they were taken, and what is wrong with them before any physics is asked."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import inf

import numpy as np
from numpy.typing import NDArray

from tympan.studies.columns import Sheet
from tympan.studies.diagnosis.history import VoltageHistory
from tympan.studies.files import words_beside
from tympan.studies.signals import through

Array = NDArray[np.float64]

#: Sentences on runs, by key.
WORDS = words_beside(__file__)

#: A jump of the voltage between samples, over its peak: smaller ones are a ramp or noise.
_JUMP = 0.02
#: How near lines come to a voltage, over its peak.
_LINE = 2e-3
#: How near they come to a noisy voltage, over the usual step between samples, so that they do not
#: follow its noise.
_SCATTER = 8.0

#: Samples that are enough to say how a record is sampled.
_MANY = 50
#: Share of its steps that must be alike for it to be evenly sampled.
_EVEN = 0.9
#: How nearly they must be alike.
_ALIKE = 0.02
#: Missing samples in a row that are no harm.
_HARMLESS = 5

#: Equal values at an extreme from which a sensor is at its end.
_OFTEN = 10
#: And so many times as often as any other value, since a display rounds.
_MORE = 8


@dataclass(frozen=True, eq=False)
class SampledRun:
    """A run's samples: times since its first [s], nominal voltages [V], displacements [m].

    ``rest`` before the first [s]; ``line`` of each in its file.
    """

    time: Array
    voltage: Array
    displacement: Array
    rest: float
    line: NDArray[np.int64]

    @property
    def jumps(self) -> NDArray[np.int64]:
        """Numbers of the first samples after the voltage jumped."""
        change = np.abs(np.diff(self.voltage))
        slow = np.minimum(np.r_[inf, change[:-1]], np.r_[change[1:], inf])
        large = change > _JUMP * np.abs(self.voltage).max(initial=0.0)
        return np.flatnonzero(large & (slow < 0.1 * change)) + 1

    def switched(self, jump: int) -> float:
        """When the voltage jumped [s], by the number of the first sample after it."""
        return float(0.5 * (self.time[jump - 1] + self.time[jump]))

    @property
    def history(self) -> VoltageHistory:
        """With jumps at once, half a sample before they are seen."""
        time, voltage = [self.time[:1]], [self.voltage[:1]]
        for begin, end in pairwise([0, *self.jumps.tolist(), len(self.time)]):
            if begin:
                time.append(np.full(2, self.switched(begin)))
                voltage.append(np.array([self.voltage[begin - 1], self.voltage[begin]]))
            some = self.voltage[begin:end]
            scatter = float(np.median(np.abs(np.diff(some)))) if end - begin > 2 else 0.0
            lines = _lines(self.time[begin:end], some, max(
                _LINE * float(np.abs(self.voltage).max(initial=0.0)), _SCATTER * scatter))
            time.append(self.time[begin:end][lines])
            voltage.append(self.voltage[begin:end][lines])
        times, voltages = np.concatenate(time), np.concatenate(voltage)
        kept = np.r_[True, (np.diff(times) > 0) | (np.diff(voltages) != 0)]
        return VoltageHistory(through(times[kept], voltages[kept]), self.rest)


def _lines(time: Array, value: Array, near: float) -> NDArray[np.int64]:
    """Numbers of the samples between which lines come so near to all (Douglas and Peucker)."""
    kept, open_ = {0, len(time) - 1}, [(0, len(time) - 1)]
    while open_:
        begin, end = open_.pop()
        if end - begin < 2:
            continue
        line = np.interp(time[begin:end + 1], time[[begin, end]], value[[begin, end]])
        off = np.abs(value[begin:end + 1] - line)
        if off.max() > near:
            middle = begin + int(off.argmax())
            kept.add(middle)
            open_ += [(begin, middle), (middle, end)]
    return np.array(sorted(kept))


def run_of(transients: Sheet, rows: NDArray[np.int64]) -> SampledRun:
    """Of the rows of a run; a rest that is not said lasted for ever."""
    time, rest = transients.t[rows], transients.rest[rows]
    stated = rest[np.isfinite(rest)]
    return SampledRun(time - time[0], transients.voltage[rows], transients.displacement[rows],
                  float(stated[0]) if len(stated) else inf, transients.line[rows])


@dataclass(frozen=True)
class Faults:
    """What is wrong with a record in ``words``, "" for nothing; ``fatal``: it cannot be used."""

    words: str = ""
    fatal: bool = False


def faults(record: SampledRun) -> Faults:
    """A clock that runs back or jumps, a sensor at its end, samples that are missing."""
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
    usual = float(np.median(step)) if len(step) else 0.0
    if len(step) < _MANY or np.mean(np.abs(step / usual - 1) < _ALIKE) < _EVEN:
        return Faults()
    gaps = np.flatnonzero(step > 1.5 * usual)
    missing = step[gaps] / usual - 1
    if len(gaps) and missing.max() > _HARMLESS:
        worst = gaps[int(missing.argmax())]
        return Faults(WORDS["gap"].format(line=record.line[worst + 1], time=step[worst]), True)
    if len(gaps):
        return Faults(WORDS["dropped"].format(count=round(float(missing.sum()))))
    return Faults()


def _saturated(value: Array) -> tuple[int, int] | None:
    """First and last sample at an extreme that far more samples have than any other value."""
    if len(value) < _MANY or np.ptp(value) == 0:
        return None
    _, counts = np.unique(value, return_counts=True)
    for place, extreme in ((-1, value.max()), (0, value.min())):
        others = np.delete(counts, place)
        if counts[place] >= max(_OFTEN, _MORE * int(others.max())):
            there = np.flatnonzero(value == extreme)
            return int(there[0]), int(there[-1])
    return None
