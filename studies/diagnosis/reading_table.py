"""The readings of a dataset as one table of numbers to predict, whichever file they come from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tympan.base.arrays import Array, Mask, Numbers
from tympan.base.units import table_unit
from tympan.geometry.electrode import Electrode
from tympan.studies.diagnosis.history import Passages, VoltageHistory
from tympan.studies.estimation.noise import Noise

#: Key of a state in time: specimen, mass [kg], history, begin and end [s].
StateKey = tuple[int, float, VoltageHistory, float, float]

#: Digits to which the shares of equal patterns of voltages agree.
_SHARE_DIGITS = 6

#: Kinds of rows that are slopes of the plate, along x and y.
SLOPES = ("tilt_x", "tilt_y")

#: Kinds of rows that are capacitances of segments, by the number of the segment.
OF_SEGMENTS = tuple(f"capacitance_{number}" for number in range(1, 65))

#: Kinds of rows that are lengths, on which errors are counted.
LENGTHS = ("displacement", "range")


def evenly_chosen(items: Numbers, count: int) -> Numbers:
    """Select at most ``count`` evenly spaced items, the first and the last among them."""
    most = min(count, len(items))
    places = np.unique(np.linspace(0, len(items) - 1, most).round().astype(int))
    return np.asarray(items[places])


@dataclass(frozen=True)
class Unit:
    """Unit of errors: its name at the end of keys, and the number of it in one SI unit."""

    name: str
    per_si: float


#: Unit in which deflections and their misfits are given, from metres.
MICROMETRES = Unit("um", 1e6)
#: Unit in which stresses of coupons are given, from pascals.
KILOPASCALS = Unit("kPa", 1e-3)


#: Dimensions of readings, by their kind.
_DIMENSIONS = dict.fromkeys((*LENGTHS, "film", "film_x", "film_y"), "length") | {
    **dict.fromkeys(("capacitance", *OF_SEGMENTS), "capacitance"),
    **dict.fromkeys(("tilt", *SLOPES), "angle"),
    "film_voltage": "voltage",
    "frequency": "frequency", "force": "force", "stress": "stress"}
#: Units in which readings are given, by their kind: those of their columns.
UNITS = {kind: Unit(*table_unit(dimension)) for kind, dimension in _DIMENSIONS.items()} | {
    "decay": Unit("1/s", 1.0)}


@dataclass(frozen=True, eq=False)
class Scan:
    """Places of a film that were read in one state.

    ``place``: on the table, or from the plate's centre if ``centred`` [m], shape (n, 2). It is a
    fixed place or, if it ``follows`` the film, that of a material point when the film was flat;
    ``on_plate``, (n,), for the specimen as stated.
    """

    place: Array
    follows: bool
    on_plate: Mask
    centred: bool

    def __len__(self) -> int:
        return len(self.place)


@dataclass(frozen=True, eq=False)
class States:
    """States of the actuators that are read, shape (n,) each.

    Number of the specimen; nominal mass [kg] and voltage [V]; time since the run began [s];
    direction in which the state was reached (the voltage: 1 up, -1 down; a displacement-controlled
    plate: 1 out, -1 back; 0 not known); deflection at which the plate is held [m], nan where it is
    free; number of the run: a specimen's states under one mass in one run are in the order in which
    they were reached. ``passage``: the part of its history that a state is. ``shares``: voltage of
    each segment, as its name says, over that of the state, shape (n, segments); nan where those of
    the specimen's file hold. Films with fewer segments do not use the last ones.
    """

    specimen: Numbers
    mass: Array
    voltage: Array
    elapsed: Array
    direction: Array
    deflection: Array
    run: Numbers
    passage: Passages
    shares: Array

    @classmethod
    def of(cls, specimen: Sequence[int] | Numbers, mass: Sequence[float] | Array,
           voltage: Sequence[float] | Array, elapsed: Array | float = 0.0,
           direction: Array | float = 0.0, run: Numbers | int = 0,
           shares: Array | None = None) -> States:
        """Build states with the plate free; without ``shares`` those of the files hold."""
        mass, voltage, elapsed, direction, deflection = (
            np.full(len(specimen), part, float)
            for part in (mass, voltage, elapsed, direction, np.nan))
        return cls(np.asarray(specimen, dtype=np.int64), mass, voltage, elapsed, direction,
                   deflection, np.full(len(specimen), run, np.int64),
                   Passages.of(None, np.full(len(specimen), np.nan)),
                   np.full((len(specimen), 1), np.nan) if shares is None else shares)

    def __len__(self) -> int:
        return len(self.specimen)

    @cached_property
    def of_specimen(self) -> tuple[Numbers, ...]:
        count = int(self.specimen.max(initial=-1)) + 1
        return tuple(np.flatnonzero(self.specimen == number) for number in range(count))

    @cached_property
    def pattern(self) -> Numbers:
        """Number of each state's pattern of voltages: the same where all shares are the same."""
        shares = np.nan_to_num(np.round(self.shares, _SHARE_DIGITS), nan=-1.0)
        return np.unique(shares, axis=0, return_inverse=True)[1].ravel()

    def shares_of(self, electrode: Electrode) -> Array:
        """Find the voltages of an electrode's segments, over those of states, (n, segments)."""
        own = np.array([segment.share for segment in electrode.segments])
        shares = np.full((len(self), len(own)), np.nan)
        count = min(self.shares.shape[1], len(own))
        shares[:, :count] = self.shares[:, :count]
        return np.where(np.isnan(shares), own, shares)

    @cached_property
    def of_run(self) -> tuple[Numbers, ...]:
        """Indices of states with a free plate, by specimen, mass and run, in the order reached."""
        free = np.flatnonzero(np.isnan(self.deflection))
        keys = np.stack([self.specimen, self.mass, self.run], 1)[free]
        numbers = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
        return tuple(free[numbers == number] for number in range(numbers.max(initial=-1) + 1))

    @property
    def voltage_direction(self) -> Array:
        """Direction in which the voltage got there: 1 up, -1 down, 0 where it is not known."""
        return np.where(np.isnan(self.deflection), self.direction, 0.0)

    @cached_property
    def way(self) -> Array:
        """The direction; if not known, by the voltage before in the run; for the first one up."""
        way = np.ones(len(self))
        for run in self.of_run:
            turned = np.sign(np.diff(self.voltage[run], prepend=-np.inf))
            last = np.maximum.accumulate(np.where(turned != 0, np.arange(len(run)), 0))
            way[run] = turned[last]
        return np.where(self.direction != 0, self.direction, way)

    @cached_property
    def in_time(self) -> Numbers:
        """Numbers of the states that are not in equilibrium."""
        return np.flatnonzero(np.isfinite(self.passage.begin))

    @cached_property
    def passages(self) -> Passages:
        """Histories of the rows in time."""
        return self.passage[self.in_time]

    @cached_property
    def keys_in_time(self) -> list[StateKey]:
        """Keys of the states, equal for the same state."""
        rows, passages = self.in_time, self.passages
        return list(zip(self.specimen[rows].tolist(), self.mass[rows].tolist(), passages.history,
                        passages.begin.tolist(), passages.end.tolist(), strict=True))

    @property
    def at_rest(self) -> States:
        """These states, each with its voltage held until the film has come to rest."""
        return replace(self, passage=Passages.of(None, np.full(len(self), np.nan)))

    def __getitem__(self, rows: Mask | Numbers) -> States:
        return States(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def joined(self, other: States) -> States:
        columns = {name: np.concatenate([getattr(self, name), getattr(other, name)])
                   for name in self.__dataclass_fields__ if name not in ("passage", "shares")}
        most = max(self.shares.shape[1], other.shares.shape[1])
        shares = [np.pad(each.shares, ((0, 0), (0, most - each.shares.shape[1])),
                         constant_values=np.nan) for each in (self, other)]
        return States(passage=self.passage.joined(other.passage), shares=np.concatenate(shares),
                      **columns)


@dataclass(frozen=True, eq=False)
class ReadingTable:
    """Rows to predict: their ``kind`` and the ``state`` read.

    A range also has the state it is counted from, and a transient's displacement the state before
    the voltage jumped (``since``, else -1). ``value`` is the reading and ``noise`` its errors, in
    SI; ``order``: place in the sequence, nan where not known; ``file`` and ``line``: origin of a
    row; ``run``: the ramp it belongs to; ``point``: its place among those of all ``scans``, or its
    index among the coupons' rows, else -1.
    """

    states: States
    kind: NDArray[np.str_]
    state: Numbers
    since: Numbers
    value: Array
    noise: Noise
    order: Array
    run: NDArray[np.str_]
    file: NDArray[np.str_]
    line: Numbers
    point: Numbers
    scans: tuple[Scan, ...] = ()

    def __len__(self) -> int:
        return len(self.state)

    def __getitem__(self, rows: Mask | Numbers) -> ReadingTable:
        """Select some of the rows; all states and scans are kept."""
        return replace(self, noise=self.noise[rows],
                       **{name: getattr(self, name)[rows] for name in self._columns})

    @property
    def _columns(self) -> list[str]:
        return [name for name in self.__dataclass_fields__
                if name not in ("states", "scans", "noise")]

    @property
    def sigma(self) -> Array:
        """Standard deviation of each row's own error."""
        return self.noise.sigma

    @property
    def specimen(self) -> Numbers:
        return self.states.specimen[self.state]

    @property
    def mass(self) -> Array:
        return self.states.mass[self.state]

    @property
    def voltage(self) -> Array:
        return self.states.voltage[self.state]

    @property
    def lengths(self) -> Mask:
        return np.isin(self.kind, LENGTHS)

    @property
    def judged(self) -> Mask:
        """Rows on which errors are counted: lengths, or stresses where there are no lengths."""
        return self.lengths if self.lengths.any() else self.kind == "stress"

    @property
    def unit(self) -> Unit:
        """The unit in which errors are given."""
        return MICROMETRES if self.lengths.any() else KILOPASCALS

    @cached_property
    def ramp(self) -> Numbers:
        """Number of specimen, mass and pattern of voltages of rows, and of the run of coupons."""
        run = np.where(self.kind == "stress", self.states.run[self.state], 0)
        pattern = self.states.pattern[self.state]
        keys = np.stack([self.specimen.astype(float), self.mass, run, pattern], 1)
        return np.unique(keys, axis=0, return_inverse=True)[1].ravel()

    @cached_property
    def first_points(self) -> Numbers:
        """Number of the first place of each scan."""
        return np.cumsum([0, *(len(scan) for scan in self.scans)], dtype=np.int64)[:-1]

    @cached_property
    def places(self) -> Array:
        """Place of each row as it was written [m], shape (rows, 2), nan outside scans."""
        every = np.concatenate([np.empty((0, 2)), *(scan.place for scan in self.scans),
                                np.full((1, 2), np.nan)])
        return every[self.point]

    @cached_property
    def scan(self) -> Numbers:
        """Number of the scan of each row, -1 of others."""
        return np.where(self.point < 0, -1,
                        np.searchsorted(self.first_points, self.point, "right") - 1)

    @property
    def coupon(self) -> Numbers:
        """Index of each row among the coupons' rows, if it is one; these follow the places."""
        return self.point - sum(map(len, self.scans))

    @cached_property
    def rows_of(self) -> dict[str, Numbers]:
        return {str(kind): np.flatnonzero(self.kind == kind) for kind in np.unique(self.kind)}

    def reached(self, turn: Numbers) -> ReadingTable:
        """Change the order in which states are reached to their numbers in ``turn``."""
        place = np.argsort(turn)
        return replace(self, states=self.states[turn], state=place[self.state],
                       since=np.where(self.since < 0, -1, place[self.since]))

    def compact(self) -> ReadingTable:
        """Drop all states but those of the rows and those before them in their runs."""
        used = np.zeros(len(self.states), bool)
        used[np.r_[self.state, self.since[self.since >= 0]]] = True
        for run in self.states.of_run:
            used[run] = np.logical_or.accumulate(used[run][::-1])[::-1]
        number = np.cumsum(used) - 1
        return replace(self, states=self.states[used], state=number[self.state],
                       since=np.where(self.since < 0, -1, number[self.since]))

    def with_values(self, value: Array) -> ReadingTable:
        return replace(self, value=value)

    def with_noise(self, noise: Noise) -> ReadingTable:
        return replace(self, noise=noise)

    def with_sigma(self, sigma: Array) -> ReadingTable:
        return replace(self, noise=self.noise.with_own(sigma))

    def joined(self, other: ReadingTable) -> ReadingTable:
        """Append other rows, in runs of their own."""
        count, runs = len(self.states), 1 + self.states.run.max(initial=-1)
        states = replace(other.states, run=other.states.run + runs)
        places = sum(map(len, self.scans))
        moved = replace(other, states=states, state=other.state + count,
                        since=np.where(other.since < 0, -1, other.since + count),
                        point=np.where(other.point < 0, -1, other.point + places))
        return replace(self, states=self.states.joined(moved.states),
                       scans=(*self.scans, *other.scans), noise=self.noise.joined(other.noise),
                       **{name: np.concatenate([getattr(self, name), getattr(moved, name)])
                          for name in self._columns})


def rows(states: States, kind: str, sigma: float | Array, value: float | Array = 0.0,
         order: float | Array = np.nan, run: str | NDArray[np.str_] = "",
         file: str | NDArray[np.str_] = "", line: int | Numbers = 0,
         given: bool | Mask = False) -> ReadingTable:
    """Build one row of a kind for each state; ``given``: whether its noise is written with it."""
    count = len(states)
    values, sigmas, orders = (np.full(count, part, float) for part in (value, sigma, order))
    noise = Noise(sigmas, given=np.full(count, given))
    return ReadingTable(states, np.full(count, kind), np.arange(count), np.full(count, -1), values,
                        noise, orders, np.full(count, run), np.full(count, file),
                        np.full(count, line), np.full(count, -1))
