"""Least squares with bounds: search from many starts, covariance, and 95 % intervals by profiles of the residual."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, least_squares
from scipy.stats import norm, qmc, t

from tympan.studies.material.families import Family

Array = NDArray[Any]
Interval = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Problem:
    """Readings of nominal stress [Pa] at (λ₁, λ₂) and the family to fit; constants lie within ``bounds``, (2, p)."""

    family: Family
    l1: Array
    l2: Array
    stress: Array
    bounds: Array

    @property
    def scale(self) -> float:
        """Size of the readings [Pa]."""
        return float(np.sqrt(np.mean(self.stress**2))) or 1.0

    def residual(self, values: Array) -> Array:
        """Predicted minus read stress [Pa]."""
        return self.family.stress(self.l1, self.l2, values) - self.stress

    def squares(self, values: Array) -> float:
        """Sum of squares [Pa²]."""
        return float(np.sum(self.residual(values) ** 2))

    def descend(self, start: Array, free: Array) -> Array:
        """The nearest minimum over the free constants, the others held.

        Variable projection: for given shape constants the free linear ones follow from linear least
        squares, so the search runs over the free shape constants alone, with Kaufman's Jacobian
        (BIT 15, 49, 1975).
        """
        split = len(self.family.linear)
        linear, shape = np.flatnonzero(free[:split]), split + np.flatnonzero(free[split:])

        def full(part: Array) -> tuple[Array, Array]:
            values = start.copy()
            values[shape] = part
            columns = self.family.columns(self.l1, self.l2, values[split:])
            held = np.delete(columns, linear, axis=1) @ np.delete(values[:split], linear)
            values[linear] = np.linalg.lstsq(columns[:, linear], self.stress - held, rcond=None)[0]
            return values, columns[:, linear]

        def slopes(part: Array) -> Array:
            values, columns = full(part)
            moved = self.family.jacobian(self.l1, self.l2, values)[:, shape] / self.scale
            basis = np.linalg.qr(columns)[0]
            return moved - basis @ (basis.T @ moved)

        if not len(shape):
            return full(start[shape])[0]
        found = least_squares(lambda part: self.residual(full(part)[0]) / self.scale,
                              np.clip(start[shape], *self.bounds[:, shape]), slopes,
                              self.bounds[:, shape],
                              x_scale="jac", max_nfev=200, xtol=1e-10, ftol=1e-12, gtol=1e-12)
        return full(found.x)[0]


def minima(problem: Problem, starts: Array) -> list[Array]:
    """Local minima from the starts, shape (k, shape constants), best first."""
    free = np.ones(len(problem.family.constants), bool)
    held = np.zeros(len(problem.family.linear))
    found = [problem.descend(np.concatenate([held, start]), free) for start in starts]
    return sorted(found, key=problem.squares)


def seeded_starts(low: float, high: float, dimension: int, count: int) -> Array:
    """Well-spread starts, the same every time, shape (count, dimension)."""
    if dimension == 0:
        return np.empty((1, 0))
    return low + (high - low) * qmc.LatinHypercube(dimension, seed=20).random(count)


@dataclass(frozen=True)
class Noise:
    """Standard deviation of one reading [Pa], and the quantile that makes 95 % intervals of it.

    Given, the quantile is the normal one; estimated from the residuals, Student's with their
    degrees of freedom.
    """

    sigma: float
    quantile: float

    @classmethod
    def of(cls, squares: float, freedom: int, given: float | None) -> Noise:
        """Estimated from the sum of squares unless given."""
        if given is not None:
            return cls(given, float(norm.ppf(0.975)))
        return cls((squares / freedom) ** 0.5, float(t.ppf(0.975, freedom)))


def covariance(problem: Problem, values: Array, sigma: float) -> Array:
    """Linearised covariance of the constants; inf on the diagonal where the readings do not see a constant at all."""
    jacobian = problem.family.jacobian(problem.l1, problem.l2, values)
    lengths = np.linalg.norm(jacobian, axis=0)
    safe = np.where(lengths > 0, lengths, 1.0)
    _, singular, right = np.linalg.svd(jacobian / safe, full_matrices=False)
    kept = singular > 1e-10 * singular[0]
    unit = (right[kept].T / singular[kept] ** 2) @ right[kept]
    result = sigma**2 * unit / np.outer(safe, safe)
    unseen = (np.abs(right[~kept]) > 1e-6).any(axis=0) | (lengths == 0)
    result[np.diag_indices_from(result)] = np.where(unseen, np.inf, np.diag(result))
    return result


def intervals(problem: Problem, values: Array, spread: Array, noise: Noise) -> list[Interval]:
    """95 % limits of every constant, None where the readings set none.

    Where stress is linear in all constants, value ± quantile · standard deviation, which is exact
    for normal noise; otherwise profiles: the other constants are fitted again at each value of one,
    and the limit is where the sum of squares has grown by (quantile · σ)² (Bates and Watts,
    *Nonlinear Regression Analysis*, 1988, §6.1).
    """
    if not problem.family.shape:
        halves = noise.quantile * spread
        return [(float(value - half), float(value + half)) if np.isfinite(half) else (None, None)
                for value, half in zip(values, halves, strict=True)]
    return [(_limit(problem, values, index, -step, noise),
             _limit(problem, values, index, step, noise))
            for index, step in enumerate(spread)]


def _limit(problem: Problem, best: Array, index: int, step: float, noise: Noise) -> float | None:
    """Where one constant's profile reaches the limit on the side of ``step``."""
    floor = (1e-9 * problem.scale) ** 2 * len(problem.stress)
    target = problem.squares(best) + max((noise.quantile * noise.sigma) ** 2, floor)
    end = problem.bounds[int(step > 0), index]
    profile = _profile(problem, best, index, target)
    # Where linearisation says nothing, the search outward starts with a tenth of the constant.
    size = min(noise.quantile * abs(step), 0.1 * abs(best[index])) or 1e-3
    inside = float(best[index])
    for growth in 2.0 ** np.arange(12):
        outside = float(best[index] + np.sign(step) * size * growth)
        beyond = (outside - end) * np.sign(step) >= 0
        outside = float(end) if beyond else outside
        if profile(outside) > 0:
            if profile(inside) > 0:  # another minimum took over: the nearer limit is the safe one to have passed
                return inside
            return float(brentq(profile, inside, outside, xtol=1e-3 * abs(outside - inside),
                                rtol=1e-6))
        if beyond:
            return None
        inside = outside
    return None


def _profile(problem: Problem, best: Array, index: int, target: float) -> Callable[[float], float]:
    """Least sum of squares with one constant held, minus a target; each search starts where the last one ended."""
    free = np.arange(len(best)) != index
    last = [best]

    @cache
    def profile(value: float) -> float:
        start = last[0].copy()
        start[index] = value
        last[0] = problem.descend(start, free)
        return problem.squares(last[0]) - target

    return profile
