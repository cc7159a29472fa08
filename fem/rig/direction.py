"""Direction in which a voltage or a plate reached its state, and hysteresis."""

from __future__ import annotations

from typing import Any

import numpy as np

#: Signs of the direction of a voltage, by its name in datasets; "" means that it is unknown.
DIRECTIONS = {"up": 1.0, "down": -1.0, "": 0.0}

#: Mark of a setting whose effect depends on the direction of plate or voltage.
HYSTERESIS = "hysteresis"


def not_turned(before: Any, after: Any) -> Any:
    """Return the changed value, or zero if the change reversed its sign."""
    return after * (np.real(after) * (1 - 2 * (np.real(before) < 0)) > 0)
