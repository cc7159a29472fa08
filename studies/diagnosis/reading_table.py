"""The readings of a dataset as one table of numbers to predict, whatever file they are from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

#: What a row is a reading of: displacement [m], difference of two displacements [m], capacitance
#: [F], voltage on the film [V], force that holds the plate at a heave [N].
Kind = Literal["displacement", "range", "capacitance", "film_voltage", "force"]

#: Kinds of rows that are lengths, on which errors are counted.
LENGTHS = ("displacement", "range")


@dataclass(frozen=True, eq=False)
class States:
    """States of the actuators that are read, shape (n,) each.

    Number of the specimen, nominal mass [kg] and voltage [V], time since the run began [s], way the
    voltage got there (1 up, -1 down, 0 not known), and the heave at which the plate is held [m],
    nan where it is free.
    """

    specimen: Numbers
    mass: Array
    voltage: Array
    elapsed: Array
    direction: Array
    heave: Array

    @classmethod
    def of(cls, specimen: Sequence[int] | Numbers, mass: Sequence[float] | Array,
           voltage: Sequence[float] | Array, elapsed: Array | float = 0.0,
           direction: Array | float = 0.0) -> States:
        """States with the plate free."""
        parts = (mass, voltage, elapsed, direction, np.nan)
        return cls(np.asarray(specimen, dtype=np.int64),
                   *(np.full(len(specimen), part, float) for part in parts))

    def __len__(self) -> int:
        return len(self.specimen)

    @cached_property
    def of_specimen(self) -> tuple[Numbers, ...]:
        count = int(self.specimen.max(initial=-1)) + 1
        return tuple(np.flatnonzero(self.specimen == number) for number in range(count))

    def __getitem__(self, rows: NDArray[np.bool_] | Numbers) -> States:
        return States(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def joined(self, other: States) -> States:
        return States(*(np.concatenate([getattr(self, name), getattr(other, name)])
                        for name in self.__dataclass_fields__))


@dataclass(frozen=True, eq=False)
class ReadingTable:
    """Rows to predict: their ``kind`` and the ``state`` read.

    For a range also the state it is counted from (``since``, else -1). ``value`` is what was read
    and ``sigma`` its standard deviation, in SI; ``order`` the place in the sequence, nan where not
    known; ``file`` and ``line`` say where a row is from; ``run`` which ramp it belongs to.
    """

    states: States
    kind: NDArray[np.str_]
    state: Numbers
    since: Numbers
    value: Array
    sigma: Array
    order: Array
    run: NDArray[np.str_]
    file: NDArray[np.str_]
    line: Numbers

    def __len__(self) -> int:
        return len(self.state)

    def __getitem__(self, rows: NDArray[np.bool_] | Numbers) -> ReadingTable:
        """Some of the rows; states are all kept."""
        return ReadingTable(self.states, *(getattr(self, name)[rows]
                                           for name in self.__dataclass_fields__
                                           if name != "states"))

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
    def lengths(self) -> NDArray[np.bool_]:
        return np.isin(self.kind, LENGTHS)

    @cached_property
    def ramp(self) -> Numbers:
        """Number of the specimen and mass of each row."""
        keys = np.stack([self.specimen.astype(float), self.mass], 1)
        return np.unique(keys, axis=0, return_inverse=True)[1].ravel()

    @cached_property
    def rows_of(self) -> dict[str, Numbers]:
        return {str(kind): np.flatnonzero(self.kind == kind) for kind in np.unique(self.kind)}

    def compact(self) -> ReadingTable:
        """The rows with only the states they are of."""
        used, numbers = np.unique(np.r_[self.state, self.since[self.since >= 0]],
                                  return_inverse=True)
        since = self.since.copy()
        since[since >= 0] = numbers[len(self) :]
        return replace(self, states=self.states[used], state=numbers[: len(self)], since=since)

    def with_values(self, value: Array) -> ReadingTable:
        return replace(self, value=value)

    def with_sigma(self, sigma: Array) -> ReadingTable:
        return replace(self, sigma=sigma)

    def joined(self, other: ReadingTable) -> ReadingTable:
        count = len(self.states)
        moved = replace(other, state=other.state + count,
                        since=np.where(other.since < 0, -1, other.since + count))
        return ReadingTable(self.states.joined(other.states), *(
            np.concatenate([getattr(self, name), getattr(moved, name)])
            for name in self.__dataclass_fields__ if name != "states"))


def rows(states: States, kind: Kind, sigma: float | Array, value: float | Array = 0.0,
         order: float | Array = np.nan, run: str | NDArray[np.str_] = "", file: str = "",
         line: int | Numbers = 0) -> ReadingTable:
    """One row of a kind for each state."""
    count = len(states)
    values, sigmas, orders = (np.full(count, part, float) for part in (value, sigma, order))
    return ReadingTable(states, np.full(count, kind), np.arange(count), np.full(count, -1), values,
                        sigmas, orders, np.full(count, run), np.full(count, file),
                        np.full(count, line))
