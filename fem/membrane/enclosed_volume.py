"""The volume between the film and its frame's plane, whose gas pressure is a follower load.

V = ∫ z n_z da = ∫ z (x,₁ y,₂ − x,₂ y,₁) dX over the film, and the plate's area times its normal's z
times its deflection. With both, the virtual work of a uniform pressure p is p δV: the tangent is
symmetric.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.membrane.state import HEAVE, PlateMotion

Array = NDArray[Any]

_AXES = np.eye(3)
_UP = _AXES[2]


def film_volume(mesh: Discretisation, positions: Array, *, second: bool = False
                ) -> tuple[Any, Array, Array | None]:
    """Volume under the film [m³], its first and, if asked, second derivatives.

    ``positions`` of the nodes, shape (nodes, 3) [m]. The derivatives are by those of the elements'
    nodes, shapes (elements, local, 3) [m²] and (elements, 3 local, 3 local), node-major [m].
    """
    f, g, w, shapes = mesh.deformation(positions), mesh.gradients, mesh.weights, mesh.shapes
    height = positions[mesh.connectivity, 2] @ shapes.T
    # x,₁ y,₂ − x,₂ y,₁, the area on the frame's plane per mounted area, and its derivatives by x
    # and y of each node, shape (elements, points, local).
    shadow = f[..., 0, 0] * f[..., 1, 1] - f[..., 0, 1] * f[..., 1, 0]
    slopes = (g[..., 0] * f[..., 1, 1, None] - g[..., 1] * f[..., 1, 0, None],
              g[..., 1] * f[..., 0, 0, None] - g[..., 0] * f[..., 0, 1, None])
    across = [np.matmul((w * height)[:, None], slope)[:, 0] for slope in slopes]
    first = np.stack([*across, (w * shadow) @ shapes], axis=-1)
    value = (w * height * shadow).sum()
    if not second:
        return value, first, None
    elements, _, local, _ = g.shape
    result = np.zeros((elements, local, 3, local, 3))
    turned = np.matmul((g[..., 0] * (w * height)[..., None]).transpose(0, 2, 1), g[..., 1])
    turned = turned - turned.transpose(0, 2, 1)
    result[:, :, 0, :, 1] = turned
    result[:, :, 1, :, 0] = turned.transpose(0, 2, 1)
    for axis, slope in enumerate(slopes):
        part = np.matmul((slope * w[..., None]).transpose(0, 2, 1), shapes)
        result[:, :, axis, :, 2] = part
        result[:, :, 2, :, axis] = part.transpose(0, 2, 1)
    return value, first, result.reshape(elements, 3 * local, 3 * local)


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
