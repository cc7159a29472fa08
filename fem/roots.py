"""Roots of a function between two arguments; a missing value is an answer, not an error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]

#: Evaluations after which a search by Brent's method has failed; it needs some ten.
_EVALUATIONS = 200

#: Share of a cubic's largest factor below which a leading one is rounding.
_VANISHING = 1e-14
#: Imaginary part up to which a root is real: a double one is split by rounding.
_REAL = 1e-9


class NoValueHere(LookupError):
    """The function has no value there, so a search cannot go on."""


def root_between(function: Callable[[float], float], low: float, high: float, xtol: float = 2e-12,
                 rtol: float = 1e-13) -> float | None:
    """The argument between two at which a function vanishes, by Brent's method.

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
        ends = finite(low), finite(high)
        if ends[0] * ends[1] > 0:
            return None
        at_ends = {low: ends[0], high: ends[1]}
        root, search = brentq(lambda at: at_ends[at] if at in at_ends else finite(at), low, high,
                              xtol=xtol, rtol=rtol, maxiter=_EVALUATIONS, full_output=True,
                              disp=False)
    except NoValueHere:
        return None
    return float(root) if search.converged else None


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
