"""Where the film is no longer in tension: a membrane cannot be pressed, it wrinkles or hangs slack."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Tension(IntEnum):
    """In how many directions the film carries tension; the numbers are those of the VTU."""

    TAUT = 0  #: in both
    WRINKLED = 1  #: along the wrinkles only
    SLACK = 2  #: in none


def tension_state(stress_1: NDArray[Any], stress_2: NDArray[Any]) -> NDArray[np.int64]:
    """Of :class:`Tension`, from the larger and the smaller principal true stress [Pa].

    Examples
    --------
    >>> tension_state(np.array([2.0, 1.0, -1.0]), np.array([1.0, -0.5, -2.0]))
    array([0, 1, 2])
    """
    return (np.asarray(stress_1) <= 0).astype(np.int64) + (np.asarray(stress_2) <= 0)
