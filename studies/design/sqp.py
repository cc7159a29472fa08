"""Sequential quadratic programming within a trust region, for functions that may have no value.

Maximises f over 0 ≤ x ≤ 1 with c(x) ≤ 0 and e(x) = 0, e cheap and kept to at every point. A step
maximises a quadratic model of f within the trust region, the limits linear and the largest
violation at a price (an exact penalty: Nocedal & Wright, *Numerical Optimization*, 2006, chapter
18); a step that gains too little, or ends where there is no value, is not made, and the region
shrinks. The model's curvature is that of the Lagrangian, by damped BFGS. SciPy's trust-constr and
SLSQP want a value at every point they try, which past pull-in there is not; SLSQP solves each step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import BFGS, LinearConstraint, lsq_linear, minimize

Array = NDArray[np.float64]

#: A limit nearer to 0 than this is active: a search ends a little before it.
_ACTIVE = 1e-3
#: Most of Newton's steps back to e = 0. A bound: they double the digits each time.
_ROUNDS = 20

Status = Literal["optimum", "no_progress", "infeasible", "no_start"]


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
        """f over a unit, less the price of the violation."""
        return self.value / unit - price * self.violation


class Objective(Protocol):
    """Objective that is maximised."""

    def at(self, x: Array, renew: bool = False) -> Linearisation | None:
        """Values at a point, None where there are none.

        Comparable to those at other points nearby, until it is renewed to look around this one.
        """

    def held(self, x: Array) -> tuple[float, Array]:
        """e and ∇e."""


@dataclass(frozen=True)
class DescentSettings:
    """``radius`` of the trust region at first and ``widest``; lengths are shares of the bounds.

    ``step`` and relative ``gain`` below which it ends; distances from where it was last renewed at
    which the objective is renewed, ``away``, and may end, ``near``; ``rounds``: how often at most
    it settles and is renewed; ``residual`` of multipliers and ``violation`` an optimum may leave.
    """

    radius: float = 0.1
    widest: float = 0.3
    step: float = 1e-4
    gain: float = 1e-7
    away: float = 0.1
    near: float = 0.01
    rounds: int = 3
    residual: float = 1e-3
    violation: float = 2e-4
    iterations: int = 60


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Multipliers of limits (m,), of what is held, of bounds (n,; upper positive), by c, e and x.

    ``residual``: what of ∇f they leave, relative.
    """

    limits: Array
    held: float
    bounds: Array
    residual: float


@dataclass(frozen=True, eq=False)
class Descent:
    """End of a search, with its ``trials`` and points without value (``missing``)."""

    status: Status
    x: Array
    here: Linearisation | None
    multipliers: Multipliers | None
    trials: int
    missing: int


def maximise(objective: Objective, start: Array, settings: DescentSettings = DescentSettings(),
             note: Callable[[bool], None] = lambda accepted: None) -> Descent:
    """Maximise an objective from a start; ``note`` is told of every point if it was gone to."""
    x = restored(objective, start)
    here = None if x is None else objective.at(x, renew=True)
    if x is None or here is None:
        return Descent("no_start", start, None, None, 1, 1)
    note(True)
    unit = abs(here.value) or 1.0
    centre, radius, price = x, settings.radius, 10.0
    bend = BFGS("damp_update", min_curvature=0.2, init_scale=1.0)  # Powell's damping
    bend.initialize(len(x), "hess")
    trials, missing, settled = 1, 0, 0
    for _ in range(settings.iterations):
        step, promised = _step(objective, x, here, bend.get_matrix(), radius, price, unit)
        if np.abs(step).max() < settings.step or promised < settings.gain:
            settled += 1
            if np.abs(x - centre).max() <= settings.near or settled == settings.rounds:
                break
            renewed = objective.at(x, renew=True)
            if renewed is None:
                break
            here, centre, radius = renewed, x, max(radius, settings.radius / 4)
            continue
        ahead = restored(objective, x + step)
        there = None if ahead is None else objective.at(ahead)
        trials += 1
        missing += there is None
        gained = -np.inf if there is None else there.merit(unit, price) - here.merit(unit, price)
        accepted = gained > 0.05 * promised
        if ahead is not None:
            note(accepted)
        if not accepted or ahead is None or there is None:
            radius = 0.4 * np.abs(step).max()
            continue
        if gained > 0.7 * promised and np.abs(step).max() > 0.9 * radius:
            radius = min(2 * radius, settings.widest)
        multipliers = kkt(objective, ahead, there)
        price = max(price, 3 * float(multipliers.limits.sum()) / unit)
        change = (_lagrangian(objective, x, here, multipliers, unit)
                  - _lagrangian(objective, ahead, there, multipliers, unit))
        if change.any():
            bend.update(ahead - x, change)
        x, here = ahead, there
        if np.abs(x - centre).max() > settings.away:
            renewed = objective.at(x, renew=True)
            if renewed is None:
                break
            here, centre = renewed, x
    multipliers = kkt(objective, x, here)
    ended: Status = "optimum" if multipliers.residual <= settings.residual else "no_progress"
    return Descent(ended if here.violation <= settings.violation else "infeasible", x, here,
                   multipliers, trials, missing)


