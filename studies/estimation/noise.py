"""Noise of readings: what is off of each by itself, and what several have in common."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.linalg import svd
from scipy.stats import chi2, norm, t

from tympan.base.arrays import Array, Mask, Numbers

Rows = Mask | Numbers

#: A misfit above so many times the stated noise is the law's, not the noise's.
MISFIT = 2.0

#: Where a noise is from.
Source = Literal["stated", "from repeats", "from the scatter about smooth curves", "assumed"]
#: Where it is from if readings alone tell it.
SCATTER: Source = "from the scatter about smooth curves"
#: Where nobody says what a reading is off by.
UNSTATED: tuple[Source, ...] = (SCATTER, "assumed")

#: Readings up to which what they remember is taken away by one matrix.
_DENSE = 400

#: Degrees of freedom a stated noise counts as: it is taken to be right within about a quarter.
STATED = 8.0


@dataclass(frozen=True, eq=False)
class Shared:
    """Independent normal errors that some readings have in common.

    ``rows``: numbers of these readings, (m,); ``directions``: orthonormal columns of them, (m, k);
    ``sizes``: standard deviations of the errors along these, (k,).
    """

    rows: Numbers
    directions: Array
    sizes: Array

    @classmethod
    def of(cls, rows: Numbers, columns: Array) -> Shared:
        """Errors in common by what each does at its standard deviation, shape (m, errors)."""
        directions, sizes, _ = svd(columns, full_matrices=False, lapack_driver="gesvd")
        return cls(rows, directions, sizes)

    @property
    def columns(self) -> Array:
        """Effect of each error at its standard deviation, shape (m, k)."""
        return np.asarray(self.directions * self.sizes)

    def over(self, sigma: Array) -> Shared:
        """Errors over standard deviations of these readings, (m,)."""
        if np.ptp(sigma) == 0:
            return replace(self, sizes=self.sizes / sigma[0])
        return self.of(self.rows, self.columns / sigma[:, None])

    def among(self, readings: Numbers) -> Shared:
        """Errors of some readings by their numbers, with the places they have there."""
        here = np.isin(readings, self.rows)
        if np.array_equal(readings[here], self.rows):
            return replace(self, rows=np.flatnonzero(here))
        place = np.searchsorted(self.rows, readings[here])
        return self.of(np.flatnonzero(here), self.columns[place])


@dataclass(frozen=True, eq=False)
class Memory:
    """Errors of a run of which a part remembers: of two, e to the minus their clocks' difference.

    An Ornstein–Uhlenbeck process and white noise beside it; a first-order autoregression where all
    remembers and readings follow evenly. ``run``: number of the run of each reading, -1 of one that
    remembers nothing; ``clock``: its place along the run; ``share``: of the variance that
    remembers; (readings,) each.
    """

    run: Numbers
    clock: Array
    share: Array

    def __len__(self) -> int:
        return len(self.run)

    def __getitem__(self, rows: Rows) -> Memory:
        return Memory(self.run[rows], self.clock[rows], self.share[rows])

    @classmethod
    def none(cls, count: int) -> Memory:
        """Memory of so many readings that remember nothing."""
        return cls(np.full(count, -1), np.zeros(count), np.ones(count))

    def joined(self, other: Memory) -> Memory:
        """Memory of these readings and others, whose runs are others."""
        apart = 1 + self.run.max(initial=-1)
        return Memory(np.r_[self.run, np.where(other.run < 0, -1, other.run + apart)],
                      np.r_[self.clock, other.clock], np.r_[self.share, other.share])

    @cached_property
    def _steps(self) -> list[tuple[int, int, float, float, float, float]]:
        """Kalman's filter: each reading that remembers, in order, and the one before it or -1.

        With the correlation between what both remember, the root of the share that does, the
        filter's gain and the standard deviation of what is new in the reading.
        """
        steps, last, variance = [], -1, 1.0
        for this in np.lexsort((self.clock, self.run)).tolist():
            if self.run[this] < 0:
                continue
            follows = last >= 0 and self.run[last] == self.run[this]
            kept = float(np.exp(self.clock[last] - self.clock[this])) if follows else 0.0
            predicted = kept**2 * variance + 1 - kept**2
            share = float(self.share[this])
            new = share * predicted + 1 - share
            gain = share**0.5 * predicted / new
            variance = predicted * (1 - gain * share**0.5)
            steps.append((this, last if follows else -1, kept, share**0.5, gain, new**0.5))
            last = this
        return steps

    @property
    def log_volume(self) -> float:
        """Logarithm of the volume over which errors spread, over that without memory."""
        return float(np.sum(np.log([new for *_, new in self._steps])))

    def forgotten(self, values: Array) -> Array:
        """Errors over their standard deviations, (readings, …), as such without memory."""
        if len(self) <= _DENSE:
            return np.asarray(self._forgetting @ values)
        return self._filtered(values)

    @cached_property
    def _forgetting(self) -> Array:
        """Matrix of :meth:`forgotten`."""
        return self._filtered(np.eye(len(self)))

    def _filtered(self, values: Array) -> Array:
        fresh, state = values.astype(float), np.zeros(values.shape[1:])
        for this, last, kept, root, gain, new in self._steps:
            state = kept * state if last >= 0 else 0 * state
            missed = values[this] - root * state
            state = state + gain * missed
            fresh[this] = missed / new
        return fresh

    def remembered(self, fresh: Array) -> Array:
        """Errors without memory, (readings, …), as such with it."""
        values, state = fresh.astype(float), np.zeros(fresh.shape[1:])
        for this, last, kept, root, gain, new in self._steps:
            state = kept * state if last >= 0 else 0 * state
            missed = new * fresh[this]
            values[this] = root * state + missed
            state = state + gain * missed
        return values


@dataclass(frozen=True, eq=False)
class Noise:
    """Normal errors of readings: each one's own, and such as several readings have in common.

    The covariance is S R S + C Cᵀ: S of the own errors' standard deviations, in which rounding
    counts; R of what an error remembers of those before it; C of all that lasts along a run, and of
    its zero and gain. All that is missed is weighed by :meth:`whitened` alone. A reading that is
    off by itself has a large standard deviation.

    ``sigma``: standard deviation of each reading's own error, shape (readings,), in its unit;
    ``memory``: how errors remember, None where they do not; ``shared``: errors in common, no two of
    them of one reading. ``freedom``: degrees of freedom with which the noise is known of each part
    of the readings, shape (parts,), ``part``: which part each is of. ``found``: it was estimated
    from these readings, and is tested against as it is; otherwise their scatter has still its say.
    ``given``: which readings came with a standard deviation of their own.
    """

    sigma: Array
    shared: tuple[Shared, ...] = ()
    source: Source = "stated"
    freedom: Array = field(default_factory=lambda: np.array([STATED]))
    part: Numbers = field(default_factory=lambda: np.empty(0, np.int64))
    found: bool = False
    memory: Memory | None = None
    given: Mask = field(default_factory=lambda: np.empty(0, bool))

    def __post_init__(self) -> None:
        if len(self.given) != len(self.sigma):
            object.__setattr__(self, "given", np.zeros(len(self.sigma), bool))
        if len(self.part) != len(self.sigma):
            object.__setattr__(self, "part", np.zeros(len(self.sigma), np.int64))

    def __len__(self) -> int:
        return len(self.sigma)

    def __getitem__(self, rows: Rows) -> Noise:
        """Noise of some readings."""
        numbers = np.arange(len(self))[rows]
        return replace(self, sigma=self.sigma[rows], part=self.part[rows], given=self.given[rows],
                       memory=self.memory and self.memory[rows],
                       shared=tuple(some.among(numbers) for some in self.shared
                                    if np.isin(some.rows, numbers).any()))

    def joined(self, other: Noise) -> Noise:
        """Noise of these readings and others; noises that were found stay parts."""
        after = tuple(replace(some, rows=some.rows + len(self)) for some in other.shared)
        memory = None
        if self.memory or other.memory:
            memory = (self.memory or Memory.none(len(self))).joined(
                other.memory or Memory.none(len(other)))
        both = replace(self, sigma=np.r_[self.sigma, other.sigma], shared=self.shared + after,
                       part=np.r_[self.part, other.part], given=np.r_[self.given, other.given],
                       memory=memory)
        if not self.found:
            return both
        return replace(both, freedom=np.r_[self.freedom, other.freedom],
                       part=np.r_[self.part, other.part + len(self.freedom)])

    @classmethod
    def of_one(cls, sigma: float, freedom: float = np.inf) -> Noise:
        """Noise of one reading with its degrees of freedom, infinitely many where it was given."""
        return cls(np.array([sigma]), freedom=np.array([freedom]), found=True)

    @classmethod
    def left(cls, squares: float, freedom: float, given: float | None = None, widen: bool = False
             ) -> Noise:
        """Noise of one reading, by the sum of squares that a fit leaves unless given.

        ``widen``: a misfit that the noise given cannot explain takes its place, which would make
        limits too narrow.
        """
        found = (squares / freedom) ** 0.5
        if given is None:
            return cls.of_one(found, freedom)
        return cls.of_one(found if widen and found >= MISFIT * given else given)

    @classmethod
    def pooled(cls, values: Array, groups: Numbers, sigma: Array | float = 1.0) -> Noise | None:
        """Noise of one reading, by the scatter of values, (n,), about the means of ``groups``.

        In units of ``sigma``, the standard deviation of each reading up to a common factor, which
        also weights the means. None where nothing repeats.
        """
        weight = np.broadcast_to(1 / np.square(sigma), values.shape)
        _, group, count = np.unique(groups, return_inverse=True, return_counts=True)
        freedom = int((count - 1).sum())
        if freedom == 0:
            return None
        centred = values - values.mean()
        mean = np.bincount(group, weight * centred) / np.bincount(group, weight)
        squares = (weight * (centred - mean[group]) ** 2)[count[group] > 1].sum()
        return cls.left(float(squares), freedom)

    @classmethod
    def of(cls, sigma: Array, source: Source) -> Noise:
        """Independent errors; only as they are stated or assumed is anything known beforehand."""
        beforehand = STATED if source in ("stated", "assumed") else 0.0
        return cls(sigma, source=source, freedom=np.array([beforehand]))

    def with_sigma(self, sigma: Array) -> Noise:
        """Same noise with other standard deviations of each reading by itself."""
        return replace(self, sigma=sigma)

    def with_shared(self, rows: Numbers, columns: Array) -> Noise:
        """Add errors in common of some readings, in order, by what each does, (rows, errors)."""
        same = [some for some in self.shared if np.isin(some.rows, rows).any()]
        others = tuple(some for some in self.shared if some not in same)
        if not same:
            return replace(self, shared=(*others, Shared.of(rows, columns)))
        every = np.unique(np.concatenate([rows, *(some.rows for some in same)]))
        one, place = np.eye(len(every)), np.searchsorted
        return replace(self, shared=(*others, Shared.of(every, np.hstack([
            one[:, place(every, rows)] @ columns,
            *(one[:, place(every, some.rows)] @ some.columns for some in same)]))))

    def with_zero(self, size: float) -> Noise:
        """Add a zero that all these readings have in common, of that standard deviation."""
        return self.with_shared(np.arange(len(self)), np.full((len(self), 1), size))

    def known(self, freedom: float) -> Noise:
        """Same noise, as found with so many degrees of freedom."""
        return replace(self, freedom=np.array([freedom]), part=0 * self.part, found=True)

    def scaled(self, share: float) -> Noise:
        """Same noise with errors in common so many times as large."""
        return replace(self, shared=tuple(replace(some, sizes=share * some.sizes)
                                          for some in self.shared))

    def with_off(self, sizes: Array) -> Noise:
        """Add to readings off by themselves as much as is usual [their unit]; 0 where not."""
        off, memory = sizes > 0, self.memory
        if memory is not None and off.any():
            memory = replace(memory, run=np.where(off, -1, memory.run))
        return replace(self, sigma=np.hypot(self.sigma, sizes), memory=memory)

    @cached_property
    def _over(self) -> tuple[Shared, ...]:
        """Common errors over the noise of each reading, as far as that is not remembered."""
        if self.memory is None:
            return tuple(some.over(self.sigma[some.rows]) for some in self.shared)
        columns = [np.zeros((len(self), len(some.sizes))) for some in self.shared]
        for some, every in zip(self.shared, columns, strict=True):
            every[some.rows] = some.columns
        # What is remembered ties readings together that have nothing else in common.
        return tuple(Shared.of(np.arange(len(self)), self.memory.forgotten(
            (np.hstack(part).T / self.sigma).T)) for part in [columns] if part)

    def whitened(self, values: Array) -> Array:
        """Errors of readings, or columns of them, shape (readings, ...), as independent ones of 1.

        By the symmetric root: as near to those of each reading as may be. Of an error that
        remembers, what is new in it.
        """
        over = (values.T / self.sigma).T
        return self._turned(self.memory.forgotten(over) if self.memory else over, -0.5)

    def coloured(self, values: Array) -> Array:
        """Independent errors of size 1, shape (readings, ...), as those of readings."""
        return (self._remembered(self._turned(values, 0.5)).T * self.sigma).T

    def apart(self, values: Array) -> Array:
        """Values, shape (readings, ...), without what several readings have in common."""
        return (self._remembered(self.whitened(values)).T * self.sigma).T

    def _remembered(self, fresh: Array) -> Array:
        return self.memory.remembered(fresh) if self.memory else fresh

    def _turned(self, values: Array, power: float) -> Array:
        if not self._over:
            return values
        turned = values.astype(float)
        for some in self._over:
            change = (1 + some.sizes**2) ** power - 1
            part = turned[some.rows]
            turned[some.rows] = part + (some.directions * change) @ (some.directions.T @ part)
        return turned

    @property
    def size(self) -> float:
        """Standard deviation of a usual reading's own error, in its unit."""
        return float(np.median(self.sigma))

    @property
    def limits(self) -> Array:
        """Those of the 95 % interval of its size, shape (2,).

        For normal, independent errors: readings that drift between their repeats widen the scatter.
        """
        freedom = self.freedom.sum()
        return np.asarray(self.size * np.sqrt(freedom / chi2.ppf([0.975, 0.025], freedom)))

    @property
    def quantile(self) -> float:
        """Half width of 95 % intervals over it: Student's quantile, the normal one where given."""
        freedom = float(self.freedom.sum())
        return float(norm.ppf(0.975) if np.isinf(freedom) else t.ppf(0.975, freedom))

    @property
    def total(self) -> Array:
        """Standard deviation of each reading [its unit], with what it has in common with others."""
        squares = self.sigma**2
        for some in self.shared:
            squares[some.rows] += np.sum(some.columns**2, axis=1)
        return np.sqrt(squares)

    @property
    def log_volume(self) -> float:
        """Logarithm of the volume over which errors spread, over that of independent ones alone."""
        return sum((0.5 * float(np.log1p(some.sizes**2).sum()) for some in self._over),
                   self.memory.log_volume if self.memory else 0.0)

    def drawn(self, generator: np.random.Generator) -> Array:
        """A set of errors."""
        return self.coloured(generator.standard_normal(len(self)))

    def variances(self, generator: np.random.Generator, count: int) -> Array:
        """Variances of the parts as they may be found where they are 1, shape (parts, count)."""
        freedom = self.freedom[:, None]
        return np.asarray(generator.chisquare(freedom, (len(freedom), count)) / freedom)

    def shares(self, columns: Array) -> Array:
        """Share of each part in the squares of columns, shape (parts,)."""
        squares = np.bincount(self.part, np.sum(columns**2, axis=1), len(self.freedom))
        return np.asarray(squares / squares.sum())

    def freedom_of(self, shares: Array) -> float:
        """Degrees of freedom of a variance that is a sum of the parts' by their shares.

        By Satterthwaite (Biometrics Bulletin 2, 110, 1946): those of one variance that scatters as
        much. What few readings tell is not better known for the others.
        """
        return float(1 / np.sum(shares**2 / self.freedom))


def root_of(covariance: Array) -> Array:
    """Columns C, shape (n, k), of a covariance C Cᵀ, (n, n)."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
