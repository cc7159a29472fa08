"""Shape functions of curved triangles, and their geometry from nodes that may be complex."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.mesh import ELEMENTS

Array = NDArray[Any]


def tabulated(order: int, points: Array) -> tuple[Array, Array]:
    """Shape functions (local, points), slopes (points, local, 2) at given points (2, points)."""
    return _tabulated(order, np.ascontiguousarray(points, dtype=float).tobytes())


def isoparametric(order: int, points: Array, nodes: Array) -> tuple[Array, Array]:
    """Shape functions' gradients (elements, points, local, 2) [1/m] and |det ∂X/∂ξ| at points.

    ``points`` of the reference triangle, shape (2, points); ``nodes`` of the elements, (elements,
    local, 2) [m], may be complex.
    """
    slopes = tabulated(order, points)[1]
    jacobian = np.matmul(nodes.swapaxes(1, 2)[:, None], slopes)
    (a, b), (c, d) = np.moveaxis(jacobian, (2, 3), (0, 1))
    determinant = a * d - b * c
    inverse = np.stack([np.stack([d, -b], axis=-1), np.stack([-c, a], axis=-1)],
                       axis=-2) / determinant[..., None, None]
    return np.matmul(slopes, inverse), determinant * np.sign(determinant.real)


@lru_cache(maxsize=64)
def _tabulated(order: int, points: bytes) -> tuple[Array, Array]:
    at = np.frombuffer(points).reshape(2, -1)
    element = ELEMENTS[order]()
    values = [element.lbasis(at, number) for number in range(element.doflocs.shape[0])]
    shapes = np.stack([np.broadcast_to(value, at.shape[1:]) for value, _ in values])
    slopes = np.stack([np.broadcast_to(np.reshape(slope, (2, -1)), at.shape)
                       for _, slope in values], axis=-1)
    return shapes, slopes.transpose(1, 2, 0)
