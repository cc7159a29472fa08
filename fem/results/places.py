"""Points of the flat film located in a mesh, and nodal fields there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.isoparametric import tabulated
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State

#: Number of elements tried for a point: those whose nodes are the nearest to it.
_NEAREST = 8

#: Most steps of Newton's method within an element. Elements are hardly curved, so few are needed.
_STEPS = 12
#: Largest distance beyond an element, in its own coordinates, that steps may reach: further out its
#: mapping may fold.
_BEYOND = 0.3

#: Length of a step, in the element's coordinates, below which it is the last.
_SMALL = 1e-10
#: Distance outside an element within which a point belongs to it: rounding moves points on edges.
_INSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class Places:
    """Points of the whole flat film in the part of it that is meshed.

    ``nodes`` are those of the element of each point, (points, local), ``shapes`` its shape
    functions there, and ``signs`` those of vector components in the mirror, (points, 3). Points a
    little beyond the mesh's edges, which approximate the outlines, belong to their nearest element.
    """

    nodes: AnyArray
    shapes: AnyArray
    signs: AnyArray

    @classmethod
    def of(cls, mesh: Discretisation, points: AnyArray) -> Places:
        """Locate points of the flat film [m], shape (points, 2)."""
        signs = np.ones((len(points), 3))
        for axis, plane in enumerate("xy"):
            if plane in mesh.planes:
                signs[points[:, axis] < 0, axis] = -1.0
        folded = points * signs[:, :2]
        cells, local = _located(mesh, folded)
        return cls(mesh.connectivity[cells], tabulated(mesh.mesh.order, local.T)[0].T, signs)

    def displacement(self, model: Model, state: State) -> AnyArray:
        """Interpolate displacements of the points [m], shape (points, 3)."""
        moved = state.positions - model.discretisation.reference
        local = np.einsum("nl,nli->ni", self.shapes, moved[self.nodes])
        displacement: AnyArray = self.signs * local
        return displacement


def _located(mesh: Discretisation, points: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Find elements of points and their reference coordinates, (points, 2)."""
    from scipy.spatial import cKDTree  # slow to load, and `solve` needs no places

    nodes = mesh.reference[mesh.connectivity, :2]
    tree = cKDTree(nodes.reshape(-1, 2))
    local = nodes.shape[1]
    near = tree.query(points, min(_NEAREST * local, len(nodes) * local))[1] // local
    best = np.zeros(len(points), dtype=np.int64)
    at = np.full((len(points), 2), 1 / 3)
    excess = np.full(len(points), np.inf)
    for candidates in _distinct(near).T:
        sought = np.flatnonzero(excess > _INSIDE)
        if not len(sought):
            break
        where = _within(mesh, nodes[candidates[sought]], points[sought])
        outside = _outside(where)
        nearer = outside < excess[sought]
        some = sought[nearer]
        best[some] = candidates[some]
        at[some] = where[nearer]
        excess[some] = outside[nearer]
    return best, at


def _distinct(near: AnyArray) -> AnyArray:
    """List the first few different elements of each row, repeated where there are fewer."""
    rows = []
    for candidates in near.tolist():
        some = list(dict.fromkeys(candidates))[:_NEAREST]
        rows.append(some + some[-1:] * (_NEAREST - len(some)))
    return np.array(rows)


def _within(mesh: Discretisation, nodes: AnyArray, points: AnyArray) -> AnyArray:
    """Find reference coordinates of points in elements with these nodes, by Newton's method."""
    at = np.full((len(points), 2), 1 / 3)
    for _ in range(_STEPS):
        shapes, slopes = tabulated(mesh.mesh.order, at.T)
        missing = points - np.einsum("ln,nli->ni", shapes, nodes)
        jacobian = np.einsum("nlk,nli->nik", slopes, nodes)
        step = np.linalg.solve(jacobian, missing[..., None])[..., 0]
        at = np.clip(at + step, -_BEYOND, 1 + _BEYOND)
        if np.abs(step).max() < _SMALL:
            break
    return at


def _outside(at: AnyArray) -> AnyArray:
    """Measure how far reference coordinates lie outside the reference triangle; 0 within."""
    beyond_sides = np.maximum(-at.min(axis=1), at.sum(axis=1) - 1)
    outside: AnyArray = np.maximum(beyond_sides, 0.0)
    return outside
