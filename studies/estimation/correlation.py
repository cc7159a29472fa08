"""Correlation between neighbouring residuals, and the information that readings then have.

Along one test errors last: a misfit of the model, a slow drift, the wobble of a digitised line.
Here they are first-order autoregressive within each series of readings, independent between series.
Least squares stays the estimate; its limits are those for errors with this correlation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import toeplitz
from scipy.stats import norm, t

from tympan.base.arrays import Array, Numbers
from tympan.fem.roots import root_between
from tympan.studies.estimation.identifiability import seen_by
from tympan.studies.estimation.noise import Noise

Series = Sequence[Numbers]

#: Largest correlation considered; a larger one means a single reading.
_MOST = 0.998


#: Half the difference of correlations for slopes.
_APART = 1e-4


def independent_count(readings: float, correlation: float) -> float:
    """Count the independent readings that are worth as much as correlated ones, for a mean.

    Examples
    --------
    >>> independent_count(60, 0.5)
    20.0
    """
    return readings * (1 - correlation) / (1 + correlation)


def akaike(mean_square: float, count: float, constants: int, sigma: float | None = None) -> float:
    """Compute Akaike's criterion, corrected for few readings (Hurvich, Tsai, Biometrika 76, 1989).

    The correction is on p. 297. ``count`` is the number of independent readings, ``mean_square``
    the mean squared residual, ``sigma`` a known standard deviation of a reading; an estimated one
    counts as one more constant. The result is inf where there are too few readings for the
    constants.
    """
    every = constants + (sigma is None)
    spare = count - every - 1
    if spare <= 0:
        return np.inf
    misfit = (count * np.log(max(mean_square, 1e-300)) if sigma is None
              else count * mean_square / sigma**2)
    return float(misfit + 2 * every * count / spare)


@dataclass(frozen=True, eq=False)
class CorrelatedSpread:
    """Uncertainty of the unknowns under errors that are correlated along series.

    ``noise`` of a reading has the effective degrees of freedom (Satterthwaite, Biometrics Bull. 2,
    110, 1946), ``correlation`` is that of neighbours. ``covariance`` is that of the unknowns, shape
    (p, p), linearised; ``widening`` is the factor by which correlation widens the limits of each,
    shape (p,).
    """

    noise: Noise
    correlation: float
    covariance: Array
    widening: Array
    scatter: _Scatter

    def noise_of(self, unknowns: slice) -> Noise:
        """Give the noise the fewest degrees of freedom that some unknowns have by it."""
        freedoms = self.scatter.freedoms(np.eye(len(self.covariance))[unknowns])
        return Noise.of_one(self.noise.size, float(freedoms.min()))

    @property
    def quantiles(self) -> Array:
        """Quantiles of 95 % limits of each unknown, shape (p,)."""
        return self._quantiles(np.eye(len(self.covariance)))

    def halves(self, rows: Array) -> Array:
        """Compute half the 95 % bands of values that depend on the unknowns by ``rows``, (m, p)."""
        spread = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        return np.sqrt(_along(rows, spread)) * self._quantiles(rows)

    def _quantiles(self, rows: Array) -> Array:
        freedoms = self.scatter.freedoms(rows)
        return np.asarray(np.where(np.isinf(freedoms), norm.ppf(0.975), t.ppf(0.975, freedoms)))

    @classmethod
    def of(cls, jacobian: Array, residual: Array, series: Series,
           given: float | None = None) -> CorrelatedSpread:
        """Estimate the uncertainty from the residuals at a minimum and their derivative there.

        The correlation is the one with which residuals after a fit of as many unknowns would
        resemble their neighbours as much as these do; 0 where they resemble them less than
        independent ones. ``given`` is a known standard deviation of a reading.
        """
        basis, back, hidden = seen_by(jacobian)
        sight = _Sight(basis, series, len(residual))
        correlation = _correlation(sight, residual)
        moments = sight.moments(correlation)
        sigma = float(np.sqrt(residual @ residual / moments.plain)) if given is None else given
        covariance = (sigma**2 * back @ moments.spread @ back.T
                      + np.diag(np.where(hidden, np.inf, 0.0)))
        with np.errstate(invalid="ignore", divide="ignore"):
            widening = np.sqrt(_along(back, moments.spread) / np.sum(back**2, axis=1))
        freedom = np.inf if given is not None else float(moments.plain**2 / moments.squares[0])
        return cls(Noise.of_one(sigma, freedom), correlation, covariance,
                   np.where(np.isfinite(widening), widening, 1.0),
                   _Scatter.of(sight, correlation, back, given is not None))


@dataclass(frozen=True, eq=False)
class _Scatter:
    """Uncertainty of the variance of values that depend on the unknowns.

    Such a variance is estimated by two sums over residuals, of squares and of products of
    neighbours: the second determines the correlation. To first order its logarithm is the quadratic
    form eᵀM(g + κ(N − a))Me over the expected first sum. Its effective degrees of freedom follow
    from its variance (Satterthwaite; for estimated correlations Kenward and Roger, Biometrics 53,
    983, 1997). N has the products of neighbours, a is their expected sum over that of the squares,
    g is 0 where the noise is given, and κ is the relative growth of the variance with a.

    ``moments`` are those at the correlation, ``slope`` is that of QᵀRQ by a, ``growth`` that of the
    logarithm of the first sum, 0 where the noise is given.
    """

    moments: _Moments
    back: Array
    slope: Array
    growth: float
    given: bool

    @classmethod
    def of(cls, sight: _Sight, correlation: float, back: Array, given: bool) -> _Scatter:
        """Compute slopes by the correlation, zero where it does not follow the residuals."""
        moments = sight.moments(correlation)
        if not 0 < correlation < _MOST:
            return cls(moments, back, 0 * moments.spread, 0.0, given)
        low, high = (sight.moments(correlation + step) for step in (-_APART, _APART))
        likeness = high.likeness - low.likeness
        growth = 0.0 if given else float(np.log(high.plain / low.plain)) / likeness
        return cls(moments, back, (high.spread - low.spread) / likeness, growth, given)

    def freedoms(self, rows: Array) -> Array:
        """Compute degrees of freedom, at least one, of values that depend by rows, shape (m,)."""
        along = rows @ self.back
        with np.errstate(invalid="ignore", divide="ignore"):
            grown = _signed(along, self.slope) / _along(along, self.moments.spread) - self.growth
            squares, cross, products = self.moments.squares
            a, g = self.moments.likeness, 0.0 if self.given else 1.0
            variance = (g * squares + 2 * g * grown * (cross - a * squares)
                        + grown**2 * (products - 2 * a * cross + a * a * squares))
            freedoms = np.nan_to_num(self.moments.plain**2 / variance, nan=np.inf, posinf=np.inf)
            return np.maximum(freedoms, 1.0)


@dataclass(frozen=True, eq=False)
class _Moments:
    """Moments of errors with correlation R, from the residuals MRM after a fit, M = 1 − QQᵀ.

    ``spread`` is QᵀRQ; ``plain`` is tr MR, of the squares; ``likeness`` is that of products of
    neighbours over it; ``squares`` are tr (MR)², tr MRMNMR, tr (NMRM)², N with the products of
    neighbours.
    """

    spread: Array
    plain: float
    likeness: float
    squares: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class _Sight:
    """The space in which unknowns move residuals, by an orthonormal ``basis``, shape (n, p)."""

    basis: Array
    series: Series
    count: int

    def neighbours(self, values: Array) -> float:
        """Sum the products of neighbours."""
        return float(sum(values[run[:-1]] @ values[run[1:]] for run in self.series))

    def likeness(self, correlation: float) -> float:
        """Compute the expected sum of neighbours' products over that of squares, after a fit."""
        carried = self._carried(self.basis, correlation)
        spread, shifted = self.basis.T @ carried, self._shifted(self.basis)
        products = correlation * sum(max(len(run) - 1, 0) for run in self.series)
        products -= 2 * float(np.sum(shifted * carried))
        products += float(np.sum((self.basis.T @ shifted) * spread))
        return products / (self.count - float(np.trace(spread)))

    def moments(self, correlation: float) -> _Moments:
        """Compute MRM = R − U J Uᵀ of few columns U = (Q, RQ − ½ QQᵀRQ); J swaps their halves."""
        carried = self._carried(self.basis, correlation)
        spread = self.basis.T @ carried
        u = np.hstack([self.basis, carried - self.basis @ spread / 2])
        swapped = np.roll(u, len(spread), axis=1)
        shifted, carried = self._shifted(u), self._carried(u, correlation)
        squares = self._squares(correlation)
        within, across = swapped.T @ u, swapped.T @ shifted
        whole = (
            squares[0] - 2 * _trace(swapped, carried) + np.trace(within @ within),
            squares[1] - 2 * _trace(self._shifted(swapped), carried) + np.trace(within @ across),
            squares[2] - 2 * _trace(self._shifted(swapped), self._carried(shifted, correlation))
            + np.trace(across @ across))
        return _Moments(spread, self.count - float(np.trace(spread)), self.likeness(correlation),
                        (float(whole[0]), float(whole[1]), float(whole[2])))

    def _squares(self, correlation: float) -> Array:
        """Compute tr R², tr NR², tr (NR)²."""
        sums = np.array([self.count - sum(map(len, self.series)), 0.0, 0.0])
        for run in self.series:
            r = toeplitz(_powers(correlation, len(run)))
            near = toeplitz(np.where(np.arange(len(run)) == 1, 0.5, 0.0)) @ r
            sums += np.sum(r * r), np.sum(near * r), np.sum(near * near.T)
        return sums

    def _carried(self, columns: Array, correlation: float) -> Array:
        """Multiply R by columns; readings outside any series are uncorrelated."""
        carried = columns.copy()
        for run in self.series:
            carried[run] = toeplitz(_powers(correlation, len(run))) @ columns[run]
        return carried

    def _shifted(self, columns: Array) -> Array:
        """Multiply N by columns: half the sum of a reading's neighbours."""
        shifted = np.zeros_like(columns)
        for run in self.series:
            shifted[run[:-1]] += columns[run[1:]] / 2
            shifted[run[1:]] += columns[run[:-1]] / 2
        return shifted


def _correlation(sight: _Sight, residual: Array) -> float:
    squares = float(residual @ residual)
    if squares == 0:
        return 0.0
    alike = sight.neighbours(residual) / squares

    def beyond(correlation: float) -> float:
        return sight.likeness(correlation) - alike

    if beyond(0.0) >= 0:
        return 0.0
    between = None if beyond(_MOST) <= 0 else root_between(beyond, 0.0, _MOST, xtol=1e-4)
    return _MOST if between is None else between


def _powers(base: float, count: int) -> Array:
    return np.asarray(base ** np.arange(count), float)


def _trace(first: Array, second: Array) -> float:
    """Compute the trace of firstᵀ second."""
    return float(np.sum(first * second))


def _signed(rows: Array, matrix: Array) -> Array:
    """Compute the quadratic form xᵀAx of every row x."""
    return np.asarray(np.einsum("ni,ij,nj->n", rows, matrix, rows))


def _along(rows: Array, matrix: Array) -> Array:
    """Compute the quadratic form xᵀAx of every row x, for an A without negative eigenvalues."""
    return np.maximum(_signed(rows, matrix), 0.0)
