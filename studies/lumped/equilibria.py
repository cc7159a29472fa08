"""Where the lumped model rests: all roots of its balance, their stability, and pull-in."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from tympan.geometry.errors import InputError
from tympan.studies.lumped.actuator import Actuator

Array = NDArray[np.float64]
_GRID = 4001
_TOUCHING = 1e-9  # of the weight: a minimum of |balance| below it is a root the curve touches


@dataclass(frozen=True)
class Root:
    """A deflection at rest [m], the stiffness there [N/m], and whether it is a minimum of the energy."""

    deflection: float
    stiffness: float

    @property
    def stable(self) -> bool:
        """Whether a small push comes back."""
        return self.stiffness > 0


def roots(actuator: Actuator, voltage: float, low: float = 0.0,
          high: float | None = None) -> tuple[Root, ...]:
    """All deflections at rest between two [m], ascending; by default from flat to :attr:`Actuator.reach`.

    Sign changes on a grid of 4001 points and, between them, extrema of the balance refined, so that
    two roots closer than the grid and one where the curve only touches are found too.
    """
    y = np.linspace(low, actuator.reach if high is None else high, _GRID)

    def balance(at: float) -> float:
        return float(actuator.balance(at, voltage)[0])

    values, slopes = actuator.balance(y, voltage)
    knots = {float(y[0]), float(y[-1])} | {float(at) for at in y[np.flatnonzero(values == 0)]}
    knots |= {float(at) for at in y[:-1][values[:-1] * values[1:] < 0]}
    knots |= {float(at) for at in y[1:][values[:-1] * values[1:] < 0]}
    knots |= {_extremum(actuator, voltage, y[i], y[i + 1])
              for i in np.flatnonzero(slopes[:-1] * slopes[1:] < 0)}
    places = sorted(knots)
    found = [at for at in places if abs(balance(at)) <= _TOUCHING * actuator.load]
    for left, right in pairwise(places):
        if balance(left) * balance(right) < 0:
            found.append(float(brentq(balance, left, right, xtol=1e-14, rtol=1e-13)))
    distinct: list[float] = []
    for at in sorted(found):
        if not distinct or at - distinct[-1] > 1e-6 * (y[1] - y[0]):
            distinct.append(at)
    return tuple(Root(at, float(actuator.balance(at, voltage)[1])) for at in distinct)


def rest(actuator: Actuator, voltage: float) -> Root:
    """The first stable rest from the flat film: where the actuator settles when load and voltage are put on slowly.

    Raises
    ------
    InputError
        When there is none: the load or the voltage is beyond pull-in.
    """
    limit = pull_in(actuator)
    if limit is None or abs(float(actuator.rig.film_voltage(voltage))) <= limit[0]:
        for root in roots(actuator, voltage):
            if root.stable:
                return root
    raise InputError(f"has no stable rest: {limit_words(actuator)}", given=f"{voltage / 1e3:g} kV",
                     key=f"{actuator.specimen.name}, {1e3 * actuator.mass:g} g")


def pull_in(actuator: Actuator) -> tuple[float, float] | None:
    """Film voltage [V] and deflection [m] where the rest that begins without voltage ends; None where never.

    The balance is linear in the squared film voltage, so every rest lies on u²(y) = (elastic force
    − weight)/(electric force per V²), and pull-in is its first maximum.
    """
    start = next((root for root in roots(actuator, 0.0) if root.stable), None)
    if start is None:
        return None
    y = np.linspace(start.deflection, actuator.reach, _GRID)
    turning = np.flatnonzero(np.diff(_squared(actuator, y)) < 0)
    if not len(turning):
        return None
    first = max(int(turning[0]), 1)
    top = float(minimize_scalar(lambda at: -float(_squared(actuator, at)), method="bounded",
                                bounds=(y[first - 1], y[first + 1]), options={"xatol": 1e-12}).x)
    return float(np.sqrt(max(float(_squared(actuator, top)), 0.0))), top


def highest(actuator: Actuator) -> float:
    """Film voltage [V] of pull-in, or, of a film without, that which moves it to the end of the model's reach."""
    found = pull_in(actuator)
    return float(np.sqrt(max(float(_squared(actuator, actuator.reach)),
                             0.0))) if found is None else found[0]


def limit_words(actuator: Actuator) -> str:
    """Why there may be no rest, for messages."""
    if not any(root.stable for root in roots(actuator, 0.0)):
        return "the mass is too large without voltage already"
    end = f"the end of the model's reach, {1e3 * actuator.reach:.4g} mm,"
    return f"{end if pull_in(actuator) is None else 'pull-in'} is at {highest(actuator) / 1e3:.5g} kV across the film"


def curve(actuator: Actuator, voltages: Array) -> Array:
    """Deflections at rest [m] at voltages [V], nan beyond pull-in."""
    result = np.full(len(voltages), np.nan)
    for number, voltage in enumerate(voltages):
        result[number] = next((root.deflection for root in roots(actuator, float(voltage))
                               if root.stable), np.nan)
    return result


def _squared(actuator: Actuator, y: Array | float) -> Array:
    """Square of the film voltage that holds deflections [V²]."""
    return np.asarray((actuator.elastic(y)[1] - actuator.load) / -actuator.electric(y)[1])


def _extremum(actuator: Actuator, voltage: float, left: float, right: float) -> float:
    return float(brentq(lambda at: float(actuator.balance(at, voltage)[1]), left, right,
                        xtol=1e-15))
