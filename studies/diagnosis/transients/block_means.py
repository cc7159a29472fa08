"""A transient's samples reduced to as many readings as they contain.

Samples are not independent: noise is correlated, and the plate oscillates. So the samples after a
jump of the voltage are averaged in blocks. These are evenly spaced in the logarithm of time, whole
periods long, and at least eight times the correlation time, so that neighbours are nearly
independent. The oscillation gives two more readings, its frequency and its decay rate. The noise
of a mean comes from the samples' own spectrum (:mod:`~.noise_density`), whatever is stated.

The time of a jump is known only within a sample (:mod:`tympan.studies.data.sampled_run`). So each
mean has its derivative by the time of the jump.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import nan

import numpy as np

from tympan.base.arrays import Array, Mask, Numbers
from tympan.studies.data.sampled_run import SampledRun
from tympan.studies.diagnosis.history import Passages, VoltageHistory
from tympan.studies.diagnosis.transients.noise_density import noise_density
from tympan.studies.diagnosis.transients.ringing import Ringing, ringing

#: Blocks after a jump for each factor e in time: creep follows the logarithm of time.
_BLOCKS = 4
#: Most blocks in a hold. It limits the cost.
_MOST = 40
#: Number of samples up to which each is a reading of its own: they are too few to determine their
#: noise.
_FEW = 60

#: Shortest block in correlation times, so that neighbours are nearly independent.
_APART = 8.0
#: Fewest samples of a block: a line and some scatter about it.
_LEAST = 3

#: Relative uncertainty of the shift of an oscillation's mean by the film's curvature. Set by trial.
_UNSURE = 0.1
#: Error of a mean, as a share of the oscillation's change in one sample: whole periods end between
#: two samples.
_RAGGED = 0.5


@dataclass(frozen=True, eq=False)
class BlockMeans:
    """Blocks of a record: samples ``first`` to before ``last``, shape (blocks,) each.

    Their ``mean`` [m] and its standard deviation ``sigma`` [m]; ``jump``: number of the jump before
    the block, -1 for none; ``voltage``: its root mean square; ``later``: increase of the mean for
    each second by which the jump was later [m/s]. ``passages``: of the run's beginning, then of
    each block. ``swings``: the plate's oscillations, by the number of the jump.
    """

    first: Numbers
    last: Numbers
    jump: Numbers
    passages: Passages
    voltage: Array
    mean: Array
    sigma: Array
    later: Array
    swings: dict[int, Ringing]

    def __getitem__(self, blocks: Mask) -> BlockMeans:
        """Select some of the blocks."""
        return BlockMeans(self.first[blocks], self.last[blocks], self.jump[blocks],
                          self.passages[np.r_[True, blocks]], self.voltage[blocks],
                          self.mean[blocks], self.sigma[blocks], self.later[blocks], self.swings)


def block_means(record: SampledRun, noise: float | None = None) -> BlockMeans:
    """Reduce a record to readings; ``noise``: of a sample [m], used where the record is short."""
    if len(record.time) <= _FEW:
        return _each(record, noise)
    holds = record.holds
    swings = {number: rung for number, (begin, end) in enumerate(holds[1:])
              if (rung := ringing(record.time[begin:end], record.displacement[begin:end]))}
    period = max((1 / swing.frequency for swing in swings.values()), default=0.0)
    begin, end = max(holds, key=lambda hold: hold[1] - hold[0])
    density, correlation = noise_density(record.time[begin:end], record.displacement[begin:end],
                                         1 / period if period else 0.0)
    if noise and not np.isfinite(density):
        density = noise**2 * float(np.median(np.diff(record.time)))
    places, columns = list[tuple[int, int, int]](), list[tuple[float, ...]]()
    for number, (begin, end) in enumerate(holds, -1):
        swing = swings.get(number)
        whole = 1 / swing.frequency if swing else period if number < 0 else 0.0
        for first, last in _blocks(record.time[begin:end], whole, _APART * correlation):
            block = begin + first, begin + last
            places.append((*block, number))
            columns.append(_mean(record, block, number, (begin, end), density))
    firsts, lasts, numbers = np.array(places, dtype=np.int64).reshape(-1, 3).T
    starts, ends, switched, voltage, mean, sigma, later = np.array(columns).reshape(-1, 7).T
    return BlockMeans(firsts, lasts, numbers, _passages(record, starts, ends, switched), voltage,
                      mean, sigma, later, swings)


def _each(record: SampledRun, noise: float | None) -> BlockMeans:
    """Use every sample of a short record as a block."""
    time, read, rows = record.time, record.displacement, np.arange(len(record.time))
    jump = np.searchsorted(record.jumps, rows, "right") - 1
    later, switched = np.zeros(len(rows)), np.full(len(rows), nan)
    for begin, end in record.holds[1:]:
        switched[begin:end] = record.switched(begin)
        if end - begin > 1:
            later[begin:end] = -np.gradient(read[begin:end], time[begin:end])
    return BlockMeans(rows, rows + 1, jump, _passages(record, time, time, switched),
                      record.voltage, read, np.full(len(rows), nan if noise is None else noise),
                      later, {})


def _passages(record: SampledRun, begin: Array, end: Array, switched: Array) -> Passages:
    """Build passages of the run's beginning, then of blocks."""
    return Passages.of(VoltageHistory.of(record), np.r_[0.0, begin], np.r_[0.0, end],
                       np.r_[nan, switched])


