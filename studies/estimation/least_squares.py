"""Bounded least squares: a problem of residuals and derivatives, and the search.

The search is Levenberg's and Marquardt's (J. Soc. Indust. Appl. Math. 11, 431, 1963); unknowns that
press against a bound are held. SciPy's ``least_squares`` takes a third to a half more time for
problems like these and, except for ``dogbox``, does not end on a bound.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import qmc

from tympan.base.arrays import Array, Mask
from tympan.base.errors import InputError
from tympan.base.process.interruption import signals_wait

#: First of Marquardt's dampings, over the scaled curvature: almost none.
_FIRST = 1e-4
#: Least damping above 0. With less, a step equals an undamped one.
_LEAST = 1e-10
#: Largest damping tried. With more, a step moves nothing.
_MOST = 1e8
#: Damping of an undamped step where the curvature is singular: some rounding errors of it.
_TINY = 1e-14

#: Length of a refused step, in standard deviations, that ends a search.
_SHORT = 1e-4


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A problem evaluated at some unknowns.

    ``residual`` has the shape (n,), in units of a reading's standard deviation, nan where the model
    has no value. ``slopes`` computes its derivative by the unknowns, shape (n, p). ``state`` may be
    the start of an evaluation nearby.
    """

    residual: Array
    slopes: Callable[[], Array]
    state: Any = None

    @property
    def squares(self) -> float:
        """χ², nan where the model has no value."""
        return float(self.residual @ self.residual)

    @cached_property
    def jacobian(self) -> Array:
        """Derivative of the residuals, computed when first needed."""
        return self.slopes()


Evaluate = Callable[[Array, Evaluation | None], Evaluation]


