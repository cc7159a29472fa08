"""Equilibria of the lumped model: all roots of its balance, and pull-in."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from tympan.base.arrays import Array
from tympan.base.errors import VoltageError
from tympan.fem.roots import root_between
from tympan.studies.lumped.actuator import Actuator

LumpedBalance = Callable[[Any], tuple[Any, Any]]
#: Points of the grid of deflections.
_GRID = 4001
#: Tolerance of a root that the curve only touches, over the load: largest minimum of |balance|.
_TOUCHING = 1e-9
#: Most steps of Newton's method.
_ROUNDS = 60


def roots(actuator: Actuator, voltage: float, way: float = 1.0) -> tuple[Array, Array]:
    """Find all deflections at rest [m] from flat to the model's reach, and the stiffness [N/m].

    The roots are ordered outwards. A root of positive stiffness is stable. Extrema of the balance
    are refined, to also find two roots closer than the grid, and a root where the curve only
    touches. ``way`` -1 finds the roots of a plate that a mechanism lifts.
    """
    y = np.linspace(0.0, _end(actuator, way), _GRID)

    def balance(at: float) -> float:
        return float(actuator.balance(at, voltage)[0])

    def stiffness(at: float) -> float:
        return float(actuator.balance(at, voltage)[1])

    values, slopes = actuator.balance(y, voltage)
    turning = np.flatnonzero(slopes[:-1] * slopes[1:] < 0)
    crossing = values[:-1] * values[1:] < 0
    turns = [root_between(stiffness, y[i], y[i + 1], xtol=1e-15) for i in turning]
    places = np.unique([
        y[0], y[-1], *y[values == 0], *y[:-1][crossing], *y[1:][crossing],
        *(turn for turn in turns if turn is not None)]).tolist()
    near = _TOUCHING * max(abs(actuator.load), abs(balance(0.0)))
    zeros = [at for at in places if abs(balance(at)) <= near]
    for low, high in pairwise(places):
        zero = root_between(balance, low, high, xtol=1e-14)
        if zero is not None and balance(low) * balance(high) < 0:
            zeros.append(zero)
    distinct: list[float] = []
    for at in sorted(zeros, key=abs):
        if not distinct or abs(at - distinct[-1]) > 1e-6 * abs(y[1] - y[0]):
            distinct.append(at)
    return np.array(distinct), np.array([stiffness(at) for at in distinct])


def _end(actuator: Actuator, way: float) -> float:
    """Find the deflection at the end of the model's reach on a way [m]."""
    return actuator.reach if way > 0 else actuator.lowest


def settle(balance: LumpedBalance, start: Any = 0.0, farthest: Any = None) -> Any:
    """Find deflections at rest [m] by Newton's method, of any shape the balance has.

    ``balance`` computes force less weight [N] and its derivative [N/m] at deflections. From the
    flat film Newton's method climbs to the first rest without passing it if the balance is concave,
    as the balance of the paper's cones is up to pull-in. The result is nan where a step meets no
    stiffness or the steps do not converge. With ``farthest`` [m] steps are limited to this length,
    and need no stiffness.
    """
    y: Any = np.asarray(start, float)
    with np.errstate(all="ignore"):
        for _ in range(_ROUNDS):
            force, stiffness = balance(y)
            move = -force / stiffness
            move = np.where(stiffness > 0, move, np.nan) if farthest is None \
                else np.clip(move, -farthest, farthest)
            y = y + move
            if not (np.abs(move) > 1e-13).any():
                break
    return y if farthest is not None else np.where(np.abs(move) <= 1e-12, y, np.nan)


def rest_curve(actuator: Actuator, voltages: Any) -> Array:
    """Find an actuator's deflections at rest [m] at slowly raised voltages [V]; nan past pull-in.

    Beyond a limit point that a mechanism of the rig causes, the plate rests where it snaps to.
    """
    squared = np.asarray(actuator.rig.film_voltage(np.asarray(voltages, float))) ** 2
    start, limit = _start(actuator), pull_in(actuator)
    if start is None:
        return np.full(squared.shape, np.nan)
    y = _outwards(actuator, start, None if limit is None else limit[1])
    holding = np.maximum.accumulate(np.append(0.0, squared_at(actuator, y[1:])))
    below = np.searchsorted(holding, squared, "right") - 1
    inside = squared <= (holding[-1] if limit is None else limit[0] ** 2)
    # Newton's method starts at the grid's point next below the rest, and climbs to the rest.
    settled = settle(lambda at: actuator.balance(at, voltages), y[np.clip(below, 0, len(y) - 2)])
    return np.where(inside, settled, np.nan)


