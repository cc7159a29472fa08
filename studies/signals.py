"""Voltage signals: steps, ramps, sines, pseudo-random steps, and series from a CSV file.

A signal runs from time 0 to its ``end`` [s] and is smooth between ``breaks`` [s], both included. It
begins from rest at ``first`` [V]; ``peak`` is its largest magnitude [V]. ``within(piece, time)`` is
its voltage [V] at times of pieces between two breaks (by number), their ends included.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.base.fields import Key, asks
from tympan.base.toml_reader import POSITIVE, Rule
from tympan.base.units import LEAST_STEP
from tympan.fem.rig import Supply
from tympan.studies.columns import Column, read_sheet
from tympan.tables.meanings import TIMES, VOLTAGES

_HIGHEST = 1e6
_DURATION: Rule = (lambda x: LEAST_STEP <= x < np.inf, "must be positive, 1 ns at least")
#: Smallest change of a slope, over the steepest slope, at which a line bends.
_STRAIGHT = 1e-9


@dataclass(frozen=True, eq=False)
class Pieces:
    """Straight lines between points of ``time`` [s] and ``voltage`` [V]; equal times are a jump."""

    time: Array
    voltage: Array

    def __post_init__(self) -> None:
        time, voltage = self.time, self.voltage
        if len(time) < 2 or time.shape != voltage.shape:
            raise InputError("must have at least two points, each a time and a voltage",
                             key="signal")
        if not (np.isfinite(time).all() and np.isfinite(voltage).all()):
            raise InputError("must be finite everywhere", key="signal")
        if np.any(np.diff(time) < 0) or time[-1] <= time[0]:
            raise InputError("times must ascend", key="signal")
        if np.abs(voltage).max() > _HIGHEST:
            raise InputError("must stay within 1000 kV", key="signal",
                             given=f"{np.abs(voltage).max() / 1e3:g} kV")

    @property
    def end(self) -> float:
        return float(self.time[-1])

    @cached_property
    def breaks(self) -> Array:
        return np.unique(self.time)

    @property
    def peak(self) -> float:
        return float(np.abs(self.voltage).max())

    @property
    def first(self) -> float:
        return float(self.voltage[0])

    @cached_property
    def _begins(self) -> Numbers:
        return np.flatnonzero(np.diff(self.time) > 0)

    def within(self, piece: Any, time: Any) -> Any:
        at = self._begins[piece]
        share = (time - self.time[at]) / (self.time[at + 1] - self.time[at])
        return self.voltage[at] * (1 - share) + self.voltage[at + 1] * share


@dataclass(frozen=True)
class Sine:
    """u₀ + u₁ sin(2π t/T) [V], from t = 0 for ``cycles`` periods T [s] (figure 13)."""

    offset: float
    amplitude: float
    period: float
    cycles: float = 3.0

    def __post_init__(self) -> None:
        if not (0 < self.period < np.inf and 0 < self.cycles <= 1e4):
            raise InputError("needs a positive period and more than 0, at most 10000 cycles",
                             key="signal",
                             given=f"period {self.period:g} s, {self.cycles:g} cycles")
        if not self.peak <= _HIGHEST:
            raise InputError("must stay within 1000 kV", key="signal",
                             given=f"{self.peak / 1e3:g} kV")

    @property
    def end(self) -> float:
        return self.period * self.cycles

    @property
    def breaks(self) -> Array:
        begins = self.period * np.arange(np.ceil(self.cycles * (1 - 1e-12)))
        return np.append(begins, self.end)

    @property
    def peak(self) -> float:
        return abs(self.offset) + abs(self.amplitude)

    @property
    def first(self) -> float:
        return self.offset

    def within(self, piece: Any, time: Any) -> Any:
        return self.offset + self.amplitude * np.sin(2 * np.pi * time / self.period)


Signal = Pieces | Sine


@dataclass(frozen=True, eq=False)
class Supplied:
    """The film's voltages on a supply under a signal of nominal voltages."""

    signal: Signal
    supply: Supply

    @property
    def breaks(self) -> Array:
        return self.signal.breaks

    @property
    def first(self) -> float:
        return float(self.supply.film_voltage(self.signal.first))

    def within(self, piece: Any, time: Any) -> Any:
        return self.supply.film_voltage(self.signal.within(piece, time))


@dataclass(frozen=True, eq=False)
class JointSignal:
    """Signals of several runs at once, with the same breaks; voltages have the shape (runs,)."""

    signals: Sequence[Signal | Supplied | JointSignal]

    def __post_init__(self) -> None:
        first, *others = (signal.breaks for signal in self.signals)
        if any(breaks.shape != first.shape or (breaks != first).any() for breaks in others):
            raise InputError("of several runs must have the same breaks", key="signal")

    @property
    def breaks(self) -> Array:
        return self.signals[0].breaks

    @property
    def first(self) -> Array:
        return np.array([signal.first for signal in self.signals])

    def within(self, piece: Any, time: Any) -> Array:
        return np.array([signal.within(piece, time) for signal in self.signals])


