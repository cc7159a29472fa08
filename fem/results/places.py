"""Places of points of the flat film in a mesh, and nodal fields there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.isoparametric import tabulated
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State

#: Elements whose nodes are the nearest to a point, that may hold it.
_NEAREST = 8

#: Most steps of Newton's method within an element. Elements are hardly curved, so that a few do.
_STEPS = 12
#: How far beyond an element, in its own coordinates, steps are kept: its mapping may turn over
#: further out.
_BEYOND = 0.3

#: A step shorter than this, in the element's coordinates, is the last.
_SMALL = 1e-10
#: A point so little outside an element is within it: on an edge rounding would leave it in none.
_INSIDE = 1e-9


@dataclass(frozen=True, eq=False)
class Places:
    """Points of the whole flat film in the part of it that is meshed.

    ``nodes`` of the element of each, (points, local), ``shapes`` its shape functions there, and the
    ``signs`` by which components of vectors turn in the mirror, (points, 3). Points a little beyond
    the mesh's edges, which approximate the outlines', are its nearest element's continued.
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
        """Displacements of the points [m], shape (points, 3)."""
        moved = state.positions - model.discretisation.reference
        return np.asarray(self.signs * np.einsum("nl,nli->ni", self.shapes, moved[self.nodes]))


def _located(mesh: Discretisation, points: AnyArray) -> tuple[AnyArray, AnyArray]:
    """Elements of points and their reference coordinates, (points, 2)."""
    from scipy.spatial import cKDTree  # heavy, and `solve` asks for no places

    nodes = mesh.reference[mesh.connectivity, :2]
    tree = cKDTree(nodes.reshape(-1, 2))
    local = nodes.shape[1]
    near = tree.query(points, min(_NEAREST * local, len(nodes) * local))[1] // local
    best, at = np.zeros(len(points), dtype=np.int64), np.full((len(points), 2), 1 / 3)
    excess = np.full(len(points), np.inf)
    for candidates in _distinct(near).T:
        sought = np.flatnonzero(excess > _INSIDE)
        if not len(sought):
            break
        where = _within(mesh, nodes[candidates[sought]], points[sought])
        outside = _outside(where)
        nearer = outside < excess[sought]
        some = sought[nearer]
        best[some], at[some], excess[some] = candidates[some], where[nearer], outside[nearer]
    return best, at


def _distinct(near: AnyArray) -> AnyArray:
    """The first few different elements of each row, repeated where there are fewer."""
    rows = []
    for candidates in near.tolist():
        some = list(dict.fromkeys(candidates))[:_NEAREST]
        rows.append(some + some[-1:] * (_NEAREST - len(some)))
    return np.array(rows)


def _within(mesh: Discretisation, nodes: AnyArray, points: AnyArray) -> AnyArray:
    """Reference coordinates of points in elements with these nodes, by Newton's method."""
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
    """Distance of reference coordinates from the reference triangle, if they are outside."""
    return np.asarray(np.maximum(np.maximum(-at.min(axis=1), at.sum(axis=1) - 1), 0.0))
