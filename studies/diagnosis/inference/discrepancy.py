"""The evidence of what no effect of the library makes: smooth discrepancies of any kind."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from tympan.studies.diagnosis.inference.fit import NUISANCE, Fit
from tympan.studies.diagnosis.inference.residual_tests import ResidualPattern, orthonormal

Array = NDArray[np.float64]

#: Sizes a discrepancy may have over the noise, each as probable as the other.
_SIZES = np.geomspace(0.3, 100.0, 12)


def discrepancy_evidence(nominal: Fit, groups: tuple[ResidualPattern, ...], sigma: Array) -> float:
    """Logarithm of the readings' probability if the nominal model is off by some smooth pattern.

    A pattern's columns have independent normal coefficients that make it a typical size, the same
    for one pattern of the table at a time or for all; the nominal model is taken as linear about
    its fit.

    Parameters
    ----------
    sigma
        Noise of the readings, shape (rows,).
    """
    evidence = []
    for group in groups:
        basis = orthonormal(group.columns / sigma[:, None])
        scale = (len(sigma) / max(basis.shape[1], 1)) ** 0.5
        evidence += [_evidence(nominal, size * scale * basis) for size in _SIZES]
    return float(logsumexp(evidence) - np.log(len(evidence)))


def _evidence(nominal: Fit, columns: Array) -> float:
    """With columns whose coefficients are standard normal."""
    residual = nominal.residual + nominal.jacobian @ nominal.unknowns
    spread = np.concatenate([NUISANCE * nominal.jacobian, columns], axis=1)
    inner = np.eye(spread.shape[1]) + spread.T @ spread
    along = spread.T @ residual
    squares = residual @ residual - along @ np.linalg.solve(inner, along)
    return float(-0.5 * squares - 0.5 * np.linalg.slogdet(inner)[1])
