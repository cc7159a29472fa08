"""Positions of film and plate, and the loads on them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import atan2, sin, sqrt
from typing import Any, Literal

import numpy as np

from tympan.base.arrays import Array

#: The plate's freedoms: translations [m], then rotations [rad]; z is the deflection, positive along
#: the load.
FREEDOMS = ("x", "y", "z", "rx", "ry", "rz")
HEAVE = FREEDOMS.index("z")

#: Loads that can change along a path: force on the plate [N], U² [V²], gas pressure [Pa], which
#: lifts film and plate against the force.
Load = Literal["force", "voltage", "pressure"]

#: What a function along a branch needs of a point: the state alone, also the direction and rate, or
#: a tangent of its own.
Needs = Literal["state", "direction", "tangent"]

_UNIT = np.eye(3)

_FIELD = {"force": "force", "voltage": "voltage_squared", "pressure": "pressure"}


@dataclass(frozen=True)
class PlateMotion:
    """Position of the plate: translation of its centre [m] and rotation matrix about it."""

    translation: Array
    rotation: Array

    @classmethod
    def rest(cls) -> PlateMotion:
        """Make the mounted position."""
        return cls(np.zeros(3), np.eye(3))

    @property
    def deflection(self) -> float:
        """Deflection along the load [m]."""
        deflection: float = self.translation[HEAVE].item()
        return deflection

    @property
    def tilt(self) -> float:
        """Angle between the plate's normal and the load [rad]."""
        return float(np.arccos(np.clip(self.rotation[2, 2], -1, 1)))

    @property
    def slope(self) -> Any:
        """Slopes of the plate along x and y [rad], shape (2,).

        A slope is positive where the plate's side towards positive x, or y, is deflected further.
        The squares of their sines add up to that of the tilt.
        """
        return np.arcsin(self.rotation[2, :2])

    def moved(self, step: Array) -> PlateMotion:
        """Add a small motion in the six freedoms; rotations compose, so none is singular."""
        rotation = _turn(step[3:]) @ self.rotation if step[3:].any() else self.rotation
        return PlateMotion(self.translation + step[:3], rotation)

    def raised_to(self, deflection: float) -> PlateMotion:
        """Copy the motion with another deflection [m]."""
        translation = self.translation.copy()
        translation[HEAVE] = deflection
        return PlateMotion(translation, self.rotation)

    def positions(self, centre: Array, arms: Array) -> Array:
        """Compute positions of plate points with given arms from the centre, shape (n, 3)."""
        return centre + self.translation + arms @ self.rotation.T

    def gradient(self, arms: Array) -> Array:
        """Differentiate the positions by the six freedoms, shape (n, 3, 6)."""
        turned = arms @ self.rotation.T
        result = np.zeros((len(arms), 3, 6), dtype=turned.dtype)
        result[:, :, :3] = _UNIT
        # Rotations move the nodes by the cross products of the axes with the arms.
        result[:, (2, 0, 1), (3, 4, 5)] = turned[:, (1, 2, 0)]
        result[:, (1, 2, 0), (3, 4, 5)] = -turned[:, (2, 0, 1)]
        return result

    def gathered(self, arms: Array, forces: Array) -> Array:
        """Sum forces at plate points on the six freedoms: force and moment, shape (6,)."""
        products = forces.T @ (arms @ self.rotation.T)
        moment = (products.T - products)[(1, 2, 0), (2, 0, 1)]
        return np.concatenate([forces.sum(axis=0), moment])

    def curvature(self, arms: Array, forces: Array) -> Array:
        """Sum forces · second derivative of positions, (6, 6): ½ (a × (b × r) + b × (a × r))."""
        moment = forces.T @ (arms @ self.rotation.T)
        result = np.zeros((6, 6), dtype=moment.dtype)
        result[3:, 3:] = (moment + moment.T) / 2 - _UNIT * moment.trace()
        return result


def _turn(vector: Array) -> Array:
    """Compute the matrix of a rotation vector, by Rodrigues' formula."""
    x, y, z = vector.tolist()
    angle = sqrt(x * x + y * y + z * z)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) / angle
    return _UNIT + sin(angle) * cross + 2 * sin(angle / 2) ** 2 * (cross @ cross)


def turned(plate: PlateMotion, origin: PlateMotion) -> Array:
    """Find the rotation vector that turns one orientation into another, by less than π [rad]."""
    if plate.rotation is origin.rotation:
        return np.zeros(3)
    turn = plate.rotation @ origin.rotation.T
    across = (turn - turn.T)[(2, 0, 1), (1, 2, 0)] / 2
    sine = float(np.linalg.norm(across))
    angle = atan2(sine, (turn.trace() - 1) / 2)
    return across * (angle / sine if sine else 1.0)


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
        """Read a load: force [N], U² [V²] or pressure [Pa]."""
        return float(getattr(self, _FIELD[name]))

    def under(self, **loads: float) -> State:
        """Copy the configuration with other loads, by the names of :data:`Load`."""
        changes: dict[str, Any] = {_FIELD[name]: value for name, value in loads.items()}
        return replace(self, **changes)
