"""Runs whose voltage and displacement are not of one clock: a late trigger, a dead time.

What a voltage moves begins to move at once, however slowly: with inertia its deflection grows as
the square of time, and each stage that follows late, a filter or a film that charges, adds a power.
So a deflection that long stays within its noise and then rises steeply began late, and one that
rises before the voltage does began early: no effect does that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.data.sampled_run import SampledRun

#: Samples of the run before the voltage jumps that tell what it is to stand still.
_STILL = 16
#: Standard deviations of these from which a deflection has begun to move.
_MOVED = 6.0
#: And the least share of the largest deflection from then on.
_SHARE = 0.05
#: Samples in a row that must have moved: a single one is an outlier.
_ROW = 3
#: Factor between two levels of a rise. Each must be within the deflection.
_STEEP = 3.0
#: Time to the first level over that from there to the second at most: y ~ tⁿ takes 1/(3^(1/n) − 1),
#: 4.1 with inertia, a film that charges and a sensor that is late (n = 5).
_GROWS = 4.1


@dataclass(frozen=True)
class ClockShift:
    """Delay of a displacement after its voltage [s], with limits; below 0 it is earlier."""

    value: float
    low: float
    high: float

    @property
    def deviation(self) -> float:
        """Standard deviation [s] of a delay that is anywhere within its limits."""
        return (self.high - self.low) / 12**0.5


def with_clocks(records: Sequence[SampledRun]) -> list[tuple[SampledRun, ClockShift | None]]:
    """Runs with the voltages of late ones moved by whole samples, and how late each was.

    A run that is late begins to move as the others do but for its delay; alone, within limits.
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
    """Time at which the deflection begins to move after the first jump of the voltage [s].

    ``value``: as it is seen; the limits allow for the slow begin of any rise, and for all times
    between samples. None where it is not clear: before the jump too few samples stand still.
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
    """The first of some samples in a row beyond a level."""
    beyond = np.lib.stride_tricks.sliding_window_view(off > level, _ROW).all(axis=1)
    return int(beyond.argmax()) if beyond.any() else None


def _moved(record: SampledRun, count: int) -> SampledRun:
    """Record with voltages so many samples later."""
    places = np.clip(np.arange(len(record.time)) - count, 0, len(record.time) - 1)
    return replace(record, voltage=record.voltage[places])