@asks
@dataclass(frozen=True)
class Wave:
    """A signal by its ``kind``: step, ramp (up and down), sine, random, or the name of a CSV file.

    ``count`` is the number of random levels (20 by default), or of cycles of a sine (3).
    ``seed`` is the seed of the levels. Texts carry their unit.
    """

    kind: str = "step"
    _: KW_ONLY
    low: Annotated[float, Key("before a step; lower end of the others", "voltage")] = 0.0
    high: Annotated[float, Key("after a step; upper end", "voltage")] = 3.5e3
    duration: Annotated[float, Key("of step and ramp; of each random level; period of a sine",
                                   "time", _DURATION)] = 30.0
    interval: Annotated[float, Key("between samples of what follows it", "time", POSITIVE)] = 1e-3
    count: int | None = None
    seed: int = 0

    if TYPE_CHECKING:
        def __init__(self, kind: str = "step", *, low: float | str = 0.0, high: float | str = 3.5e3,
                     duration: float | str = 30.0, interval: float | str = 1e-3,
                     count: int | None = None, seed: int = 0) -> None: ...

    @property
    def period(self) -> float | None:
        """Period of a sine [s]; None for other signals."""
        return self.duration if self.kind == "sine" else None

    def signal(self, key: str = "signal") -> Signal:
        """Make the signal; an :class:`InputError` names the ``key`` of an unknown kind."""
        if self.kind in WAVES:
            return WAVES[self.kind](self)
        if not str(self.kind).endswith(".csv"):
            raise InputError(f"must be {', '.join(WAVES)} or the name of a .csv file", key=key,
                             given=self.kind)
        return read_signal(self.kind)


#: Functions that make each kind of wave.
WAVES: dict[str, Callable[[Wave], Signal]] = {
    "step": lambda wave: step(wave.low, wave.high, 0.0, wave.duration),
    "ramp": lambda wave: ramp(wave.low, wave.high, wave.duration),
    "sine": lambda wave: Sine((wave.low + wave.high) / 2, (wave.high - wave.low) / 2,
                              wave.duration, wave.count or 3),
    "random": lambda wave: random_steps(wave.low, wave.high, wave.duration, wave.count or 20,
                                        wave.seed)}


def step(low: float, high: float, at: float, end: float) -> Pieces:
    """Make a step between two voltages at a time; at 0 it comes at once, after rest at ``low``."""
    return Pieces(np.array([0.0, at, at, end]), np.array([low, low, high, high]))


def ramp(low: float, high: float, end: float) -> Pieces:
    """Make a ramp that rises in the first half of the time and falls in the second."""
    return Pieces(np.array([0.0, end / 2, end]), np.array([low, high, low]))


def random_steps(low: float, high: float, every: float, count: int, seed: int) -> Pieces:
    """Draw ``count`` levels uniformly between two voltages, each held for ``every`` seconds.

    The signal is that of figure 14; an equal seed gives equal levels.
    """
    if not (every > 0 and 1 <= count <= 100_000):
        raise InputError("needs a positive time between switches and 1 to 100000 of them",
                         key="signal", given=f"{every:g} s, {count}")
    levels: Array = np.random.default_rng(seed).uniform(low, high, count)
    times: Array = every * np.repeat(np.arange(count + 1.0), 2)[1:-1]
    return Pieces(times, np.repeat(levels, 2))


def read_signal(file: Path | str) -> Pieces:
    """Read a CSV file with the columns t_s and voltage_kV; straight lines join its rows.

    An unusable value is an InputError that names line and column.
    """
    limited: Rule = (lambda x: abs(x) <= _HIGHEST, "must be within 1000 kV")
    sheet = read_sheet(file, (Column("t", "s", also=(TIMES,)),
                              Column("voltage", "kV", limited, also=(VOLTAGES,))))
    time, voltage = sheet["t"], sheet["voltage"]
    for row in np.flatnonzero(np.diff(time) < LEAST_STEP):
        raise sheet.error(int(row) + 1, "t", "must be after the line before, by 1 ns at least: "
                                             f"that is at {time[row]:g} s")
    if len(time) < 2:
        raise InputError("must have at least two rows", file=file)
    return through(time - time[0], voltage)


def through(time: Array, voltage: Array) -> Pieces:
    """Join points [s, V], without those on the straight line between their neighbours."""
    width = np.diff(time)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.diff(voltage) / width
        most = max(float(np.abs(slope[width > 0]).max(initial=0.0)), 1e-300)
        bent = np.abs(np.diff(slope)) > _STRAIGHT * most
    keep = np.ones(len(time), bool)
    keep[1:-1] = bent | (width[1:] == 0) | (width[:-1] == 0)
    return Pieces(time[keep], voltage[keep])


def nominal(signal: Signal, when: Array) -> Array:
    """Evaluate the signal at times [V]; at a jump it has the value after it."""
    breaks = signal.breaks
    piece = np.clip(np.searchsorted(breaks, when, "right") - 1, 0, len(breaks) - 2)
    return np.asarray(signal.within(piece, when))
