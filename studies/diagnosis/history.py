"""What a film went through until it was read: the voltages of its run in time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from tympan.fem.rig import Rig
from tympan.studies.data.sampled_run import SampledRun
from tympan.studies.signals import Pieces, nominal, through

Array = NDArray[np.float64]

#: How near lines come to a voltage, over its peak.
_LINE = 2e-3
#: How near they come to a noisy voltage, over the usual step between samples, so that they do not
#: follow its noise.
_SCATTER = 8.0

#: When a held state is read, before the end of its dwell, over that.
_BEFORE = 1e-6

#: Nodes and weights of Gauss's rule over a passage. Set by trial.
_RULE = np.polynomial.legendre.leggauss(12)
#: Places in a passage, nearer to each other where it begins: there a film moves fastest.
_SHARES: Array = ((_RULE[0] + 1) / 2) ** 2
#: Weights of what is at these places in the mean; they add up to 1.
WEIGHTS: Array = _RULE[1] * (_RULE[0] + 1) / 2


@dataclass(frozen=True, eq=False)
class VoltageHistory:
    """Nominal voltages of a run from time 0 on.

    ``rest`` [s]: how long the film was under its mass and the first voltage before that; with 0 the
    mass comes on the flat film at time 0.
    """

    signal: Pieces
    rest: float = inf

    @classmethod
    def of(cls, record: SampledRun) -> VoltageHistory:
        """Of a run's samples, with jumps at once, half a sample before they are seen."""
        time, voltage = [record.time[:1]], [record.voltage[:1]]
        for begin, end in record.holds:
            if begin:
                time.append(np.full(2, record.switched(begin)))
                voltage.append(np.array([record.voltage[begin - 1], record.voltage[begin]]))
            some = record.voltage[begin:end]
            scatter = float(np.median(np.abs(np.diff(some)))) if end - begin > 2 else 0.0
            lines = _lines(record.time[begin:end], some, max(
                _LINE * float(np.abs(record.voltage).max(initial=0.0)), _SCATTER * scatter))
            time.append(record.time[begin:end][lines])
            voltage.append(record.voltage[begin:end][lines])
        times, voltages = np.concatenate(time), np.concatenate(voltage)
        kept = np.r_[True, (np.diff(times) > 0) | (np.diff(voltages) != 0)]
        return cls(through(times[kept], voltages[kept]), record.rest)

    @cached_property
    def whole(self) -> Pieces:
        """With the rest before, where it did not last for ever; from time 0 on."""
        signal = self.signal
        if self.rest in (0.0, inf):
            return signal
        return Pieces(np.r_[0.0, self.rest + signal.time], np.r_[signal.first, signal.voltage])

    def voltage(self, when: Array) -> Array:
        """The signal at times [V]; at a jump what comes after it, beyond its ends as there."""
        breaks = self.signal.breaks
        return nominal(self.signal, np.clip(when, breaks[0], breaks[-1]))

    @property
    def begins(self) -> float:
        """When the run begins on the time axis of the whole [s]."""
        return self.rest if self.rest < inf else 0.0


@dataclass(frozen=True, eq=False)
class Passage:
    """A part of a history [s]; a reading is its mean there, or what is at its end if both are one.

    ``switched``: when the voltage last jumped before it, nan if never; ``swing``: the mean square
    about the mean [m²] by which the plate swung there.
    """

    history: VoltageHistory
    begin: float
    end: float
    switched: float = nan
    swing: float = 0.0

    @property
    def times(self) -> Array:
        """Times of the run [s] over which :data:`WEIGHTS` make the mean."""
        return np.asarray(self.begin + (self.end - self.begin) * _SHARES)

    @property
    def jump(self) -> tuple[float, float]:
        """The voltages before and after it jumped [V]; those at the begin if it never did."""
        signal, when = self.history.signal, self.switched
        if np.isnan(when):
            return signal.first, signal.first
        piece = int(np.argmin(np.abs(signal.breaks[:-1] - when)))
        return (float(signal.within(piece - 1, when)) if piece else 0.0,
                float(signal.within(piece, when)))


