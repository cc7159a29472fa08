"""The volume between the deformed film and its frame's plane, whose gas pressure is a follower load.

V = ∫ z n_z da = ∫ z (x,₁ y,₂ − x,₂ y,₁) dX over the film, and the plate's area times its normal's z
times its heave. With both, the virtual work of a uniform pressure p is p δV, so that its tangent is
symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.membrane.plate import HEAVE, PlateMotion

Array = NDArray[Any]

_AXES = np.eye(3)
_UP = _AXES[2]


@dataclass(frozen=True, eq=False)
class FilmVolume:
    """Element contributions.

    ``positions`` of the elements' nodes (elements, local, 3), ``deformation`` F (elements, points,
    3, 2), ``shapes`` (points, local), ``gradients`` (elements, points, local, 2), ``weights``
    (elements, points) of the mounted area.
    """

    positions: Array
    deformation: Array
    shapes: Array
    gradients: Array
    weights: Array

    @property
    def height(self) -> Array:
        """z at the quadrature points."""
        return self.positions[:, :, 2] @ self.shapes.T

    @property
    def value(self) -> Any:
        """Volume under the film [m³]."""
        f = self.deformation
        flat = f[..., 0, 0] * f[..., 1, 1] - f[..., 0, 1] * f[..., 1, 0]
        return (self.weights * self.height * flat).sum()

    def first(self) -> Array:
        """∂V/∂x of the elements' nodes, shape (elements, local, 3) [m²]."""
        along = self._along()
        flat = self.deformation[..., 0, 0] * self.deformation[..., 1, 1] \
            - self.deformation[..., 0, 1] * self.deformation[..., 1, 0]
        weighted = (self.weights * self.height)[:, None]
        across = [np.matmul(weighted, each)[:, 0] for each in along]
        return np.stack([*across, (self.weights * flat) @ self.shapes], axis=-1)

    def second(self) -> Array:
        """∂²V/∂x² of the elements, shape (elements, 3 local, 3 local), node-major [m]."""
        g, w = self.gradients, self.weights
        elements, _, local, _ = g.shape
        result = np.zeros((elements, local, 3, local, 3))
        turned = np.matmul((g[..., 0] * (w * self.height)[..., None]).transpose(0, 2, 1), g[..., 1])
        turned = turned - turned.transpose(0, 2, 1)
        result[:, :, 0, :, 1] = turned
        result[:, :, 1, :, 0] = turned.transpose(0, 2, 1)
        for axis, along in enumerate(self._along()):
            part = np.matmul((along * w[..., None]).transpose(0, 2, 1), self.shapes)
            result[:, :, axis, :, 2] = part
            result[:, :, 2, :, axis] = part.transpose(0, 2, 1)
        return result.reshape(elements, 3 * local, 3 * local)

    def _along(self) -> tuple[Array, Array]:
        """∂(x,₁ y,₂ − x,₂ y,₁) by x and y of each node."""
        g, f = self.gradients, self.deformation
        return (g[..., 0] * f[..., 1, 1, None] - g[..., 1] * f[..., 1, 0, None],
                g[..., 1] * f[..., 0, 0, None] - g[..., 0] * f[..., 0, 1, None])


def plate_volume(area: float, plate: PlateMotion) -> tuple[float, Array, Array]:
    """Volume under the plate [m³] and its first and second derivatives by the six freedoms."""
    heave, normal = plate.translation[HEAVE], plate.rotation @ _UP
    turn = np.zeros(6, dtype=normal.dtype)
    turn[3:] = np.cross(_AXES, normal)[:, 2]
    lift = np.zeros(6)
    lift[HEAVE] = 1.0
    first = area * (normal[2] * lift + heave * turn)
    second = np.outer(lift, turn) + np.outer(turn, lift)
    moment = np.outer(_UP, normal)
    second[3:, 3:] += heave * ((moment + moment.T) / 2 - np.eye(3) * normal[2])
    return area * normal[2] * heave, first, area * second
