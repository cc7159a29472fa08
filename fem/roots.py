"""Where a function vanishes between two arguments; a missing value is an answer, not an error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq

#: Evaluations after which a search by Brent's method has failed; it needs some ten.
_EVALUATIONS = 200


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