@dataclass(frozen=True, eq=False)
class Passages:
    """Passages of some states (``rows``, their numbers) together.

    ``times`` of each, shape (n, places); when they begin and end after the voltage jumped [s],
    inf where it never did; the voltages of that jump [V], shape (2, n); ``histories`` with the
    places among the rows of each.
    """

    rows: NDArray[np.int64]
    times: Array
    begin: Array
    end: Array
    jump: Array
    histories: tuple[tuple[VoltageHistory, NDArray[np.int64]], ...]

    @classmethod
    def of(cls, passages: NDArray[np.object_]) -> Passages:
        """Of states' passages, None of those at rest."""
        rows = np.array([row for row, passage in enumerate(passages) if passage is not None],
                        dtype=np.int64)
        some = [passages[row] for row in rows]
        groups: dict[VoltageHistory, list[int]] = {}
        for place, passage in enumerate(some):
            groups.setdefault(passage.history, []).append(place)
        times = np.array([passage.times for passage in some]).reshape(-1, len(WEIGHTS))
        edges = np.array([(passage.begin, passage.end, passage.switched) for passage in some])
        begin, end, switched = edges.reshape(-1, 3).T
        begin, end = (np.where(np.isnan(switched), inf, edge - switched) for edge in (begin, end))
        jump = np.array([passage.jump for passage in some]).reshape(-1, 2).T
        return cls(rows, times, begin, end, jump,
                   tuple((history, np.array(places)) for history, places in groups.items()))

    def squared(self, rig: Rig, lag: Array | None = None) -> Array:
        """Means of the squared voltage a rig gives the film [V²], behind by lags [s], (n,)."""
        result = np.empty(len(self.rows))
        for history, places in self.histories:
            times = self.times[places]
            voltage = np.asarray(rig.film_voltage(history.voltage(times.ravel())))
            if lag is not None and lag[places[0]] > 0:
                voltage = voltage - _behind(history, rig, times.ravel(), float(lag[places[0]]))
            result[places] = voltage.reshape(times.shape) ** 2 @ WEIGHTS
        return result


def _behind(history: VoltageHistory, rig: Rig, when: Array, lag: float) -> Array:
    """How far what follows a rig's voltage in a time constant [s] is behind it, at times [V]."""
    signal = history.signal
    behind, last = 0.0, float(rig.film_voltage(signal.first))
    result = np.zeros(len(when))
    breaks = signal.breaks.tolist()
    for number, (start, end) in enumerate(pairwise(breaks)):
        low, high = (float(rig.film_voltage(signal.within(number, time))) for time in (start, end))
        behind, last, slope = behind + low - last, high, (high - low) / (end - start)
        inside = (when >= start) & ((when < end) | (end == breaks[-1]))
        kept = np.exp(-(when[inside] - start) / lag)
        result[inside] = behind * kept + slope * lag * (1 - kept)
        kept = np.exp(-(end - start) / lag)
        behind = float(behind * kept + slope * lag * (1 - kept))
    return result


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


def staircase(voltage: Array, dwell: Array) -> list[Passage]:
    """States of a run reached one after the other, each held for so long [s] and then read."""
    ends = np.cumsum(np.maximum(dwell, 1e-6))
    signal = Pieces(np.r_[0.0, np.repeat(ends, 2)[:-1]], np.repeat(voltage, 2))
    history, starts = VoltageHistory(signal, 0.0), np.r_[0.0, ends[:-1]]
    jumped = np.diff(voltage, prepend=0.0) != 0
    # Just before the next voltage comes.
    reads = ends - _BEFORE * (ends - starts)
    return [Passage(history, read, read, start if jump else nan)
            for start, read, jump in zip(starts.tolist(), reads.tolist(), jumped, strict=True)]
