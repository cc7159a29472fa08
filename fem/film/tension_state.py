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


def tension_state(stress_1: NDArray[Any], stress_2: NDArray[Any],
                  tense: NDArray[Any]) -> NDArray[np.int64]:
    """Of :class:`Tension`, from the larger and the smaller principal true stress [Pa].

    ``tense`` is in how many directions a film that wrinkles is tense; there its stress is positive,
    but no more than the residual tension of :class:`tympan.fem.film.tension_field.TensionField`.

    Examples
    --------
    >>> tension_state(np.array([2.0, 1.0, -1.0, 2.0]), np.array([1.0, -0.5, -2.0, 0.1]), np.array([2, 2, 2, 1]))
    array([0, 1, 2, 1])
    """
    pressed = (np.asarray(stress_1) <= 0).astype(np.int64) + (np.asarray(stress_2) <= 0)
    return np.maximum(pressed, 2 - np.asarray(tense))