def rest(actuator: Actuator, voltage: float) -> float:
    """Find the deflection [m] of one actuator when load and voltage are applied slowly.

    Beyond pull-in there is no rest: a VoltageError.
    """
    y = float(rest_curve(actuator, voltage))
    if np.isnan(y):
        reason = f"has no stable rest: {limit_words(actuator)}"
        raise VoltageError(actuator.case(voltage).doubted(reason),
                           given=f"{voltage / 1e3:g} kV", key=actuator.label)
    return y


@lru_cache(maxsize=32)
def _start(actuator: Actuator) -> float | None:
    """Find the deflection [m] at which the plate rests without voltage, from the flat film on."""
    way = -1.0 if actuator.balance(0.0, 0.0)[0] > 0 else 1.0
    places, stiffness = roots(actuator, 0.0, way)
    return next(iter(places[stiffness > 0].tolist()), None)


def _outwards(actuator: Actuator, start: float, end: float | None = None) -> Array:
    """Space deflections [m] from the rest without voltage on, as the voltage moves the plate."""
    return np.linspace(start, _end(actuator, start or 1.0) if end is None else end, _GRID)


@lru_cache(maxsize=32)
def pull_in(actuator: Actuator) -> tuple[float, float] | None:
    """Find film voltage [V] and deflection [m] at which the rest from 0 V on ends, or None.

    The balance is linear in the squared film voltage, so every rest lies on u²(y) = (elastic force
    − weight)/(electric force per V²), :func:`squared_at`, and pull-in is its first maximum. Where
    a mechanism of the rig softens further out, the plate snaps to the next rest if there is one.
    """
    start = _start(actuator)
    if start is None:
        return None
    y = _outwards(actuator, start)
    held = squared_at(actuator, y)
    way = np.sign(y[-1] - y[0])
    soft = max((way * mark for interval in actuator.rig.loading.softening for mark in interval),
               default=-np.inf)
    first = 0
    while True:
        turning = first + np.flatnonzero(np.diff(held[first:]) < 0)
        if not len(turning):
            return None
        top = max(int(turning[0]), 1)
        further = np.flatnonzero(held[top + 1:] > held[top])
        if way * y[top] >= soft or not len(further):
            break
        first = top + 1 + int(further[0])
    near = sorted((y[top - 1], y[min(top + 1, len(y) - 1)]))
    top_y = float(minimize_scalar(lambda at: -float(squared_at(actuator, at)), method="bounded",
                                  bounds=near, options={"xatol": 1e-12}).x)
    return float(np.sqrt(max(float(squared_at(actuator, top_y)), 0.0))), top_y


def highest(actuator: Actuator) -> float:
    """Find the film voltage [V] of pull-in, or without pull-in that of the end of the reach."""
    limit, start = pull_in(actuator), _start(actuator)
    if limit is not None:
        return limit[0]
    end = _end(actuator, start or 1.0)
    return float(np.sqrt(max(float(squared_at(actuator, end)), 0.0)))


def limit_words(actuator: Actuator) -> str:
    """Word the reason why there is no rest."""
    if _start(actuator) is None:
        return "the mass is too large without voltage already"
    end = "pull-in"
    if pull_in(actuator) is None:
        reach = _end(actuator, _start(actuator) or 1.0)
        end = f"the end of the model's reach, {1e3 * reach:.4g} mm,"
    return f"{end} is at {highest(actuator) / 1e3:.5g} kV across the film"


def squared_at(actuator: Actuator, y: Array | float, strains: Any = None) -> Array:
    """Compute U² across the film [V²] that holds deflections [m], as in `Actuator.balance`."""
    force = actuator.balance(y, 0.0, strains)[0]
    return np.asarray(force / -actuator.electric(y)[1])
