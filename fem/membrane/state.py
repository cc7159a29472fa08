"""A configuration of film and plate, and the loads it is under."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tympan.fem.membrane.plate import PlateMotion

Array = NDArray[np.float64]

#: The loads that can be changed along a path: force on the plate [N], U² [V²], gas pressure [Pa].
Load = Literal["force", "voltage", "pressure"]

_FIELD = {"force": "force", "voltage": "voltage_squared", "pressure": "pressure"}


@dataclass(frozen=True, eq=False)
class State:
    """Node positions [m], plate motion, U² [V²], force on the plate [N], gas pressure [Pa].

    ``force`` is the whole plate's, also on a model that meshes only a part of it.
    """

    positions: Array
    plate: PlateMotion
    voltage_squared: float = 0.0
    force: float = 0.0
    pressure: float = 0.0

    def load(self, name: Load) -> float:
        """Force [N], U² [V²] or pressure [Pa]."""
        return float(getattr(self, _FIELD[name]))

    def under(self, **loads: float) -> State:
        """The same configuration with other loads, by the names of :data:`Load`."""
        changes: dict[str, Any] = {_FIELD[name]: value for name, value in loads.items()}
        return replace(self, **changes)
