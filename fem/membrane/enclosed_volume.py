"""The volume between the film and its frame's plane, whose gas pressure is a follower load.

V = ∫ z n_z da = ∫ z (x,₁ y,₂ − x,₂ y,₁) dX over the film, and the plate's area times its normal's z
times its deflection. With both, the virtual work of a uniform pressure p is p δV: the tangent is
symmetric.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.membrane.plate import HEAVE, PlateMotion

Array = NDArray[Any]

_AXES = np.eye(3)
_UP = _AXES[2]


@dataclass(frozen=True, eq=False)
class FilmVolume:
    """The volume under the film with its nodes at ``positions``, shape (nodes, 3) [m]."""

    discretisation: Discretisation
    positions: Array

    @cached_property
    def value(self) -> Any:
        """Volume under the film [m³]."""
        return (self.discretisation.weights * self._height * self._shadow).sum()

    def first(self) -> Array:
        """∂V/∂x of the elements' nodes, shape (elements, local, 3) [m²]."""
        weights = self.discretisation.weights
        weighted = (weights * self._height)[:, None]
        across = [np.matmul(weighted, slope)[:, 0] for slope in self._shadow_slopes]
        return np.stack([*across, (weights * self._shadow) @ self.discretisation.shapes], axis=-1)

    def second(self) -> Array:
        """∂²V/∂x² of the elements, shape (elements, 3 local, 3 local), node-major [m]."""
        g, w = self.discretisation.gradients, self.discretisation.weights
        elements, _, local, _ = g.shape
        result = np.zeros((elements, local, 3, local, 3))
        turned = np.matmul((g[..., 0] * (w * self._height)[..., None]).transpose(0, 2, 1),
                           g[..., 1])
        turned = turned - turned.transpose(0, 2, 1)
        result[:, :, 0, :, 1] = turned
        result[:, :, 1, :, 0] = turned.transpose(0, 2, 1)
        for axis, slope in enumerate(self._shadow_slopes):
            part = np.matmul((slope * w[..., None]).transpose(0, 2, 1), self.discretisation.shapes)
            result[:, :, axis, :, 2] = part
            result[:, :, 2, :, axis] = part.transpose(0, 2, 1)
        return result.reshape(elements, 3 * local, 3 * local)

    @cached_property
    def _deformation(self) -> Array:
        return self.discretisation.deformation(self.positions)

    @cached_property
    def _height(self) -> Array:
        """z at the quadrature points."""
        local = self.positions[self.discretisation.connectivity, 2]
        return np.asarray(local @ self.discretisation.shapes.T)

    @cached_property
    def _shadow(self) -> Array:
        """x,₁ y,₂ − x,₂ y,₁: area on the frame's plane per mounted area."""
        f = self._deformation
        return np.asarray(f[..., 0, 0] * f[..., 1, 1] - f[..., 0, 1] * f[..., 1, 0])

    @cached_property
    def _shadow_slopes(self) -> tuple[Array, Array]:
        """Its derivatives by x and y of each node, shape (elements, points, local)."""
        g, f = self.discretisation.gradients, self._deformation
        return (g[..., 0] * f[..., 1, 1, None] - g[..., 1] * f[..., 1, 0, None],
                g[..., 1] * f[..., 0, 0, None] - g[..., 0] * f[..., 0, 1, None])


def plate_volume(area: float, plate: PlateMotion) -> tuple[float, Array, Array]:
    """Volume under the plate [m³] and its first and second derivatives by the six freedoms."""
    deflection, normal = plate.translation[HEAVE], plate.rotation @ _UP
    turn = np.zeros(6, dtype=normal.dtype)
    turn[3:] = np.cross(_AXES, normal)[:, 2]
    lift = np.zeros(6)
    lift[HEAVE] = 1.0
    first = area * (normal[2] * lift + deflection * turn)
    second = np.outer(lift, turn) + np.outer(turn, lift)
    moment = np.outer(_UP, normal)
    second[3:, 3:] += deflection * ((moment + moment.T) / 2 - np.eye(3) * normal[2])
    return area * normal[2] * deflection, first, area * second
