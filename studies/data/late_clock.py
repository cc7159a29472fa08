"""Runs whose voltage and displacement have different clocks: a late trigger, a dead time.

A film starts to move as soon as the voltage changes, however slowly: with inertia its deflection
grows as the square of time, and each lag in series, a filter or a film that charges, adds a power.
So a deflection that stays within its noise for long and then rises steeply began late, and one that
rises before the voltage does began early. No effect does that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.data.sampled_run import SampledRun

#: Samples before the first voltage jump that show the scatter at standstill.
_STILL = 16
#: Standard deviations of the scatter at standstill from which a deflection has begun to move.
_MOVED = 6.0
#: Least share of the largest deflection that it must then have reached.
_SHARE = 0.05
#: Consecutive samples that must have moved: a single one is an outlier.
_ROW = 3
#: Ratio of two levels of a rise. Both must be within the deflection.
_STEEP = 3.0
#: Largest ratio of the time to the first level to the time from there to the second: y ~ tⁿ takes
#: 1/(3^(1/n) − 1), 4.1 with inertia, a film that charges and a sensor that lags (n = 5).
_GROWS = 4.1


@dataclass(frozen=True)
class ClockShift:
    """Delay of a displacement after its voltage [s], with limits; negative if it is earlier."""

    value: float
    low: float
    high: float

    @property
    def deviation(self) -> float:
        """Standard deviation [s] of a delay uniform within its limits."""
        return (self.high - self.low) / 12**0.5


def with_clocks(records: Sequence[SampledRun]) -> list[tuple[SampledRun, ClockShift | None]]:
    """Shift the voltages of late runs by whole samples; give the delay of each run.

    A late run begins to move as the others do but for its delay; if it is alone, the delay has
    limits.
    """
    onsets = [onset(record) for record in records]
    off = [None if found is None or found.low <= 0 <= found.high else found for found in onsets]
    usual = [found.value for found, wrong in zip(onsets, off, strict=True) if found and not wrong]
    result = list[tuple[SampledRun, ClockShift | None]]()
    for record, wrong in zip(records, off, strict=True):
        if wrong is not None:
            if usual:
                value = wrong.value - float(np.median(usual))
                around = 2 * record.step + max(float(np.ptp(usual)), abs(float(np.median(usual))))
                wrong = ClockShift(value, value - around, value + around)
            else:
                wrong = replace(wrong, value=(wrong.low + wrong.high) / 2)
            record = _moved(record, round(wrong.value / record.step))
        result.append((record, wrong))
    return result


def onset(record: SampledRun) -> ClockShift | None:
    """Find when the deflection begins to move after the first jump of the voltage [s].

    ``value`` is the observed time. The limits allow for the slow begin of any rise, and for the
    time between samples. None where it is unclear: too few samples before the jump stand still.
    """
    jumps = record.jumps
    if not len(jumps) or not record.even:
        return None
    jump, end = int(jumps[0]), record.holds[1][1]
    still = slice(0, jump // 2)
    time, read = record.time[:end], record.displacement[:end]
    if len(read[still]) < _STILL:
        return None
    off = np.abs(read - np.median(read[still]))
    noise = float(np.std(read[still]))
    level = max(_MOVED * noise, _SHARE * float(off.max()))
    first, second = (_crossing(off, factor * level) for factor in (1.0, _STEEP))
    if first is None or second is None or first < 1:
        return None
    before = float(time[first - 1])
    rise = float(time[second]) - before
    return ClockShift(float(time[first]) - record.switched(jump),
                      before - _GROWS * rise - float(time[jump]),
                      float(time[first] - time[jump - 1]))


def _crossing(off: Array, level: float) -> int | None:
    """Find the first of some consecutive samples beyond a level."""
    beyond = np.lib.stride_tricks.sliding_window_view(off > level, _ROW).all(axis=1)
    return int(beyond.argmax()) if beyond.any() else None


def _moved(record: SampledRun, count: int) -> SampledRun:
    """Shift the voltages of a record by ``count`` samples to later times."""
    places = np.clip(np.arange(len(record.time)) - count, 0, len(record.time) - 1)
    return replace(record, voltage=record.voltage[places])
