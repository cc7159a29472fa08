"""A configuration of film and plate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fem.model import Model
from fem.plate import PlateMotion

Array = NDArray[np.float64]

#: Which of the three is solved for while the other two are given.
Unknown = Literal["heave", "force", "voltage"]


@dataclass(frozen=True, eq=False)
class State:
    """Node positions [m], plate motion, U² [V²], force on the plate [N].

    ``force`` is the whole plate's, also on a model that meshes only a part of it.
    """

    positions: Array
    plate: PlateMotion
    voltage_squared: float = 0.0
    force: float = 0.0

    @classmethod
    def mounted(cls, model: Model, voltage_squared: float = 0.0) -> State:
        """The flat film with the plate at rest."""
        return cls(model.reference.copy(), PlateMotion.rest(), voltage_squared)
