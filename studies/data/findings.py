"""Mistakes in rows that are found without a film: copies, a saturated sensor, a moved zero."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import pdtrc
from scipy.stats import f as f_distribution

from tympan.base.arrays import Array, Mask, Numbers
from tympan.base.fields import Key
from tympan.studies.columns import Sheet
from tympan.studies.data.ramps import MEDIAN, groups, ramps
from tympan.studies.estimation.noise import Noise

#: Probability by noise alone below which equal readings are copies: a table has many pairs of rows.
_CHANCE = 1e-6
#: Share of the noise within which readings written with more digits count as equal.
_EQUAL = 3e-3
#: Chance of equal readings from which they prove nothing: the noise is hardly a display's step.
_OFTEN = 0.15
#: Fewest consecutive rows that count as a copy of as many others.
_BLOCK = 3
#: Most rows in which copied blocks are searched: the time grows with their square.
_MANY = 3000

#: Fewest states at a sensor's end, and least ratio of them to the states in any other interval.
_SEVERAL = 3
#: Share of the largest rise of a ramp within which all states at the sensor's end must lie.
_NARROW = 0.02

#: Probability by chance below which the zero of a run has moved.
_MOVED = 1e-4
#: Ratio of zeros to the scatter about them from which only the zeros differ.
_ALL = 2.0

#: Distance of a value from a multiple of a step, over the step: the rounding of a decimal number
#: in a file.
_ROUNDED = 1e-6


@dataclass(frozen=True)
class Finding:
    """A fault in a dataset that is not caused by the film."""

    kind: Annotated[Literal["copies", "outlier", "sensor_end", "clock", "run_zero", "labels",
                            "quantity", "film"], Key(
        "what it is: rows pasted, a reading far off the curve of its ramp, a sensor's end, a clock "
        "that runs back, a zero that moved between runs, wrong labels, a quantity taken for "
        "another, a film that is none")]
    what: Annotated[str, Key("what was found, in a sentence")]
    file: Annotated[str, Key("the file it is in, if it is in one")] = ""
    lines: Annotated[tuple[int, ...], Key("the lines concerned")] = ()
    check: Annotated[str, Key("what to do about it")] = ""


def step_of(values: Array) -> float:
    """Find the largest round step, 1, 2 or 5 times a power of ten, that divides all values.

    0 where there is none, or all values are equal.
    """
    if not np.ptp(values):
        return 0.0
    for step in (digit * 10.0**power for power in range(-1, -10, -1) for digit in (5, 2, 1)):
        if np.abs(values / step - np.round(values / step)).max() < _ROUNDED:
            return step
    return 0.0


@dataclass(frozen=True, eq=False)
class CopiedRows:
    """Rows that are copies, by their numbers, and the rows they are copies of."""

    rows: Numbers
    of: Numbers

    @classmethod
    def among(cls, static: Sheet, noise: float | None) -> CopiedRows:
        """Find later rows of a file that equal earlier ones more closely than the noise permits.

        They are rows of one state, or several consecutive rows of any states, in the same or the
        opposite order. ``noise``: the stated one [m], if any. A display's steps make readings
        equal by chance, and so do zeros that are set: neither are copies.
        """
        seen = np.isfinite(static.displacement) & (static.displacement != 0)
        rows = np.flatnonzero(seen & ~at_sensor_end(static))
        read = static.displacement[rows]
        if len(rows) < 2:
            return cls(rows[:0], rows[:0])
        state = groups(static.specimen[rows], static.mass[rows], static.voltage[rows],
                       static.drive[rows])
        step, sigma = step_of(read), _quietest(static, rows, state, noise)
        copies = dict[int, int]()
        for near in {0.5 * step, max(0.5 * step, _EQUAL * sigma)} - {0.0}:
            # The difference of two readings of one state is normal, with √2 times their noise.
            chance = min(1.0, near / (np.pi**0.5 * max(sigma, 1e-300)))
            if chance > _OFTEN:
                continue
            copies |= _repeated(read, state, near, chance)
            if len(rows) <= _MANY:
                copies |= _blocks(read, near, chance)
        pairs = sorted(copies.items())
        return cls(rows[[row for row, _ in pairs]], rows[[first for _, first in pairs]])


def _quietest(static: Sheet, rows: Numbers, state: Numbers, noise: float | None) -> float:
    """Find the least possible noise of a reading [m]: quiet readings are equal more often."""
    read = static.displacement[rows]
    least = min(_rough(static, rows), np.inf if noise is None else noise)
    order = np.lexsort((read, state))
    apart = np.diff(read[order])[np.diff(state[order]) == 0]
    # Possible copies say nothing about the noise.
    apart = apart[apart > _EQUAL * (least if np.isfinite(least) else 0.0)]
    if len(apart) >= _SEVERAL:
        least = min(least, float(np.median(apart)))
    return least if np.isfinite(least) else 0.0


def _rough(static: Sheet, rows: Numbers) -> float:
    """Compute the scatter of readings about smooth curves of the voltage, each on one way [m].

    inf where no way up or down is long enough.
    """
    left = [np.abs(ramp.off) * (len(ramp.rows) / (len(ramp.rows) - ramp.columns.shape[1])) ** 0.5
            for ramp in ramps(static, rows)]
    return float(np.median(np.concatenate(left))) / MEDIAN if left else np.inf


def _repeated(read: Array, state: Numbers, near: float, chance: float) -> dict[int, int]:
    """Map rows to the first equal row of the same state; empty if chance explains them."""
    order = np.lexsort((np.arange(len(read)), read, state))
    same = (np.diff(state[order]) == 0) & (np.abs(np.diff(read[order])) <= near)
    sizes = np.bincount(state)
    expected = chance * float(np.sum(sizes * (sizes - 1) / 2))
    count = int(same.sum())
    if not count or pdtrc(count - 1, expected) >= _CHANCE:
        return {}
    copies, first = dict[int, int](), 0
    for place in np.flatnonzero(same).tolist():
        if not place or not same[place - 1]:
            first = place
        cluster = order[first: place + 2]
        copies |= {int(row): int(cluster.min()) for row in cluster if row != cluster.min()}
    return copies


def _blocks(read: Array, near: float, chance: float) -> dict[int, int]:
    """Map consecutive rows to as many equal ones, in the same or the opposite order."""
    count, copies = len(read), dict[int, int]()
    numbers = np.arange(count)
    for later in [numbers + lag for lag in range(1, count)] + [
            total - numbers for total in range(1, 2 * count - 2)]:
        there = (later < count) & (later > numbers)
        equal = np.zeros(count, bool)
        equal[there] = np.abs(read[later[there]] - read[there]) <= near
        edges = np.flatnonzero(np.diff(np.r_[False, equal, False]))
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            if end - begin < _BLOCK:
                continue
            # The same value again and again comes from a sensor that does not move.
            different = 1 + int(np.sum(np.diff(np.sort(read[begin:end])) > near))
            if different >= _BLOCK and count**2 * chance**different < _CHANCE:
                copies |= {int(later[row]): row for row in range(begin, end)}
    return copies


def at_sensor_end(static: Sheet) -> Mask:
    """Mark readings in a narrow interval at the maximum, which has far more states than any other.

    Other states count only above half of their ramp's rise: low voltages hardly move a plate.
    """
    keys = groups(static.specimen, static.mass, static.voltage, static.drive)
    ramp = groups(static.specimen, static.mass)
    if not len(keys) or not np.isfinite(static.displacement).all():
        return np.zeros(len(static), bool)
    first = np.unique(keys, return_index=True)[1]
    read = np.bincount(keys, static.displacement) / np.bincount(keys)
    ramp = ramp[first]
    low, high = (np.array([end(read[ramp == number]) for number in range(int(ramp.max()) + 1)])
                 for end in (np.min, np.max))
    moved = read > 0.5 * (low + high)[ramp]
    top, rise = float(static.displacement.max()), float((high - low).max())
    order = np.argsort(-read)
    for count in range(len(read), _SEVERAL - 1, -1):
        width = top - float(read[order[count - 1]])
        if width > _NARROW * rise:
            continue
        others = np.sort(read[moved & (read < top - width)])
        most = int((np.searchsorted(others, others + width, "right") - np.arange(
            len(others))).max(initial=0))
        if count >= _SEVERAL * max(most, 1):
            return np.asarray((read >= top - width)[keys] | (static.displacement >= top - width))
    return np.zeros(len(static), bool)


@dataclass(frozen=True, eq=False)
class RunZeros:
    """Zeros of runs that read the same states, by the runs' names.

    ``zeros`` [m] about their mean; ``error``: standard deviation of their differences [m];
    ``states``: number of states read in several runs; ``scatter``: of readings about states and
    zeros.
    """

    runs: tuple[str, ...]
    zeros: Array
    error: float
    states: int
    scatter: Noise

    @classmethod
    def of(cls, static: Sheet, skipped: Mask) -> RunZeros | None:
        """Find zeros from states that several runs have read; None if they moved only by noise.

        None as well where more than a zero differs.
        """
        rows = np.flatnonzero(np.isfinite(static.displacement) & ~skipped)
        state = groups(static.specimen[rows], static.mass[rows], static.voltage[rows],
                       static.direction[rows], static.drive[rows])
        names, run = np.unique(static.run[rows], return_inverse=True)
        runs_of = np.array([len(np.unique(run[state == number]))
                            for number in range(int(state.max(initial=-1)) + 1)])
        if len(names) < 2 or not len(rows) or runs_of.max() < 2:
            return None
        both = runs_of[state] > 1
        read, state, run = static.displacement[rows][both], state[both], run[both]
        there, run = np.unique(run, return_inverse=True)
        state = np.unique(state, return_inverse=True)[1]
        means = np.bincount(state, read) / np.bincount(state)

        def about(values: Array) -> Array:
            """Subtract the mean of each state from values."""
            return np.asarray(values - (np.bincount(state, values) / np.bincount(state))[state])

        columns = np.stack([about((run == number).astype(float))
                            for number in range(len(there))], axis=1)
        zeros = np.asarray(np.linalg.lstsq(columns, about(read), rcond=1e-9)[0], float)
        zeros -= zeros.mean()
        before, after = (float(np.sum(left**2))
                         for left in (about(read), about(read) - columns @ zeros))
        moves = int(np.linalg.matrix_rank(columns))
        freedom = len(read) - len(means) - moves
        if freedom < _SEVERAL or not moves:
            return None
        scatter = Noise.left(max(after, 1e-300), freedom)
        ratio = (before - after) / moves / scatter.size**2
        spread = float(np.sqrt(np.mean(zeros**2)))
        if f_distribution.sf(ratio, moves, freedom) >= _MOVED or spread < _ALL / 2 * scatter.size:
            return None
        error = scatter.size * (2 * len(there) / len(read)) ** 0.5
        return cls(tuple(names[there].tolist()), zeros, error, len(means), scatter)

    @property
    def size(self) -> float:
        """Standard deviation of such zeros [m]."""
        count = len(self.zeros)
        return float(np.sqrt(np.sum(self.zeros**2) / (count - 1)))

    def columns(self, run: NDArray[np.str_]) -> Array:
        """Build the effect of each run's zero on readings at its standard deviation."""
        return self.size * np.stack([run == name for name in self.runs], axis=1)

    def pairs(self) -> Iterator[tuple[str, float]]:
        """Yield each run but the first, with its zero minus that of the first one [m]."""
        yield from zip(self.runs[1:], (self.zeros[1:] - self.zeros[0]).tolist(), strict=True)
