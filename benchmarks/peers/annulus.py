"""Structured meshes of the flat annulus, as plain arrays, graded geometrically in the radius."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Lattice steps (radial, circumferential) of the nodes of one cell, corners first, then the edge
# midpoints 01, 12, 23, 30 and the centre: the order of VTK, Abaqus and meshio.
_QUAD_STEPS = {
    1: ((0, 0), (1, 0), (1, 1), (0, 1)),
    2: ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)),
}
_TRIANGLE_STEPS = {
    1: (((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1))),
    2: (
        ((0, 0), (2, 0), (2, 2), (1, 0), (2, 1), (1, 1)),
        ((0, 0), (2, 2), (0, 2), (1, 1), (1, 2), (0, 1)),
    ),
}


@dataclass(frozen=True)
class Annulus:
    """Plane mesh of an annulus: points (n, 2) in mm, cells (m, nodes each), nodes of both rims."""

    points: Floats
    cells: Ints
    inner: Ints
    outer: Ints

    @property
    def free_nodes(self) -> int:
        """Number of nodes on neither rim."""
        return len(self.points) - len(self.inner) - len(self.outer)


def graded_radii(inner: float, outer: float, n_r: int, order: int) -> Floats:
    """Radii of the lattice rings, a (b/a)^(k/n_r); the rings between them are equally spaced."""
    corners = inner * (outer / inner) ** (np.arange(n_r + 1) / n_r)
    steps = np.arange(order * n_r + 1) / order
    return np.interp(steps, np.arange(n_r + 1), corners)


def _lattice(inner: float, outer: float, n_r: int, n_theta: int, order: int) -> Floats:
    """Points of the polar lattice, ring by ring from the inner rim, all on exact circles."""
    radii = graded_radii(inner, outer, n_r, order)[:, None]
    angles = 2 * np.pi * np.arange(order * n_theta) / (order * n_theta)
    return np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=-1).reshape(-1, 2)


def _cells(steps: tuple[tuple[int, int], ...], n_r: int, n_theta: int, order: int) -> Ints:
    """Node numbers of the cells that take the given lattice steps from every lattice corner."""
    ring = order * n_theta
    row, column = (grid.ravel()[:, None] for grid in np.mgrid[0:n_r, 0:n_theta] * order)
    d_row, d_column = np.array(steps).T
    return (row + d_row) * ring + (column + d_column) % ring


def _mesh(inner: float, outer: float, n_r: int, n_theta: int, order: int, cells: Ints) -> Annulus:
    points = _lattice(inner, outer, n_r, n_theta, order)
    rim = np.arange(order * n_theta)
    return Annulus(points, cells, rim, rim + len(points) - len(rim))


def quads(inner: float, outer: float, n_r: int, n_theta: int, order: int) -> Annulus:
    """Annulus of n_r x n_theta quadrilaterals with 4 (order 1) or 9 (order 2) nodes."""
    cells = _cells(_QUAD_STEPS[order], n_r, n_theta, order)
    return _mesh(inner, outer, n_r, n_theta, order, cells)


def triangles(inner: float, outer: float, n_r: int, n_theta: int, order: int) -> Annulus:
    """Annulus of 2 n_r n_theta triangles with 3 (order 1) or 6 (order 2) nodes."""
    cells = np.concatenate([_cells(steps, n_r, n_theta, order) for steps in _TRIANGLE_STEPS[order]])
    return _mesh(inner, outer, n_r, n_theta, order, cells)