def _mean(record: SampledRun, block: tuple[int, int], number: int, hold: tuple[int, int],
          density: float) -> tuple[float, ...]:
    """Find a block's begin and end, time of the jump [s], voltage [V], mean, sigma, later."""
    first, last = block
    span, jump = slice(first, last), hold[0] if number >= 0 else -1
    step = float(record.time[first] - record.time[first - 1]) if first else float(
        record.time[1] - record.time[0])
    begin, end = (float(record.time[row]) + shift for row, shift in (
        (first, -step / 2), (last - 1, step / 2)))
    values = record.displacement[span]
    line = np.polyval(np.polyfit(record.time[span], values, 1), record.time[span])
    swing = float(np.mean((values - line) ** 2)) if last - first > _LEAST else 0.0
    swing = max(swing - density / max(step, 1e-9), 0.0)
    switched = nan if jump < 0 else record.switched(jump)
    begin = 0.0 if not first else switched if first == jump else begin
    size = max(abs(float(values.mean())), 1e-9)
    # Whole periods end between two samples.
    ragged = _RAGGED * np.sqrt(swing) * step / (end - begin)
    unsure = np.hypot(_UNSURE * swing / size, ragged)
    return (begin, end, switched, float(np.sqrt(np.mean(record.voltage[span] ** 2))),
            float(values.mean()), float(np.hypot(np.sqrt(density / (end - begin)), unsure)),
            0.0 if jump < 0 else -_rise(record.displacement, block, hold) / (end - begin))


def _rise(read: Array, block: tuple[int, int], hold: tuple[int, int]) -> float:
    """Compute the rise of the deflection from a block's begin to its end, within a hold [m].

    A hold begins at its first sample: a plate with a mass hardly moves before that, and a film
    without one has moved already.
    """
    begin, end = (read[max(edge - 1, hold[0]):min(edge + 1, hold[1])] for edge in block)
    return float(np.mean(end) - np.mean(begin if block[0] > hold[0] else begin[:1]))


def _blocks(time: Array, period: float, shortest: float) -> Iterator[tuple[int, int]]:
    """Yield first and last samples of growing blocks, whole periods long if there are any."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    least = max(shortest, _LEAST * step)
    length = len(time) * step
    count = min(_MOST, max(4, int(_BLOCKS * np.log(max(length / least, 1.0)))))
    growth = max((length / least) ** (1 / count), 1.02)
    begin = 0.0
    while begin < length - 0.5 * step:
        end = max(begin + least, growth * begin)
        if period:
            end = begin + period * max(1, np.ceil((end - begin) / period - 1e-9))
        if length - end < 0.5 * (end - begin):
            whole = np.floor((length - begin) / period + 1e-9) * period if period else 0.0
            end = begin + whole if whole else length
            edges = np.searchsorted(time - time[0] + step / 2, [begin, end])
            if edges[1] - edges[0] >= _LEAST:
                yield int(edges[0]), int(edges[1])
            return
        edges = np.searchsorted(time - time[0] + step / 2, [begin, end])
        if edges[1] - edges[0] >= _LEAST:
            yield int(edges[0]), int(edges[1])
        begin = end