def no_prior(unknowns: Array) -> tuple[Array, Array]:
    """Compute residuals and slopes of no prior: nothing is known of the unknowns."""
    return np.zeros(len(unknowns)), np.zeros(len(unknowns))


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Residuals as a function of unknowns, shape (p,), within bounds ``low`` and ``high``.

    ``evaluate(unknowns, near)`` may begin with the state of a point nearby. ``linear`` are the
    unknowns in which residuals are linear: a search finds them by linear least squares. ``prior``
    computes a residual for each unknown, shape (p,), half of whose square is minus the logarithm of
    the prior density, and its derivative. The cost is half the sum of χ² and the priors' squares.
    """

    evaluate: Evaluate
    low: Array
    high: Array
    linear: tuple[int, ...] = ()
    prior: Callable[[Array], tuple[Array, Array]] = no_prior

    @classmethod
    def of(cls, both: Callable[[Array], tuple[Array, Array]], low: Array, high: Array,
           linear: tuple[int, ...] = ()) -> LeastSquares:
        """Make a problem of a function that computes residuals and their derivative together."""
        def evaluate(unknowns: Array, near: Evaluation | None) -> Evaluation:
            residual, slopes = both(unknowns)
            return Evaluation(residual, lambda: slopes)

        return cls(evaluate, low, high, linear)

    def at(self, unknowns: Array) -> Evaluation:
        """Evaluate residuals and derivatives at some unknowns."""
        return self.evaluate(unknowns, None)

    def cost(self, unknowns: Array, point: Evaluation) -> float:
        """Compute minus the logarithm of posterior density; inf where the model has no value."""
        cost = 0.5 * (point.squares + float(np.sum(self.prior(unknowns)[0] ** 2)))
        return cost if np.isfinite(cost) else np.inf

    def slope(self, unknowns: Array, point: Evaluation) -> Array:
        """Differentiate the cost, shape (p,)."""
        rows, slopes = self.prior(unknowns)
        return point.jacobian.T @ point.residual + rows * slopes

    def curvature(self, unknowns: Array, point: Evaluation) -> Array:
        """Compute the second derivative of the cost for linearised residuals, shape (p, p)."""
        _, slopes = self.prior(unknowns)
        return point.jacobian.T @ point.jacobian + np.diag(slopes**2)

    def with_rows(self, rows: Array, centre: Array) -> LeastSquares:
        """Add residuals ``rows`` (z − ``centre``), such as priors or combinations to hold."""
        def evaluate(unknowns: Array, near: Evaluation | None) -> Evaluation:
            point = self.evaluate(unknowns, near)
            return Evaluation(np.concatenate([point.residual, rows @ (unknowns - centre)]),
                              lambda: np.concatenate([point.jacobian, rows]), point.state)

        return replace(self, evaluate=evaluate)


@dataclass(frozen=True, eq=False)
class Minimum:
    """End of a search, with the number of its evaluations."""

    unknowns: Array
    point: Evaluation
    cost: float
    evaluations: int


def minimise(problem: LeastSquares, start: Array, fixed: Mask | None = None,
             precision: float = 1e-12, exact: float = 0.0, quick: float | None = None,
             iterations: int = 100) -> Minimum:
    """Find the nearest minimum over the unknowns that are not ``fixed``.

    The search ends where derivatives predict that the cost falls by no more than the share
    ``precision`` of it, or than ``exact``. A ``quick`` search, for many rough ones, is damped from
    the first step and ends when a step lowers the cost by less than this, even if unknowns with
    little effect have not moved yet. An :class:`InputError` says that the model has no value where
    the search begins.
    """
    fixed = np.zeros(len(start), bool) if fixed is None else fixed
    separable = np.isin(np.arange(len(start)), problem.linear) & ~fixed
    if separable.any():
        problem, fixed = _separated(problem, separable), fixed | separable
    unknowns = np.clip(start, problem.low, problem.high)
    point, evaluations = problem.at(unknowns), 1
    cost = problem.cost(unknowns, point)
    if not np.isfinite(cost):
        raise InputError("the film does not hold with the constants the search begins at",
                         key="constants")
    damping = 0.0 if quick is None else _FIRST
    for _ in range(iterations):
        slope = problem.slope(unknowns, point)
        free = ~(fixed | ((unknowns <= problem.low) & (slope > 0))
                 | ((unknowns >= problem.high) & (slope < 0)))
        if not free.any() or damping > _MOST:
            break
        curvature = problem.curvature(unknowns, point)
        inner = curvature[np.ix_(free, free)]
        step = np.zeros(len(unknowns))
        if quick is None:
            step[free] = -_damped(inner, slope[free], 0.0)
            if -0.5 * float(slope @ step) <= max(precision * cost, exact):
                break
        if damping > 0:
            step[free] = -_damped(inner, slope[free], damping)
        trial = np.clip(unknowns + step, problem.low, problem.high)
        after = problem.evaluate(trial, point)
        reached, evaluations = problem.cost(trial, after), evaluations + 1
        if reached <= cost:
            lowered = cost - reached
            unknowns, point, cost = trial, after, reached
            damping = max(damping / 10, _LEAST) if damping > 0 else 0.0
            if quick is not None and lowered < quick:
                break
        elif step @ curvature @ step < _SHORT**2:
            break
        else:
            damping = 10 * damping or _FIRST
    if separable.any():
        unknowns, point = point.state
    return Minimum(unknowns, point, cost, evaluations)


def _damped(curvature: Array, slope: Array, damping: float) -> Array:
    diagonal = np.diag(curvature)
    diagonal = np.where(diagonal > 0, diagonal, 1.0)
    damped = curvature + max(damping, _TINY) * np.diag(diagonal)
    return np.asarray(np.linalg.solve(damped, slope), float)


def _separated(problem: LeastSquares, linear: Mask) -> LeastSquares:
    """Reduce a problem to the other unknowns, with the ``linear`` ones at their best.

    The method is variable projection with Kaufman's derivative (BIT 15, 49, 1975). A point's state
    is the full unknowns, and the problem's point there.
    """
    def evaluate(unknowns: Array, near: Evaluation | None) -> Evaluation:
        full = unknowns.copy()
        begun = problem.at(full)
        columns = begun.jacobian[:, linear]
        step = -np.linalg.lstsq(columns, begun.residual, rcond=None)[0]
        full[linear] += step
        point = Evaluation(begun.residual + columns @ step, lambda: problem.at(full).jacobian)

        def slopes() -> Array:
            basis = np.linalg.qr(point.jacobian[:, linear])[0]
            slopes = point.jacobian - basis @ (basis.T @ point.jacobian)
            slopes[:, linear] = 0.0
            return slopes

        return Evaluation(point.residual, slopes, (full, point))

    return LeastSquares(evaluate, problem.low, problem.high)


def minima(problem: LeastSquares, starts: Array) -> list[Array]:
    """Find local minima from the starts, shape (k, p), best first."""
    ends = [minimise(problem, start) for start in starts]
    return [end.unknowns for end in sorted(ends, key=lambda end: end.cost)]


def seeded_starts(low: float, high: float, dimension: int, count: int) -> Array:
    """Spread starts well, the same every time, shape (count, dimension)."""
    if dimension == 0:
        return np.empty((1, 0))
    with signals_wait():  # scipy's draws must not be interrupted half way
        drawn = qmc.LatinHypercube(dimension, seed=20).random(count)
    return np.asarray(low + (high - low) * drawn)
