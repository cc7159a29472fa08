"""Derivatives by the complex step, exact to rounding for code that works with complex numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

#: An imaginary step so small that its square is lost beside any number, and far above underflow.
STEP = 1e-40


def complex_step(function: Callable[[Any], Any], at: Any, direction: Any = 1.0) -> Any:
    """Derivative of an analytic function of a number or array along a direction.

    Im f(x + ih)/h = f′(x) + O(h²), and nothing is subtracted that could cancel (Squire & Trapp,
    SIAM Rev. 40, 1998).

    Examples
    --------
    >>> complex_step(lambda x: x**3, 2.0)
    12.0
    """
    return np.imag(function(at + 1j * STEP * direction)) / STEP
