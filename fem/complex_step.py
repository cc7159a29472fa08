"""Derivatives by the complex step, accurate to rounding, for code that allows complex numbers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

#: Imaginary step. Its square is below the rounding error of any number, and far above underflow.
STEP = 1e-40


def complex_step(function: Callable[[Any], Any], at: Any, direction: Any = 1.0) -> Any:
    """Differentiate an analytic function of a number or array along a direction.

    Im f(x + ih)/h = f′(x) + O(h²). No subtraction can lose digits (Squire & Trapp, SIAM Rev. 40,
    1998).

    Examples
    --------
    >>> complex_step(lambda x: x**3, 2.0)
    12.0
    """
    return np.imag(function(at + 1j * STEP * direction)) / STEP
