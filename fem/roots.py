"""Roots of a function between two arguments; a missing value gives None instead of an error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tympan.base.arrays import Array

#: Largest number of evaluations of a search; usually some ten are enough.
_EVALUATIONS = 200

#: Leading coefficient that counts as rounding, relative to a cubic's largest coefficient.
_VANISHING = 1e-14
#: Largest imaginary part of a real root: rounding splits a double root.
_REAL = 1e-9


class NoValueHere(LookupError):
    """Error: the function has no value at an argument, so a search cannot continue."""


def root_between(function: Callable[[float], float], low: float, high: float, xtol: float = 2e-12,
                 rtol: float = 1e-13) -> float | None:
    """Find the argument between two at which a function vanishes.

    None if it cannot be found: the function has the same sign at both ends, is not finite somewhere
    on the way, or raises :class:`NoValueHere`.

    Examples
    --------
    >>> root_between(lambda x: x * x - 2.0, 0.0, 2.0)
    1.41421356...
    >>> root_between(lambda x: float("nan"), 0.0, 2.0) is None
    True
    """
    def finite(at: float) -> float:
        value = float(function(at))
        if not np.isfinite(value):
            raise NoValueHere
        return value

    try:
        return _narrowed(finite, (low, finite(low)), (high, finite(high)), xtol, rtol)
    except NoValueHere:
        return None


def _narrowed(function: Callable[[float], float], first: tuple[float, float],
              second: tuple[float, float], xtol: float, rtol: float) -> float | None:
    """Find the root between two points of a function; None if their signs are equal.

    Chandrupatla's rule decides where inverse quadratic interpolation is safe (Advances in
    Engineering Software 28, 1997). SciPy contains the method too, but the import of its package
    takes as long as all other imports for an equilibrium.
    """
    (a, at_a), (b, at_b) = first, second
    if not at_a or not at_b:
        return b if at_a else a
    if (at_a > 0) == (at_b > 0):
        return None
    share = 0.5
    for _ in range(_EVALUATIONS):
        x = a + share * (b - a)
        value = function(x)
        if (value > 0) == (at_a > 0):
            c, at_c = a, at_a
        else:
            (b, at_b), (c, at_c) = (a, at_a), (b, at_b)
        a, at_a = x, value
        best, least = (a, at_a) if abs(at_a) < abs(at_b) else (b, at_b)
        shortest = (xtol + rtol * abs(best)) / abs(b - a)
        if not least or shortest > 0.5:
            return float(best)
        xi, phi = (a - b) / (c - b), (at_a - at_b) / (at_c - at_b)
        share = 0.5
        if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
            share = (at_a / (at_b - at_a) * at_c / (at_b - at_c)
                     + (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b))
        share = min(max(share, shortest), 1 - shortest)
    return None


def cubic_roots(values: Array, slopes: Array, beside: float = 0.0) -> list[float]:
    """Find the roots from 0 to 1, in order, of the cubic with values and slopes at both ends.

    Roots outside by at most ``beside`` are included. The list is empty if a number is not finite.

    Examples
    --------
    >>> cubic_roots(np.array([-1.0, 1.0]), np.array([2.0, 2.0]))
    [0.5]
    """
    if not np.isfinite([*values, *slopes]).all():
        return []
    change = values[1] - values[0]
    factors = [slopes[0] + slopes[1] - 2 * change, 3 * change - 2 * slopes[0] - slopes[1],
               slopes[0], values[0]]
    scale = max(map(abs, factors)) or 1.0
    leading = next((number for number, factor in enumerate(factors)
                    if abs(factor) > _VANISHING * scale), len(factors))
    roots = np.roots(factors[leading:])
    real = roots.real[np.abs(roots.imag) <= _REAL]
    return sorted(real[(real >= -beside) & (real <= 1 + beside)].tolist())
