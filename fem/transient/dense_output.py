"""Interpolation between the moments of a motion: a cubic spline with not-a-knot ends.

For two, three or four moments the spline is their polynomial. A motion that is being computed and a
finished one are therefore interpolated in the same way.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import numpy as np
from scipy.interpolate import CubicSpline

from tympan.base.arrays import AnyArray


def spline(times: Sequence[float] | AnyArray, values: AnyArray) -> CubicSpline:
    """Create the cubic spline of values (first axis) at ascending times; constant for one time."""
    if len(times) == 1:
        return CubicSpline([times[0], times[0] + 1.0], np.repeat(values, 2, axis=0))
    return CubicSpline(times, values)


def weights(times: Sequence[float], when: float) -> list[float]:
    """Compute weights of values at up to four times, for their polynomial at another time.

    Examples
    --------
    >>> weights([0.0, 1.0, 2.0], 1.5)
    [-0.125, 0.75, 0.375]
    """
    return [prod((when - other) / (time - other) for other in times if other != time)
            for time in times]
