"""Noise of readings: independent errors of each, and errors that several have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.linalg import svd
from scipy.stats import chi2, norm, t

from tympan.base.arrays import Array, Mask, Numbers

Rows = Mask | Numbers

#: Ratio of a misfit to the stated noise above which the misfit is the law's, not noise.
MISFIT = 2.0

#: Sources of a noise.
Source = Literal["stated", "from repeats", "from the scatter about smooth curves", "assumed"]
#: Source of a noise that is estimated from the readings alone.
SCATTER: Source = "from the scatter about smooth curves"
#: Sources of a noise that nobody states.
UNSTATED: tuple[Source, ...] = (SCATTER, "assumed")

#: Most correlated readings whose correlation is removed by one matrix.
_DENSE = 400

#: Degrees of freedom that a stated noise counts as: it is taken as right within about a quarter.
STATED = 8.0


@dataclass(frozen=True, eq=False)
class Off:
    """Errors of outliers, such as transcription errors.

    Other errors are not correlated with these. ``rows``: numbers of these readings, (m,);
    ``sizes``: standard deviations of their errors [their unit], (m,).
    """

    rows: Numbers
    sizes: Array

    def among(self, readings: Numbers) -> Off:
        """Select the errors of some readings by their numbers, renumbered in their order."""
        here = np.isin(readings, self.rows)
        return Off(np.flatnonzero(here), self.sizes[np.searchsorted(self.rows, readings[here])])


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
        """Build common errors from the effect of each at its standard deviation, (m, errors)."""
        directions, sizes, _ = svd(columns, full_matrices=False, lapack_driver="gesvd")
        return cls(rows, directions, sizes)

    @classmethod
    def zero(cls, count: int, size: float) -> Shared:
        """Build a zero that ``count`` readings have in common, of that standard deviation."""
        return cls.of(np.arange(count), np.full((count, 1), size))

    @property
    def columns(self) -> Array:
        """Effect of each error at its standard deviation, shape (m, k)."""
        return np.asarray(self.directions * self.sizes)

    def times(self, factor: float) -> Shared:
        """Multiply the errors by a factor."""
        return replace(self, sizes=factor * self.sizes)

    def over(self, sigma: Array) -> Shared:
        """Divide the errors by standard deviations of these readings, (m,)."""
        if np.ptp(sigma) == 0:
            return replace(self, sizes=self.sizes / sigma[0])
        return self.of(self.rows, self.columns / sigma[:, None])

    def among(self, readings: Numbers) -> Shared:
        """Select the errors of some readings by their numbers, renumbered in their order."""
        here = np.isin(readings, self.rows)
        if np.array_equal(readings[here], self.rows):
            return replace(self, rows=np.flatnonzero(here))
        place = np.searchsorted(self.rows, readings[here])
        return self.of(np.flatnonzero(here), self.columns[place])

    def joined(self, others: Sequence[Shared]) -> Shared:
        """Join these errors and others, where some readings are the same."""
        every = np.unique(np.concatenate([self.rows, *(some.rows for some in others)]))
        columns = list[Array]()
        for some in (self, *others):
            columns.append(np.zeros((len(every), len(some.sizes))))
            columns[-1][np.searchsorted(every, some.rows)] = some.columns
        return self.of(every, np.hstack(columns))


@dataclass(frozen=True, eq=False)
class NoiseMemory:
    """Correlated errors of readings in runs.

    They are an Ornstein–Uhlenbeck process plus white noise; a first-order autoregression where all
    of the error is correlated and readings are evenly spaced. ``rows``: numbers of the correlated
    readings, (m,); ``run``: number of the run of each; ``clock``: its place along the run;
    ``share``: correlated share of the variance; (m,) each. ``correlation``: that of the correlated
    parts of two readings whose clocks differ by 1.
    """

    rows: Numbers
    run: Numbers
    clock: Array
    share: Array
    correlation: float = float(np.exp(-1.0))

    def of(self, correlation: float, share: float) -> NoiseMemory:
        """Change the correlation and its share for the same readings."""
        return replace(self, correlation=correlation, share=np.full(len(self.rows), share))

    def among(self, readings: Numbers) -> NoiseMemory:
        """Select the memory of some readings by their numbers, renumbered in their order."""
        here = np.isin(readings, self.rows)
        order = np.argsort(self.rows)
        place = order[np.searchsorted(self.rows, readings[here], sorter=order)]
        return replace(self, rows=np.flatnonzero(here), run=self.run[place],
                       clock=self.clock[place], share=self.share[place])

    def without(self, rows: Numbers) -> NoiseMemory:
        """Drop some readings, by their numbers, from the memory."""
        kept = ~np.isin(self.rows, rows)
        return replace(self, rows=self.rows[kept], run=self.run[kept], clock=self.clock[kept],
                       share=self.share[kept])

    @cached_property
    def _steps(self) -> list[tuple[int, bool, float, float, float, float]]:
        """Kalman filter: each correlated reading, in order, and whether one is before it.

        With it: the correlation of both correlated parts, the root of the correlated share, the
        filter's gain, and the standard deviation of the reading's innovation.
        """
        steps, last, variance = [], -1, 1.0
        for this in np.lexsort((self.clock, self.run)).tolist():
            follows = last >= 0 and self.run[last] == self.run[this]
            apart = self.clock[this] - self.clock[last]
            kept = float(self.correlation**apart) if follows else 0.0
            predicted = kept**2 * variance + 1 - kept**2
            share = float(self.share[this])
            new = share * predicted + 1 - share
            gain = share**0.5 * predicted / new
            variance = predicted * (1 - gain * share**0.5)
            steps.append((this, bool(follows), kept, share**0.5, gain, new**0.5))
            last = this
        return steps

    @property
    def log_volume(self) -> float:
        """Logarithm of the volume over which errors spread, over that without correlation."""
        return float(np.sum(np.log([new for *_, new in self._steps])))

    def forgotten(self, values: Array) -> Array:
        """Transform errors over their standard deviations, (readings, …), to uncorrelated ones."""
        fresh = values.astype(float)
        some = values[self.rows]
        dense = len(self.rows) <= _DENSE
        fresh[self.rows] = self._forgetting @ some if dense else self._filtered(some)
        return fresh

    @cached_property
    def _forgetting(self) -> Array:
        """Matrix of :meth:`forgotten` for the correlated readings."""
        return self._filtered(np.eye(len(self.rows)))

    def _filtered(self, values: Array) -> Array:
        fresh, state = values.astype(float), np.zeros(values.shape[1:])
        for this, follows, kept, root, gain, new in self._steps:
            state = kept * state if follows else 0 * state
            missed = values[this] - root * state
            state = state + gain * missed
            fresh[this] = missed / new
        return fresh

    def remembered(self, fresh: Array) -> Array:
        """Transform uncorrelated errors, (readings, …), to correlated ones."""
        values, some = fresh.astype(float), fresh[self.rows]
        state = np.zeros(fresh.shape[1:])
        for this, follows, kept, root, gain, new in self._steps:
            state = kept * state if follows else 0 * state
            missed = new * some[this]
            values[self.rows[this]] = root * state + missed
            state = state + gain * missed
        return values


#: Part of a noise in addition to the independent error of each reading.
NoiseTerm = Off | Shared | NoiseMemory


@dataclass(frozen=True, eq=False)
class Noise:
    """Normal errors of readings: independent ones, and ``terms`` that are added to them.

    The covariance is S R S + C Cᵀ. S holds the standard deviations of the independent errors, which
    include rounding, and of outliers (:class:`Off`). R is the correlation of errors with those
    before them (:class:`NoiseMemory`). C holds all that is constant along a run, and its zero and
    gain (:class:`Shared`). Residuals are weighted by :meth:`whitened` alone, where the terms are
    combined.

    ``own``: standard deviation of each reading's independent error, shape (readings,), in its unit.
    ``freedom``: degrees of freedom of the noise of each part of the readings, shape (parts,);
    ``part``: the part of each reading. ``found``: the noise was estimated from these readings and
    tests use it as it is; otherwise their scatter counts too. ``given``: which readings came with
    a standard deviation of their own.
    """

    own: Array
    terms: tuple[NoiseTerm, ...] = ()
    source: Source = "stated"
    freedom: Array = field(default_factory=lambda: np.array([STATED]))
    part: Numbers = field(default_factory=lambda: np.empty(0, np.int64))
    found: bool = False
    given: Mask = field(default_factory=lambda: np.empty(0, bool))

    def __post_init__(self) -> None:
        if len(self.given) != len(self.own):
            object.__setattr__(self, "given", np.zeros(len(self.own), bool))
        if len(self.part) != len(self.own):
            object.__setattr__(self, "part", np.zeros(len(self.own), np.int64))

    def __len__(self) -> int:
        return len(self.own)

    def __getitem__(self, rows: Rows) -> Noise:
        """Select the noise of some readings."""
        numbers = np.arange(len(self))[rows]
        terms = tuple(term.among(numbers) for term in self.terms
                      if np.isin(term.rows, numbers).any())
        return replace(self, own=self.own[rows], part=self.part[rows], given=self.given[rows],
                       terms=terms)

    def joined(self, other: Noise) -> Noise:
        """Join the noise of these readings and others; noises that were found remain parts."""
        after = tuple(replace(term, rows=term.rows + len(self)) for term in other.terms)
        both = replace(self, own=np.r_[self.own, other.own], terms=self.terms + after,
                       part=np.r_[self.part, other.part], given=np.r_[self.given, other.given])
        if not self.found:
            return both
        return replace(both, freedom=np.r_[self.freedom, other.freedom],
                       part=np.r_[self.part, other.part + len(self.freedom)])

    @classmethod
    def of_one(cls, sigma: float, freedom: float = np.inf) -> Noise:
        """Build the noise of one reading with its degrees of freedom, infinite where given."""
        return cls(np.array([sigma]), freedom=np.array([freedom]), found=True)

    @classmethod
    def left(cls, squares: float, freedom: float, given: float | None = None, widen: bool = False
             ) -> Noise:
        """Estimate the noise of one reading from a fit's sum of squares, unless it is given.

        ``widen``: replace the given noise by a misfit that it cannot explain, since it would make
        limits too narrow.
        """
        found = (squares / freedom) ** 0.5
        if given is None:
            return cls.of_one(found, freedom)
        return cls.of_one(found if widen and found >= MISFIT * given else given)

    @classmethod
    def pooled(cls, values: Array, groups: Numbers, sigma: Array | float = 1.0) -> Noise | None:
        """Estimate the noise of one reading from the scatter of values, (n,), about group means.

        The result is in units of ``sigma``, the standard deviation of each reading up to a common
        factor, which also weights the means. None where nothing repeats.
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
        """Build independent errors; only stated or assumed ones have degrees of freedom."""
        beforehand = STATED if source in ("stated", "assumed") else 0.0
        return cls(sigma, source=source, freedom=np.array([beforehand]))

    def plus(self, *terms: NoiseTerm) -> Noise:
        """Add terms to the noise."""
        return replace(self, terms=(*self.terms, *terms))

    def times(self, factor: float | Array) -> Noise:
        """Multiply the independent errors by a factor.

        It is one factor for all readings, or one for each, (readings,).
        """
        every = np.broadcast_to(factor, self.own.shape)
        terms = tuple(replace(term, sizes=every[term.rows] * term.sizes)
                      if isinstance(term, Off) else term for term in self.terms)
        return replace(self, own=every * self.own, terms=terms)

    def with_own(self, sigma: Array) -> Noise:
        """Replace the standard deviation of each reading's independent error."""
        return replace(self, own=sigma)

    def known(self, freedom: float) -> Noise:
        """Mark the noise as found with these degrees of freedom."""
        return replace(self, freedom=np.array([freedom]), part=0 * self.part, found=True)

    @property
    def correlation(self) -> float:
        """Correlation of neighbouring errors, one step of the clock apart."""
        return max((memory.correlation * float(memory.share.max(initial=0.0))
                    for memory in self.memories), default=0.0)

    @property
    def ordinary(self) -> Noise:
        """Noise without outliers and without correlation."""
        return replace(self, terms=self.common)

    @property
    def common(self) -> tuple[Shared, ...]:
        """Errors that several readings have in common."""
        return tuple(term for term in self.terms if isinstance(term, Shared))

    @cached_property
    def off(self) -> Array:
        """Size of outliers [their unit], (readings,); 0 for other readings."""
        sizes = np.zeros(len(self))
        for term in self.terms:
            if isinstance(term, Off):
                sizes[term.rows] = np.hypot(sizes[term.rows], term.sizes)
        return sizes

    @cached_property
    def sigma(self) -> Array:
        """Standard deviation of each reading by itself, in its unit, (readings,)."""
        return np.hypot(self.own, self.off)

    @cached_property
    def memories(self) -> tuple[NoiseMemory, ...]:
        """Memories of the readings that are no outliers."""
        memories = tuple(term for term in self.terms if isinstance(term, NoiseMemory))
        if not self.off.any():
            return memories
        return tuple(memory.without(np.flatnonzero(self.off)) for memory in memories)

    @cached_property
    def _apart(self) -> tuple[Shared, ...]:
        """Common errors, combined so that no two of them act on the same reading."""
        apart = list[Shared]()
        for term in self.common:
            same = [some for some in apart if np.isin(some.rows, term.rows).any()]
            apart = [some for some in apart if some not in same]
            apart.append(term.joined(same) if same else term)
        return tuple(apart)

    @cached_property
    def _over(self) -> tuple[Shared, ...]:
        """Common errors over the noise of each reading, after removing correlation."""
        if not self.memories:
            return tuple(some.over(self.sigma[some.rows]) for some in self._apart)
        if not self._apart:
            return ()
        columns = [np.zeros((len(self), len(some.sizes))) for some in self._apart]
        for some, every in zip(self._apart, columns, strict=True):
            every[some.rows] = some.columns
        # Correlation connects readings that have no other error in common.
        over = (np.hstack(columns).T / self.sigma).T
        return (Shared.of(np.arange(len(self)), self._forgotten(over)),)

    def whitened(self, values: Array) -> Array:
        """Transform errors of readings, shape (readings, ...), to independent ones of size 1.

        The symmetric root keeps them as near to those of each reading as possible. Of a correlated
        error the innovation remains.
        """
        return self._turned(self._forgotten((values.T / self.sigma).T), -0.5)

    def coloured(self, values: Array) -> Array:
        """Transform independent errors of size 1, shape (readings, ...), to those of readings."""
        return (self._remembered(self._turned(values, 0.5)).T * self.sigma).T

    def apart(self, values: Array) -> Array:
        """Subtract from values, shape (readings, ...), the errors that several readings share."""
        return (self._remembered(self.whitened(values)).T * self.sigma).T

    def _forgotten(self, values: Array) -> Array:
        for memory in self.memories:
            values = memory.forgotten(values)
        return values

    def _remembered(self, fresh: Array) -> Array:
        for memory in self.memories:
            fresh = memory.remembered(fresh)
        return fresh

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
        """Median standard deviation of the independent errors, in their unit."""
        return float(np.median(self.sigma))

    @property
    def limits(self) -> Array:
        """Limits of the 95 % interval of its size, shape (2,).

        They hold for normal, independent errors: drift between repeats widens the scatter.
        """
        freedom = self.freedom.sum()
        return np.asarray(self.size * np.sqrt(freedom / chi2.ppf([0.975, 0.025], freedom)))

    @property
    def quantile(self) -> float:
        """Half width of 95 % intervals over the noise: Student's quantile; normal where given."""
        freedom = float(self.freedom.sum())
        return float(norm.ppf(0.975) if np.isinf(freedom) else t.ppf(0.975, freedom))

    @property
    def total(self) -> Array:
        """Standard deviation of each reading [its unit], including common errors."""
        squares = self.sigma**2
        for some in self.common:
            squares[some.rows] += np.sum(some.columns**2, axis=1)
        return np.sqrt(squares)

    @property
    def log_volume(self) -> float:
        """Logarithm of the volume over which errors spread, over that of independent ones alone."""
        return sum((0.5 * float(np.log1p(some.sizes**2).sum()) for some in self._over),
                   sum(memory.log_volume for memory in self.memories))

    def drawn(self, generator: np.random.Generator) -> Array:
        """Draw a set of errors."""
        return self.coloured(generator.standard_normal(len(self)))

    def variances(self, generator: np.random.Generator, count: int) -> Array:
        """Draw variances that estimates of the parts would have if 1 is true, (parts, count)."""
        freedom = self.freedom[:, None]
        return np.asarray(generator.chisquare(freedom, (len(freedom), count)) / freedom)

    def shares(self, columns: Array) -> Array:
        """Compute the share of each part in the squares of columns, shape (parts,)."""
        squares = np.bincount(self.part, np.sum(columns**2, axis=1), len(self.freedom))
        return np.asarray(squares / squares.sum())

    def freedom_of(self, shares: Array) -> float:
        """Compute degrees of freedom of a variance that is a weighted sum of the parts' variances.

        By Satterthwaite (Biometrics Bulletin 2, 110, 1946): those of one variance with the same
        scatter. A part with few readings is not better known because of the others.
        """
        return float(1 / np.sum(shares**2 / self.freedom))


def root_of(covariance: Array) -> Array:
    """Factor a covariance C Cᵀ, (n, n), into columns C, shape (n, k)."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
