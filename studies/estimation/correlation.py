"""Residuals that are like their neighbours: how much less readings then say.

Along one test errors last: what the model misses, a slow drift, a digitised line's wobble. Here
they are first-order autoregressive within each series of readings, independent between series.
Least squares stays the estimate; its limits are those of errors so correlated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz
from scipy.optimize import brentq
from scipy.stats import norm, t

Array = NDArray[np.float64]
Series = Sequence[NDArray[Any]]

#: Largest correlation looked for; what is more alike is one reading.
_MOST = 0.998


@dataclass(frozen=True, eq=False)
class CorrelatedNoise:
    """Errors of readings along series, and what they leave open of the unknowns.

    ``sigma`` is the standard deviation of a reading, ``correlation`` that of neighbours,
    ``freedom`` the effective degrees of freedom of ``sigma`` (Satterthwaite, Biometrics Bull. 2,
    110, 1946), inf where it was given; ``covariance`` is of the unknowns, shape (p, p), linearised;
    ``widening`` by how much errors that are correlated widen the limits of each, shape (p,).
    """

    sigma: float
    correlation: float
    freedom: float
    covariance: Array
    widening: Array

    @property
    def quantile(self) -> float:
        """Of 95 % limits."""
        return float(norm.ppf(0.975) if np.isinf(self.freedom) else t.ppf(0.975, self.freedom))

    def deviations(self, rows: Array) -> Array:
        """Standard deviations of what depends on the unknowns by ``rows``, shape (m, p)."""
        spread = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        return np.asarray(np.sqrt(np.maximum(np.einsum("ni,ij,nj->n", rows, spread, rows), 0.0)))

    @classmethod
    def of(cls, jacobian: Array, residual: Array, series: Series,
           given: float | None = None) -> CorrelatedNoise:
        """Of the residuals at a minimum and their derivative there.

        The correlation is the one with which residuals that remain after a fit of so many unknowns
        would be as much like their neighbours as these are, none where they are less alike than
        independent ones. ``given`` is a known standard deviation of a reading.
        """
        lengths = np.linalg.norm(jacobian, axis=0)
        safe = np.where(lengths > 0, lengths, 1.0)
        basis, singular, right = np.linalg.svd(jacobian / safe, full_matrices=False)
        seen = singular > 1e-10 * singular[0]
        sight = _Sight(basis[:, seen], series, len(residual))
        correlation = _correlation(sight, residual)
        spread, square, plain = sight.moments(correlation)
        sigma = float(np.sqrt(residual @ residual / plain)) if given is None else given
        back = right[seen].T / singular[seen] / safe[:, None]
        covariance = sigma**2 * back @ spread @ back.T
        with np.errstate(invalid="ignore", divide="ignore"):
            widening = np.sqrt(np.einsum("ij,jk,ik->i", back, spread, back)
                               / np.sum(back**2, axis=1))
        hidden = (np.abs(right[~seen]) > 1e-6).any(axis=0) | (lengths == 0)
        covariance[np.diag_indices_from(covariance)] = np.where(hidden, np.inf,
                                                                np.diag(covariance))
        freedom = np.inf if given is not None else float(plain**2 / square)
        return cls(sigma, correlation, freedom, covariance,
                   np.where(np.isfinite(widening), widening, 1.0))


@dataclass(frozen=True, eq=False)
class _Sight:
    """The space in which unknowns move residuals, by an orthonormal ``basis``, shape (n, p)."""

    basis: Array
    series: Series
    count: int

    def neighbours(self, values: Array) -> float:
        """Σ of the products of neighbours."""
        return float(sum(values[run[:-1]] @ values[run[1:]] for run in self.series))

    def moments(self, correlation: float) -> tuple[Array, float, float]:
        """QᵀRQ, tr (MR)², tr MR of R, the correlations of errors, and M = 1 − QQᵀ."""
        carried = self._carried(correlation)
        spread = self.basis.T @ carried
        lags = sum(float(_powers(correlation**2, len(run)) @ _weights(len(run)))
                   for run in self.series) + self.count - sum(map(len, self.series))
        square = lags - 2 * float(np.sum(carried**2)) + float(np.sum(spread**2))
        return spread, square, self.count - float(np.trace(spread))

    def likeness(self, correlation: float) -> float:
        """Of neighbours after a fit: expected Σ of products over expected Σ of squares."""
        carried = self._carried(correlation)
        spread = self.basis.T @ carried
        shifted = np.zeros_like(self.basis)
        for run in self.series:
            shifted[run[:-1]] += self.basis[run[1:]] / 2
            shifted[run[1:]] += self.basis[run[:-1]] / 2
        products = correlation * sum(max(len(run) - 1, 0) for run in self.series)
        products -= 2 * float(np.sum(shifted * carried))
        products += float(np.sum((self.basis.T @ shifted) * spread))
        return products / (self.count - float(np.trace(spread)))

    def _carried(self, correlation: float) -> Array:
        """R times the basis; what is in no series is correlated with nothing."""
        carried = self.basis.copy()
        for run in self.series:
            carried[run] = toeplitz(_powers(correlation, len(run))) @ self.basis[run]
        return carried


def _correlation(sight: _Sight, residual: Array) -> float:
    squares = float(residual @ residual)
    if squares == 0:
        return 0.0
    alike = sight.neighbours(residual) / squares

    def beyond(correlation: float) -> float:
        return sight.likeness(correlation) - alike

    if beyond(0.0) >= 0:
        return 0.0
    return _MOST if beyond(_MOST) <= 0 else float(brentq(beyond, 0.0, _MOST, xtol=1e-4))


def _powers(base: float, count: int) -> Array:
    return np.asarray(base ** np.arange(count), float)


def _weights(count: int) -> Array:
    """How often each lag stands in a Toeplitz matrix."""
    return np.append(count, 2.0 * np.arange(count - 1, 0, -1))
