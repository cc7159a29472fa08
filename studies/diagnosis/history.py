"""History of a film until it was read: the voltages of its run in time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import Array, Mask, Numbers
from tympan.fem.rig import Supply
from tympan.studies.data.sampled_run import SampledRun
from tympan.studies.signals import Pieces, nominal, through

#: Largest distance of the lines from the voltage, over its peak.
_LINE = 2e-3
#: Largest distance of the lines from a noisy voltage, over the usual step between samples, so that
#: they do not follow its noise.
_SCATTER = 8.0

#: Time before the end of the dwell at which a held state is read, over the dwell.
_BEFORE = 1e-6

#: Nodes and weights of Gauss's rule over a passage. Set by trial.
_RULE = np.polynomial.legendre.leggauss(12)
#: Places in a passage, denser at its beginning: there a film moves fastest.
_SHARES: Array = ((_RULE[0] + 1) / 2) ** 2
#: Weights of the values at a passage's places in the mean; they add up to 1.
WEIGHTS: Array = _RULE[1] * (_RULE[0] + 1) / 2


@dataclass(frozen=True, eq=False)
class VoltageHistory:
    """Nominal voltages of a run from time 0 on.

    ``rest`` [s]: how long the film was under its mass and the first voltage before time 0; with 0
    the mass is put on the flat film at time 0.
    """

    signal: Pieces
    rest: float = inf

    @classmethod
    def of(cls, record: SampledRun) -> VoltageHistory:
        """Build the history of a run's samples; a jump is half a sample before it is seen."""
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
        """Signal with the rest before it, unless that lasted for ever; from time 0 on."""
        signal = self.signal
        if self.rest in (0.0, inf):
            return signal
        return Pieces(np.r_[0.0, self.rest + signal.time], np.r_[signal.first, signal.voltage])

    def voltage(self, when: Array) -> Array:
        """Evaluate the signal at times [V]; after a jump at its time; constant beyond the ends."""
        breaks = self.signal.breaks
        return nominal(self.signal, np.clip(when, breaks[0], breaks[-1]))

    @property
    def begins(self) -> float:
        """Beginning of the run on the time axis of ``whole`` [s]."""
        return self.rest if self.rest < inf else 0.0

    def jump(self, when: float) -> tuple[float, float]:
        """Find the voltages before and after a jump [V]; twice the first if none (nan)."""
        signal = self.signal
        if np.isnan(when):
            return signal.first, signal.first
        piece = int(np.argmin(np.abs(signal.breaks[:-1] - when)))
        return (float(signal.within(piece - 1, when)) if piece else 0.0,
                float(signal.within(piece, when)))


@dataclass(frozen=True, eq=False)
class Passages:
    """Parts of histories, shape (n,) each; without ``history`` and times for an equilibrium.

    A reading is the mean from ``begin`` to ``end`` [s], or the value at the end if both are equal;
    ``switched``: time of the last voltage jump before it, nan if there was none.
    """

    history: NDArray[np.object_]
    begin: Array
    end: Array
    switched: Array

    @classmethod
    def of(cls, history: VoltageHistory | None, begin: Array, end: Array | None = None,
           switched: Array | float = nan) -> Passages:
        """Build parts of one history; without an ``end`` each is one moment."""
        return cls(np.full(len(begin), history, object), begin, begin if end is None else end,
                   np.full(len(begin), switched))

    def __len__(self) -> int:
        return len(self.begin)

    def __getitem__(self, rows: Mask | Numbers) -> Passages:
        return Passages(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def joined(self, other: Passages) -> Passages:
        return Passages(*(np.concatenate([getattr(self, name), getattr(other, name)])
                          for name in self.__dataclass_fields__))

    @cached_property
    def times(self) -> Array:
        """Times of the run [s] over which :data:`WEIGHTS` make the mean, shape (n, places)."""
        return np.asarray(self.begin[:, None] + (self.end - self.begin)[:, None] * _SHARES)

    @cached_property
    def after(self) -> Array:
        """Times of their beginnings and ends after the voltage jumped [s], shape (2, n).

        Infinite where it never jumped.
        """
        ends = np.stack([self.begin, self.end]) - self.switched
        return np.where(np.isnan(self.switched), inf, ends)

    @cached_property
    def jump(self) -> Array:
        """Voltages before and after that jump [V], shape (2, n); twice the first without one."""
        jumps = [history.jump(when) for history, when in zip(
            self.history, self.switched.tolist(), strict=True)]
        return np.array(jumps).reshape(-1, 2).T

    @cached_property
    def histories(self) -> tuple[tuple[VoltageHistory, Numbers], ...]:
        """Every history with the indices of its parts."""
        groups: dict[VoltageHistory, list[int]] = {}
        for place, history in enumerate(self.history):
            groups.setdefault(history, []).append(place)
        return tuple((history, np.array(places)) for history, places in groups.items())

    def squared(self, supply: Supply, lag: Array | None = None) -> Array:
        """Compute means of the film's squared voltage [V²], delayed by lags [s], shape (n,)."""
        result = np.empty(len(self))
        for history, places in self.histories:
            times = self.times[places]
            voltage = np.asarray(supply.film_voltage(history.voltage(times.ravel())))
            if lag is not None and lag[places[0]] > 0:
                voltage = voltage - _behind(history, supply, times.ravel(), float(lag[places[0]]))
            result[places] = voltage.reshape(times.shape) ** 2 @ WEIGHTS
        return result


def _behind(history: VoltageHistory, supply: Supply, when: Array, lag: float) -> Array:
    """Compute the lag [V] behind the film's voltage of what follows it in a time constant [s]."""
    signal = history.signal
    behind, last = 0.0, float(supply.film_voltage(signal.first))
    result = np.zeros(len(when))
    breaks = signal.breaks.tolist()
    for number, (start, end) in enumerate(pairwise(breaks)):
        low, high = (float(supply.film_voltage(signal.within(number, time)))
                     for time in (start, end))
        behind, last, slope = behind + low - last, high, (high - low) / (end - start)
        inside = (when >= start) & ((when < end) | (end == breaks[-1]))
        kept = np.exp(-(when[inside] - start) / lag)
        result[inside] = behind * kept + slope * lag * (1 - kept)
        kept = np.exp(-(end - start) / lag)
        behind = float(behind * kept + slope * lag * (1 - kept))
    return result


def _lines(time: Array, value: Array, near: float) -> Numbers:
    """Select samples so that lines between them stay that near to all (Douglas and Peucker)."""
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


def staircase(voltage: Array, dwell: Array) -> Passages:
    """Build the states of a run reached in turn, each held for its dwell [s] and then read."""
    ends = np.cumsum(np.maximum(dwell, 1e-6))
    signal = Pieces(np.r_[0.0, np.repeat(ends, 2)[:-1]], np.repeat(voltage, 2))
    starts = np.r_[0.0, ends[:-1]]
    switched = np.where(np.diff(voltage, prepend=0.0) != 0, starts, nan)
    # Just before the next voltage is applied.
    return Passages.of(VoltageHistory(signal, 0.0), ends - _BEFORE * (ends - starts),
                       switched=switched)
