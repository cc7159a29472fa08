"""Least squares over the simplex α ≥ 0, Σ α = 1, and its uncertainty."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linprog, nnls

from tympan.base.arrays import Array


def simplex_fit(forces: Array, target: Array) -> Array:
    """Minimise |forces · α − target| over α ≥ 0, Σ α = 1, exactly.

    On the simplex the residual is a point in the hull of the circles' own residuals. The hull's
    point nearest to 0 is a problem of non-negative weights, whose sum is then scaled to 1 (Lawson &
    Hanson, *Solving Least Squares Problems*, 1974). ``forces`` has shape (samples, circles).

    Examples
    --------
    >>> forces = np.array([[2.0, 1.0], [4.0, 2.5]])
    >>> simplex_fit(forces, forces @ [0.3, 0.7]).round(12).tolist()
    [0.3, 0.7]
    >>> simplex_fit(forces, np.array([9.0, 9.0])).tolist()
    [1.0, 0.0]
    """
    residuals = (forces - target[:, None]) / np.linalg.norm(target)
    weights, _ = nnls(np.vstack([residuals, np.ones(forces.shape[1])]),
                      np.append(np.zeros(len(target)), 1.0))
    return np.asarray(weights / weights.sum())


def weight_ranges(forces: Array, target: Array, error: float) -> tuple[tuple[float, float], ...]:
    """Find smallest and largest weight of each circle among mixtures with at most this error.

    The error is relative to the target, sample by sample; so each end is a linear programme's. If
    no mixture is that accurate, the ranges are empty, (nan, nan), and ``error`` must be larger.

    Examples
    --------
    Three circles with proportional forces leave all but one number undetermined.

    >>> forces = np.outer([1.0, 2.0], [3.0, 2.0, 1.0])
    >>> ranges = weight_ranges(forces, forces @ [0.25, 0.5, 0.25], 1e-9)
    >>> [tuple(round(end, 6) for end in pair) for pair in ranges]
    [(0.0, 0.5), (0.0, 1.0), (0.0, 0.5)]
    """
    relative = forces / target[:, None]
    rows = np.vstack([relative, -relative])
    limits = np.repeat([1 + error, error - 1], len(target))
    ranges = []
    for unit in np.eye(forces.shape[1]):
        # The weights are from 0 to 1, and their sum is 1.
        low, high = (linprog(sign * unit, rows, limits, np.ones((1, len(unit))), [1.0], (0, 1))
                     for sign in (1, -1))
        found = low.success and high.success
        ranges.append((float(low.fun), float(-high.fun)) if found else (np.nan, np.nan))
    return tuple(ranges)


def condition(forces: Array) -> float:
    """Divide largest by smallest singular value of the circles' relative differences in force.

    It is 1 for one circle or two.
    """
    differences = forces[:, 1:] / forces[:, :1] - 1
    if differences.shape[1] < 2:
        return 1.0
    values = np.linalg.svd(differences, compute_uv=False)
    return float(values[0] / max(values[-1], np.finfo(float).tiny))