def kkt(objective: Objective, x: Array, here: Linearisation) -> Multipliers:
    """Multipliers that balance ∇f = Σ λ ∇c + μ ∇e + bounds best, λ of active limits positive."""
    slope, kept = here.slope, objective.held(x)[1]
    at = np.flatnonzero(here.limits > -_ACTIVE)
    low, high = np.flatnonzero(x < 1e-6), np.flatnonzero(x > 1 - 1e-6)
    unit = np.eye(len(x))
    columns = np.column_stack([here.limit_slopes[at].T, kept, -unit[:, low], unit[:, high]])
    free = np.zeros(columns.shape[1])
    free[len(at)] = -np.inf
    solution = lsq_linear(columns, slope, (free, np.full(len(free), np.inf)), method="bvls").x
    limits = np.zeros(len(here.limits))
    limits[at] = solution[: len(at)]
    bounds = np.zeros(len(x))
    rest = solution[len(at) + 1 :]
    bounds[low], bounds[high] = -rest[: len(low)], rest[len(low) :]
    residual = float(np.abs(columns @ solution - slope).max())
    return Multipliers(limits, float(solution[len(at)]), bounds,
                       residual / max(float(np.abs(slope).max()), 1e-300))


def restored(objective: Objective, x: Array) -> Array | None:
    """The nearest point within the bounds that keeps e = 0, by Newton steps, None without one."""
    x = np.clip(x, 0.0, 1.0)
    for _ in range(_ROUNDS):
        miss, slope = objective.held(x)
        if abs(miss) < 1e-12:
            return x
        towards = -np.sign(miss) * slope
        free = np.where(((x <= 0) & (towards < 0)) | ((x >= 1) & (towards > 0)), 0.0, slope)
        if not free.any():
            return None
        x = np.clip(x - miss * free / (free @ free), 0.0, 1.0)
    return None


def _step(objective: Objective, x: Array, here: Linearisation, bend: Array, radius: float,
          price: float, unit: float) -> tuple[Array, float]:
    """The step and by how much the merit should grow."""
    size, slope, kept = len(x), here.slope / unit, objective.held(x)[1]

    def cost(z: Array) -> tuple[float, Array]:  # of the step and the violation it leaves
        d = z[:size]
        return (float(d @ bend @ d / 2 - slope @ d + price * z[size]),
                np.append(bend @ d - slope, price))

    jacobian = np.column_stack([-here.limit_slopes, np.ones(len(here.limits))])
    constraints = [LinearConstraint(np.append(kept, 0.0), 0.0, 0.0)] if kept.any() else []
    if len(here.limits):
        constraints.append(LinearConstraint(jacobian, here.limits, np.inf))
    bounds = [(max(-radius, -at), min(radius, 1 - at)) for at in x]
    minimum = minimize(cost, np.append(np.zeros(size), here.violation), jac=True, method="SLSQP",
                       bounds=[*bounds, (0.0, None)], constraints=constraints,
                       options={"maxiter": 200, "ftol": 1e-14})
    low, high = np.array(bounds).T
    step = np.clip(minimum.x[:size], low, high)
    violation = max(0.0, float((here.limits + here.limit_slopes @ step).max(initial=0.0)))
    promised = price * (here.violation - violation) + float(slope @ step - step @ bend @ step / 2)
    return step, promised


def _lagrangian(objective: Objective, x: Array, here: Linearisation, multipliers: Multipliers,
                unit: float) -> Array:
    """Slope of f − λ c − μ e over the unit."""
    kept = multipliers.held * objective.held(x)[1]
    return (here.slope - multipliers.limits @ here.limit_slopes - kept) / unit
