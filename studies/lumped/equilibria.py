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
_GRID = 4001
_TOUCHING = 1e-9  # of the weight: a minimum of |balance| below it is a root the curve touches
_ROUNDS = 60


def roots(actuator: Actuator, voltage: float, way: float = 1.0) -> tuple[Array, Array]:
    """All deflections at rest [m] from flat to its reach, outwards, and the stiffness there [N/m].

    A rest of positive stiffness is stable. Extrema of the balance are refined, so that two roots
    closer than the grid and one where the curve only touches are seen too. ``way`` -1: those of a
    plate that a mechanism lifts.
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
    """Deflection at the end of the model's reach on a way [m]."""
    return actuator.reach if way > 0 else actuator.lowest


def settle(balance: LumpedBalance, start: Any = 0.0, farthest: Any = None) -> Any:
    """Deflections at rest [m] by Newton's method, of any shape the balance has.

    ``balance`` answers force less weight [N] and its derivative [N/m] at deflections. From the flat
    film it climbs to the first rest without passing it as long as the balance is concave, as that
    of the paper's cones is up to pull-in; nan where a step meets no stiffness or there is no end of
    them. With ``farthest`` no step is longer [m], and none asks for stiffness.
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
    """Deflections at rest [m] of one actuator at voltages [V] put on slowly; nan beyond pull-in.

    Beyond a limit point that a mechanism of the rig makes, the plate is at rest where it snaps to.
    """
    squared = np.asarray(actuator.rig.film_voltage(np.asarray(voltages, float))) ** 2
    start, limit = _start(actuator), pull_in(actuator)
    if start is None:
        return np.full(squared.shape, np.nan)
    y = _outwards(actuator, start, None if limit is None else limit[1])
    holding = np.maximum.accumulate(np.append(0.0, squared_at(actuator, y[1:])))
    below = np.searchsorted(holding, squared, "right") - 1
    inside = squared <= (holding[-1] if limit is None else limit[0] ** 2)
    # Below the rest and near it, from where Newton's method climbs to it.
    settled = settle(lambda at: actuator.balance(at, voltages), y[np.clip(below, 0, len(y) - 2)])
    return np.where(inside, settled, np.nan)


def rest(actuator: Actuator, voltage: float) -> float:
    """Deflection where one actuator settles [m] when load and voltage are put on slowly.

    Beyond pull-in that is nowhere, a VoltageError.
    """
    y = float(rest_curve(actuator, voltage))
    if np.isnan(y):
        reason = f"has no stable rest: {limit_words(actuator)}"
        raise VoltageError(actuator.case(voltage).doubted(reason),
                           given=f"{voltage / 1e3:g} kV", key=actuator.label)
    return y


@lru_cache(maxsize=32)
def _start(actuator: Actuator) -> float | None:
    """Deflection [m] at which the plate comes to rest without voltage, from the flat film on."""
    way = -1.0 if actuator.balance(0.0, 0.0)[0] > 0 else 1.0
    places, stiffness = roots(actuator, 0.0, way)
    return next(iter(places[stiffness > 0].tolist()), None)


def _outwards(actuator: Actuator, start: float, end: float | None = None) -> Array:
    """Deflections [m] from the rest without voltage on, as the voltage moves the plate."""
    return np.linspace(start, _end(actuator, start or 1.0) if end is None else end, _GRID)


@lru_cache(maxsize=32)
def pull_in(actuator: Actuator) -> tuple[float, float] | None:
    """Film voltage [V] and deflection [m] where the rest that begins without voltage ends, or None.

    The balance is linear in the squared film voltage, so every rest lies on u²(y) = (elastic force
    − weight)/(electric force per V²), :func:`squared_at`, and pull-in is its first maximum. Where
    a mechanism of the rig softens further out, the plate snaps on to the next rest if there is one.
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
    """Film voltage [V] of pull-in, or, without, that which moves it to the end of its reach."""
    limit, start = pull_in(actuator), _start(actuator)
    if limit is not None:
        return limit[0]
    end = _end(actuator, start or 1.0)
    return float(np.sqrt(max(float(squared_at(actuator, end)), 0.0)))


def limit_words(actuator: Actuator) -> str:
    """Why there may be no rest."""
    if _start(actuator) is None:
        return "the mass is too large without voltage already"
    end = "pull-in"
    if pull_in(actuator) is None:
        reach = _end(actuator, _start(actuator) or 1.0)
        end = f"the end of the model's reach, {1e3 * reach:.4g} mm,"
    return f"{end} is at {highest(actuator) / 1e3:.5g} kV across the film"


def squared_at(actuator: Actuator, y: Array | float, strains: Any = None) -> Array:
    """U² across the film [V²] at which deflections [m] are at rest, as in `Actuator.balance`."""
    force = actuator.balance(y, 0.0, strains)[0]
    return np.asarray(force / -actuator.electric(y)[1])
