"""A Gaussian process on what a model leaves: how well curves predict without any cause."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.reading_table import ReadingTable

Array = NDArray[np.float64]

#: Lengths in U² over its largest and in mass over its largest, likeness of specimens, and sizes
#: over the residuals'.
_VOLTAGES, _MASSES = (0.2, 0.5, 1.0, 3.0), (0.1, 0.5, 2.0)
_LIKE, _SIZES = (0.0, 0.5, 0.9, 0.99), (0.3, 1.0, 3.0, 10.0)

#: More rows than this are thinned evenly before the process is trained.
MOST_ROWS = 400


@dataclass(frozen=True, eq=False)
class GaussianProcess:
    """Residuals as a Gaussian process with a squared-exponential kernel over U², mass and specimen.

    A row that is a difference of two states is the difference of the process at both. ``like`` is
    the correlation of two specimens, whichever they are; ``size`` the standard deviation [unit of
    the readings].
    """

    train: ReadingTable
    residual: Array
    lengths: tuple[float, float]
    like: float
    size: float

    @classmethod
    def trained(cls, table: ReadingTable, residual: Array) -> GaussianProcess:
        """The most probable lengths, likeness and size on a grid, for residuals, shape (rows,)."""
        if len(table) > MOST_ROWS:
            kept = np.linspace(0, len(table) - 1, MOST_ROWS).astype(np.int64)
            table, residual = table[kept], residual[kept]
        typical = max(float(np.sqrt(np.mean(residual**2))), float(table.sigma.min()))
        best, trained = -np.inf, cls(table, residual, (1.0, 1.0), 0.5, typical)
        for voltage_squared, mass, like in product(_VOLTAGES, _MASSES, _LIKE):
            process = cls(table, residual, (voltage_squared, mass), like, typical)
            values, vectors = np.linalg.eigh(process.covariance(table, table)
                                             / np.outer(table.sigma, table.sigma))
            along = vectors.T @ (residual / table.sigma)
            for share in _SIZES:
                spread = 1 + share**2 * np.maximum(values, 0.0)
                likelihood = -0.5 * float(np.sum(along**2 / spread + np.log(spread)))
                if likelihood > best:
                    best, trained = likelihood, replace(process, size=share * typical)
        return trained

    def covariance(self, one: ReadingTable, other: ReadingTable) -> Array:
        """Covariance of the rows of two tables without noise, shape (rows, rows of the other)."""
        voltage_squared, mass = (max(float(np.abs(values).max()), 1e-12) for values in
                        (self.train.states.voltage**2, self.train.states.mass))
        total = np.zeros((len(one), len(other)))
        for end, sign in _ends(one):
            for other_end, opposite in _ends(other):
                a, b = one.states[end], other.states[other_end]
                between = a.voltage[:, None] ** 2 - b.voltage**2
                far = (between / voltage_squared / self.lengths[0]) ** 2
                far += ((a.mass[:, None] - b.mass) / mass / self.lengths[1]) ** 2
                alike = np.where(a.specimen[:, None] == b.specimen, 1.0, self.like)
                total += np.outer(sign, opposite) * alike * np.exp(-0.5 * far)
        return self.size**2 * total

    def predicted(self, table: ReadingTable) -> Array:
        """The most probable residuals of a table's rows, shape (rows,)."""
        noisy = self.covariance(self.train, self.train) + np.diag(self.train.sigma**2)
        weights = np.linalg.solve(noisy, self.residual)
        return np.asarray(self.covariance(table, self.train) @ weights)


def _ends(table: ReadingTable) -> list[tuple[NDArray[np.int64], Array]]:
    """The states of the rows with their signs: the one read, and of ranges the other."""
    ends = [(table.state, np.ones(len(table)))]
    if np.any(table.since >= 0):
        ends.append((np.maximum(table.since, 0), -(table.since >= 0).astype(float)))
    return ends
