"""Shape functions of curved triangles, and their geometry from nodes that may be complex."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import skfem.quadrature

from tympan.base.arrays import AnyArray
from tympan.geometry.mesh import ELEMENTS, CurvedTriangles


@lru_cache
def quadrature(order: int) -> tuple[AnyArray, AnyArray]:
    """Choose points (2, points) and weights (points,) exact for squares of the shape functions."""
    points, weights = skfem.quadrature.get_quadrature(ELEMENTS[order].refdom, max(2, 2 * order))
    return points, weights


def tabulated(order: int, points: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Evaluate shape functions (local, points), slopes (points, local, 2) at points (2, points)."""
    return _tabulated(order, np.ascontiguousarray(points, dtype=float).tobytes())


def isoparametric(order: int, points: AnyArray, nodes: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Compute gradients (elements, points, local, 2) [1/m] of shape functions and |det ∂X/∂ξ|.

    ``points`` of the reference triangle, shape (2, points); ``nodes`` of the elements, (elements,
    local, 2) [m], may be complex.
    """
    by, ((a, c), (b, d)) = _jacobian(order, points, nodes)
    determinant = a * d - b * c
    a, b, c, d = np.stack([a, b, c, d])[..., None] / determinant[..., None]
    gradients = np.stack([d * by[0] - c * by[1], a * by[1] - b * by[0]])
    return np.moveaxis(gradients, 0, -1), determinant * np.sign(determinant.real)


def folded(mesh: CurvedTriangles) -> int:
    """Count the elements that turn inside out between nodes and quadrature points."""
    points = np.hstack([quadrature(mesh.order)[0], ELEMENTS[mesh.order].doflocs.T])
    nodes = mesh.doflocs.T[mesh.dofs.element_dofs.T]
    _, ((a, c), (b, d)) = _jacobian(mesh.order, points, nodes)
    determinant = a * d - b * c
    return int(np.count_nonzero(determinant.min(axis=1) * determinant.max(axis=1) <= 0))


def _jacobian(order: int, points: AnyArray, nodes: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Differentiate shape functions, (2, points, local), and places, (2, 2, …), by ξ and by η."""
    by = np.moveaxis(tabulated(order, points)[1], -1, 0)
    return by, np.moveaxis(np.matmul(by[:, None], nodes), -1, 1)


def deformation(gradients: AnyArray, nodes: AnyArray) -> AnyArray:
    """Compute F, (..., elements, points, 3, 2), from positions (..., elements, local, 3) [m].

    ``gradients`` are those of :func:`isoparametric`.
    """
    columns = np.matmul(gradients.transpose(3, 0, 1, 2), nodes[..., None, :, :, :])
    first = range(columns.ndim - 4)
    return np.transpose(columns, (*first, -3, -2, -1, -4))


@lru_cache(maxsize=64)
def _tabulated(order: int, points: bytes) -> tuple[AnyArray, AnyArray]:
    at = np.frombuffer(points).reshape(2, -1)
    element = ELEMENTS[order]()
    values = [element.lbasis(at, number) for number in range(element.doflocs.shape[0])]
    shapes = np.stack([np.broadcast_to(value, at.shape[1:]) for value, _ in values])
    slopes = np.stack([np.broadcast_to(np.reshape(slope, (2, -1)), at.shape)
                       for _, slope in values], axis=-1)
    return shapes, slopes.transpose(1, 2, 0)


@lru_cache
def middles(parts: int) -> AnyArray:
    """Compute the middles of ``parts``² equal triangles in the reference one, (2, parts²)."""
    return np.array([((3 * i + t) / (3 * parts), (3 * j + t) / (3 * parts)) for t in (1, 2)
                     for i in range(parts) for j in range(parts + 1 - t - i)]).T
