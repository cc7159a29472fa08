"""Sequential quadratic programming within a trust region, for functions that may have no value.

It maximises f over 0 ≤ x ≤ 1 with c(x) ≤ 0. A step maximises a quadratic model of f within the
trust region, with linear limits and a price on the largest violation (an exact penalty: Nocedal &
Wright, *Numerical Optimization*, 2006, chapter 18). A step that gains too little, or ends where
there is no value, is rejected, and the region shrinks. The model's curvature is that of the
Lagrangian, by damped BFGS. SciPy's trust-constr and SLSQP need a value at every point they try,
but there is none beyond pull-in. SLSQP solves each step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from scipy.optimize import BFGS, LinearConstraint, lsq_linear, minimize

from tympan.base.arrays import Array

#: Distance from 0 below which a limit is active: a search ends slightly before it.
_ACTIVE = 1e-3

DescentStatus = Literal["optimum", "no_progress", "infeasible", "no_start"]


@dataclass(frozen=True, eq=False)
class Linearisation:
    """Values and slopes at a point: f, ∇f (n,), c (m,), ∇c (m, n)."""

    value: float
    slope: Array
    limits: Array
    limit_slopes: Array

    @property
    def violation(self) -> float:
        """Largest c above zero."""
        return max(0.0, float(self.limits.max(initial=0.0)))

    def merit(self, unit: float, price: float) -> float:
        """Compute f over a unit, less the price of the violation."""
        return self.value / unit - price * self.violation


class Objective(Protocol):
    """Objective that is maximised."""

    def at(self, x: Array) -> Linearisation | None:
        """Linearise at a point; None where it has no values."""


@dataclass(frozen=True)
class DescentSettings:
    """Settings of the search; lengths are shares of the bounds.

    ``radius`` is the first radius of the trust region, ``widest`` its largest. The search ends at a
    smaller ``step`` or relative ``gain``. An optimum may have a ``residual`` of multipliers and a
    ``violation``. ``unit`` is the objective's unit for relative gains. If it is None, the unit is
    the value at the start, which then must not be close to 0.
    """

    radius: float = 0.1
    widest: float = 0.3
    step: float = 1e-4
    gain: float = 1e-7
    residual: float = 1e-3
    violation: float = 2e-4
    iterations: int = 60
    unit: float | None = None


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers of limits (m,) and of bounds (n,; upper positive), by c and x.

    ``residual``: the relative part of ∇f that they do not balance.
    """

    limits: Array
    bounds: Array
    residual: float


@dataclass(frozen=True, eq=False)
class Descent:
    """End of a search."""

    status: DescentStatus
    x: Array
    here: Linearisation | None
    multipliers: Multipliers | None


def maximise(objective: Objective, start: Array, settings: DescentSettings = DescentSettings()
             ) -> Descent:
    """Maximise an objective from a start."""
    x = np.clip(start, 0.0, 1.0)
    here = objective.at(x)
    if here is None:
        return Descent("no_start", start, None, None)
    unit = settings.unit or abs(here.value) or 1.0
    radius, price = settings.radius, 10.0
    bend = BFGS("damp_update", min_curvature=0.2, init_scale=1.0)  # Powell's damping
    bend.initialize(len(x), "hess")
    for _ in range(settings.iterations):
        step, promised = _step(x, here, bend.get_matrix(), radius, price, unit)
        if np.abs(step).max() < settings.step or promised < settings.gain:
            break
        ahead = np.clip(x + step, 0.0, 1.0)
        there = objective.at(ahead)
        gained = -np.inf if there is None else there.merit(unit, price) - here.merit(unit, price)
        if there is None or gained <= 0.05 * promised:
            radius = 0.4 * np.abs(step).max()
            continue
        if gained > 0.7 * promised and np.abs(step).max() > 0.9 * radius:
            radius = min(2 * radius, settings.widest)
        multipliers = kkt(ahead, there)
        price = max(price, 3 * float(multipliers.limits.sum()) / unit)
        change = _lagrangian(here, multipliers, unit) - _lagrangian(there, multipliers, unit)
        if change.any():
            bend.update(ahead - x, change)
        x, here = ahead, there
    multipliers = kkt(x, here)
    ended: DescentStatus = "optimum" if multipliers.residual <= settings.residual else "no_progress"
    return Descent(ended if here.violation <= settings.violation else "infeasible", x, here,
                   multipliers)


def kkt(x: Array, here: Linearisation) -> Multipliers:
    """Find the multipliers that best balance ∇f = Σ λ ∇c + bounds, λ ≥ 0 of active limits."""
    slope = here.slope
    at = np.flatnonzero(here.limits > -_ACTIVE)
    low, high = np.flatnonzero(x < 1e-6), np.flatnonzero(x > 1 - 1e-6)
    unit = np.eye(len(x))
    columns = np.column_stack([here.limit_slopes[at].T, -unit[:, low], unit[:, high]])
    solution = (lsq_linear(columns, slope, (0.0, np.inf), method="bvls").x if columns.shape[1]
                else np.zeros(0))
    limits = np.zeros(len(here.limits))
    limits[at] = solution[: len(at)]
    bounds = np.zeros(len(x))
    rest = solution[len(at) :]
    bounds[low], bounds[high] = -rest[: len(low)], rest[len(low) :]
    residual = float(np.abs(columns @ solution - slope).max())
    return Multipliers(limits, bounds, residual / max(float(np.abs(slope).max()), 1e-300))


def _step(x: Array, here: Linearisation, bend: Array, radius: float, price: float, unit: float
          ) -> tuple[Array, float]:
    """Compute the step, and the expected growth of the merit."""
    size, slope = len(x), here.slope / unit

    def cost(z: Array) -> tuple[float, Array]:  # of the step and the remaining violation
        d = z[:size]
        return (float(d @ bend @ d / 2 - slope @ d + price * z[size]),
                np.append(bend @ d - slope, price))

    jacobian = np.column_stack([-here.limit_slopes, np.ones(len(here.limits))])
    constraints = [LinearConstraint(jacobian, here.limits, np.inf)] if len(here.limits) else []
    bounds = [(max(-radius, -at), min(radius, 1 - at)) for at in x]
    minimum = minimize(cost, np.append(np.zeros(size), here.violation), jac=True, method="SLSQP",
                       bounds=[*bounds, (0.0, None)], constraints=constraints,
                       options={"maxiter": 200, "ftol": 1e-14})
    low, high = np.array(bounds).T
    step = np.clip(minimum.x[:size], low, high)
    violation = max(0.0, float((here.limits + here.limit_slopes @ step).max(initial=0.0)))
    promised = price * (here.violation - violation) + float(slope @ step - step @ bend @ step / 2)
    return step, promised


def _lagrangian(here: Linearisation, multipliers: Multipliers, unit: float) -> Array:
    """Compute the slope of f − λ c, over the unit."""
    return (here.slope - multipliers.limits @ here.limit_slopes) / unit
