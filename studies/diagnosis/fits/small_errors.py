"""Errors of every kind that are too small to be told apart, as noise that readings share."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import svd

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SmallErrors:
    """Normal errors whose covariance over the noise is 1 + B Bᵀ, by the singular values of B.

    ``directions``: orthonormal columns, shape (rows, k); ``sizes``: standard deviations of errors
    along them, over the noise, shape (k,).
    """

    directions: Array
    sizes: Array

    @classmethod
    def of(cls, columns: Array) -> SmallErrors:
        """By what each error does at its standard deviation, shape (rows, errors)."""
        directions, sizes, _ = svd(columns, full_matrices=False, lapack_driver="gesvd")
        return cls(directions, sizes)

    def scaled(self, share: float) -> SmallErrors:
        """Errors so many times as large."""
        return replace(self, sizes=share * self.sizes)

    def __getitem__(self, rows: NDArray[np.bool_]) -> SmallErrors:
        """Those of some readings."""
        return self.of(self.directions[rows] * self.sizes)

    def whitened(self, values: Array) -> Array:
        """Values of readings over their noise, shape (rows, ...), with independent errors."""
        shrunk = 1 - (1 + self.sizes**2) ** -0.5
        return np.asarray(values - (self.directions * shrunk) @ (self.directions.T @ values))

    @property
    def log_volume(self) -> float:
        """Logarithm of the volume over which errors spread, over that of noise alone."""
        return 0.5 * float(np.log1p(self.sizes**2).sum())
