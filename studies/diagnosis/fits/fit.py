"""Fit of a hypothesis: its most probable unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from tympan.base.arrays import Array, Mask
from tympan.studies.diagnosis.hypothesis import FACTORS, SIZES, Cause, Hypothesis, sizes_of
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.estimation.noise import Noise

#: Prior standard deviations of the logarithms of the factors on stiffness and permittivity: sources
#: on one tape differ by a factor of 1.7 in stiffness, and from 2.6 to 4.7 in permittivity.
NUISANCE = np.array([0.5, 0.4])


@dataclass(frozen=True, eq=False)
class Fit:
    """A hypothesis fitted to a table.

    ``residual``: readings minus predictions, whitened by their noise, shape (rows,); ``jacobian``:
    derivatives of the predictions, whitened, by the unknowns; ``bounds`` and ``limits``: unknowns
    for which films are sampled and could be sampled, shape (2, unknowns); ``slope`` and
    ``precision``: first and second derivatives of the cost; ``cost``: minus the logarithm of the
    posterior density; ``evidence``: logarithm of the readings' probability, up to a constant that
    all hypotheses share; ``deflection``: deflections of the states [m]. Where not all states are
    possible, cost and evidence are infinite, and ``short`` is the cost that laws of further reach
    might have, or inf. Prior scales were multiplied by ``widen``. Small errors may be assumed
    ``beside`` the hypothesis.
    """

    hypothesis: Hypothesis
    unknowns: Array
    bounds: Array
    limits: Array
    residual: Array
    jacobian: Array
    slope: Array
    precision: Array
    cost: float
    evidence: float
    deflection: Array
    short: float = np.inf
    widen: float = 1.0
    beside: Noise | None = None

    @property
    def possible(self) -> bool:
        """Whether some unknowns give an equilibrium in every state that was read."""
        return bool(np.isfinite(self.cost))

    @property
    def chi_squared(self) -> float:
        """Sum of squared residuals."""
        return float(self.residual @ self.residual)

    @property
    def misfit(self) -> float:
        """Root of χ² per degree of freedom, with small errors as noise; at least 1."""
        left = self.whitened(self.residual)
        freedom = max(len(left) - int(np.sum(~self.stopped)), 1)
        return max(1.0, float(np.sqrt(left @ left / freedom)))

    def louder(self, factor: float) -> Fit:
        """Scale the noise by a factor at the same unknowns: for their limits."""
        jacobian = self.whitened(self.jacobian)
        return replace(self, residual=self.residual / factor, jacobian=self.jacobian / factor,
                       precision=self.precision - (1 - factor**-2) * jacobian.T @ jacobian)

    def part(self, rows: Mask) -> Fit:
        """Restrict the fit to some of the readings at the same unknowns."""
        return replace(self, residual=self.residual[rows], jacobian=self.jacobian[rows],
                       beside=self.beside and self.beside[rows])

    @property
    def covariance(self) -> Array:
        """Covariance of the unknowns, shape (p, p)."""
        # Scaled by their own widths, since unknowns in different units differ in magnitude.
        width = np.maximum(np.abs(np.diag(self.precision)), 1e-300) ** -0.5
        scaled = self.precision * width * width[:, None]
        return np.asarray(np.linalg.pinv(scaled, hermitian=True) * width * width[:, None], float)

    @property
    def usual(self) -> float:
        """Prior probability that factors are as far from 1 as those found, or further.

        A prior predictive check (Box, J. R. Stat. Soc. A 143, 383, 1980).
        """
        return float(chdtrc(FACTORS.stop, np.sum((self.unknowns[FACTORS] / NUISANCE) ** 2)))

    @property
    def deviations(self) -> Array:
        """Standard deviations of the unknowns."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def stopped(self) -> Mask:
        """Mask of unknowns that are stopped by a bound."""
        low, high = self.bounds
        return np.asarray(((self.unknowns <= low) & (self.slope > 0))
                          | ((self.unknowns >= high) & (self.slope < 0)))

    @property
    def at_limit(self) -> bool:
        """Whether a size of its effects stopped at a bound."""
        sizes, (low, high) = self.unknowns[SIZES], self.bounds[:, SIZES]
        return bool(np.any((sizes != 0) & ((sizes <= low) | (sizes >= high))))

    @property
    def free_jacobian(self) -> Array:
        """Jacobian by the unknowns that are not stopped: only these can reduce the residuals."""
        return np.asarray(self.jacobian[:, ~self.stopped])

    def predicted(self, table: ReadingTable) -> Array:
        """Compute the predicted readings of the table it was fitted to, shape (rows,)."""
        return np.asarray(table.value - table.noise.coloured(self.residual))

    def whitened(self, values: Array) -> Array:
        """Divide values of readings by their noise alone, without small errors."""
        return values if self.beside is None else self.beside.whitened(values)

    def surprise(self, cause: Cause) -> float:
        """Find the largest size of a cause's parameters over its prior scale."""
        sizes = np.abs(self.unknowns[sizes_of(self.hypothesis, cause)])
        usual = [parameter.deviation for parameter in cause.effect.parameters]
        return float((sizes / usual).max())


def best_of(fits: Sequence[Fit]) -> Fit:
    """Select the most probable fit, possible ones first."""
    return min(fits, key=lambda fit: (fit.cost, fit.short))
