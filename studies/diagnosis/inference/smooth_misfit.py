"""A smooth misfit of no cause: a Gaussian process over voltage, mass and specimen."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.inference.projection import orthonormal
from tympan.studies.diagnosis.patterns.reading_patterns import among
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.estimation.noise import root_of

#: Trial lengths of the Gaussian process, in U² over its largest value, from quick changes to nearly
#: a line.
_VOLTAGES = (0.2, 0.5, 1.0, 3.0)
#: Trial lengths in mass over its largest value.
_MASSES = (0.1, 0.5, 2.0)

#: Trial correlations of specimens, from independent to nearly one film.
_LIKE = (0.0, 0.5, 0.9, 0.99)
#: Trial sizes of the process, over that of the residuals.
_SIZES = (0.3, 1.0, 3.0, 10.0)

#: Most rows on which the process is trained; more are thinned evenly.
MOST_ROWS = 400

#: Share of the largest direction of a process below which a direction is left out.
_LEAST = 1e-4


@dataclass(frozen=True, eq=False)
class GaussianProcess:
    """Residuals as a Gaussian process with a squared-exponential kernel over U², mass and specimen.

    A row that is a difference of two states is the difference of the process at both. ``like`` is
    the correlation of any two specimens; ``size`` the standard deviation [unit of the readings].
    """

    train: ReadingTable
    residual: Array
    lengths: tuple[float, float]
    like: float
    size: float

    @classmethod
    def trained(cls, table: ReadingTable, residual: Array, taken: Array | None = None
                ) -> GaussianProcess:
        """Find the most probable lengths, correlation and size on a grid for residuals, (rows,).

        ``taken``: columns over the noise that a model's unknowns have absorbed. Nothing of these is
        left in the residuals; if that were not counted, the size would be found too small.
        """
        if len(table) > MOST_ROWS:
            kept = np.linspace(0, len(table) - 1, MOST_ROWS).astype(np.int64)
            table, residual = table[kept], residual[kept]
            taken = taken[kept] if taken is not None else None
        left = np.eye(len(table)) if taken is None else _beside(taken)
        typical = max(float(np.sqrt(np.mean(residual**2))), float(table.sigma.min()))
        best, trained = -np.inf, cls(table, residual, (1.0, 1.0), 0.5, typical)
        for voltage_squared, mass, like in product(_VOLTAGES, _MASSES, _LIKE):
            process = cls(table, residual, (voltage_squared, mass), like, typical)
            values, vectors = np.linalg.eigh(left.T @ (process.covariance(
                table, table) / np.outer(table.sigma, table.sigma)) @ left)
            along = vectors.T @ (left.T @ (residual / table.sigma))
            for share in _SIZES:
                spread = 1 + share**2 * np.maximum(values, 0.0)
                likelihood = -0.5 * float(np.sum(along**2 / spread + np.log(spread)))
                if likelihood > best:
                    best, trained = likelihood, replace(process, size=share * typical)
        return trained

    def covariance(self, table: ReadingTable, other: ReadingTable) -> Array:
        """Compute the noise-free covariance of rows of two tables, shape (rows, other rows)."""
        states = self.train.states
        voltage_squared, mass = (max(float(np.abs(values).max()), 1e-12)
                                 for values in (states.voltage**2, states.mass))
        total = np.zeros((len(table), len(other)))
        for end, sign in _ends(table):
            for other_end, opposite in _ends(other):
                a, b = table.states[end], other.states[other_end]
                between = a.voltage[:, None] ** 2 - b.voltage**2
                far = (between / voltage_squared / self.lengths[0]) ** 2
                far += ((a.mass[:, None] - b.mass) / mass / self.lengths[1]) ** 2
                alike = np.where(a.specimen[:, None] == b.specimen, 1.0, self.like)
                total += np.outer(sign, opposite) * alike * np.exp(-0.5 * far)
        return self.size**2 * total

    def predicted(self, table: ReadingTable) -> Array:
        """Predict the most probable residuals of a table's rows, shape (rows,)."""
        noisy = self.covariance(self.train, self.train) + np.diag(self.train.sigma**2)
        weights = np.linalg.solve(noisy, self.residual)
        return np.asarray(self.covariance(table, self.train) @ weights)


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """A smooth misfit that no hypothesis has, in readings and in predictions of their fits.

    ``table``: the readings of the fits.
    """

    process: GaussianProcess
    table: ReadingTable

    @classmethod
    def of(cls, fit: Fit, table: ReadingTable) -> Discrepancy | None:
        """Train it on a fit's residuals of lengths; None where there are none."""
        rows = table.lengths
        if not rows.any():
            return None
        missed = table.noise.apart(table.value - fit.predicted(table))
        return cls(GaussianProcess.trained(table[rows], missed[rows], fit.free_jacobian[rows]),
                   table)

    def variance(self, fit: Fit, jacobian: Array, table: ReadingTable) -> Array:
        """Compute the variance that it adds to a fit's predictions of a table's rows, (rows,).

        ``jacobian``: of these rows by the unknowns. The misfit acts in these rows directly, and
        has moved the fit through the readings.
        """
        rows, there = np.flatnonzero(self.table.lengths), np.flatnonzero(table.lengths)
        kept = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_ROWS)).astype(np.int64)]
        read, asked = self.table[kept], table[there]
        moved = jacobian[there] @ np.linalg.solve(
            fit.precision, fit.jacobian[kept].T / read.sigma) * (len(rows) / len(kept))
        own, common = (self.process.covariance(asked, other) for other in (asked, read))
        variance = np.zeros(len(table))
        variance[there] = np.diag(own) - 2 * np.sum(moved * common, axis=1) + np.sum(
            (moved @ self.process.covariance(read, read)) * moved, axis=1)
        return np.maximum(variance, 0.0)


def _beside(taken: Array) -> Array:
    """Build an orthonormal basis of the complement of some columns."""
    basis = orthonormal(taken)
    whole, _ = np.linalg.qr(np.hstack([basis, np.eye(len(basis))]))
    return np.asarray(whole[:, basis.shape[1]:])


def _ends(table: ReadingTable) -> list[tuple[Numbers, Array]]:
    """List the states of the rows with their signs: the one read, and the other one of ranges."""
    ends = [(table.state, np.ones(len(table)))]
    ranges = table.kind == "range"
    if ranges.any():
        ends.append((np.maximum(table.since, 0), -ranges.astype(float)))
    return ends


def smooth_columns(table: ReadingTable) -> Iterator[Array]:
    """Yield columns of which smooth misfits of lengths are random sums, (rows, columns).

    One set for each trial length and correlation but 0: misfits of films of one kind are similar.
    None where there are too many rows.
    """
    lengths = table[table.lengths]
    if not 0 < len(lengths) <= MOST_ROWS:
        return
    for voltage_squared, mass, like in product(_VOLTAGES, _MASSES, filter(None, _LIKE)):
        process = GaussianProcess(lengths, np.zeros(len(lengths)), (voltage_squared, mass), like,
                                  1.0)
        columns = root_of(process.covariance(lengths, lengths))
        sizes = np.linalg.norm(columns, axis=0)
        yield among(table.lengths, columns[:, sizes > _LEAST * sizes.max()])
