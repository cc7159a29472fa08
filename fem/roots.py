"""Roots of a function between two arguments; a missing value is an answer, not an error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tympan.base.arrays import Array

#: Evaluations after which a search has failed; it needs some ten.
_EVALUATIONS = 200

#: Share of a cubic's largest factor below which a leading one is rounding.
_VANISHING = 1e-14
#: Imaginary part up to which a root is real: a double one is split by rounding.
_REAL = 1e-9


class NoValueHere(LookupError):
    """The function has no value there, so a search cannot go on."""


def root_between(function: Callable[[float], float], low: float, high: float, xtol: float = 2e-12,
                 rtol: float = 1e-13) -> float | None:
    """The argument between two at which a function vanishes.

    None where that cannot be found: the function has the same sign at both ends, is not a finite
    number somewhere on the way, or raises :class:`NoValueHere`.

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
    """The root between two points of a function; None where their signs are alike.

    Chandrupatla's rule says when inverse quadratic interpolation is safe (Advances in Engineering
    Software 28, 1997). SciPy has it too, behind a package that takes as long to import as all else
    that an equilibrium needs.
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
    """Roots from 0 to 1, in order, of the cubic of values and slopes at both ends.

    Those ``beside`` an end by no more than this are among them; none where a number is not finite.

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
