"""The edge of the electrode, corner by corner of the elements along it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.geometry.mesh import ELEMENTS

#: Corners of a triangle: the first of its nodes.
CORNERS = 3

#: Corners at the ends of a triangle's sides.
_ENDS = np.array([(0, 1), (1, 2), (0, 2)])


@dataclass(frozen=True, eq=False)
class ElectrodeEdge:
    """Nodes of elements between the covered and the bare part.

    ``nodes`` (n,) are at the elements' corners; ``every`` also has those within their sides.
    ``places`` are the corners of elements there, first on the covered side, then on the bare one,
    each (m, 2) of element and corner; ``rows`` are their indices in ``nodes``, (m,). ``along`` is
    the line's unit direction at the nodes, (n, 2), complex where the mesh is.
    """

    nodes: AnyArray
    every: AnyArray
    places: tuple[AnyArray, AnyArray]
    rows: tuple[AnyArray, AnyArray]
    along: AnyArray

    @classmethod
    def of(cls, connectivity: AnyArray, covered: AnyArray, nodal_gradients: AnyArray, order: int
           ) -> ElectrodeEdge:
        """Find the edge on a mesh; without nodes where the mesh is all covered or all bare.

        ``connectivity`` (elements, local), ``covered`` (elements,), ``nodal_gradients``: ∂φ/∂X at
        the elements' nodes [1/m].
        """
        sides = np.sort(connectivity[:, _ENDS], axis=2).reshape(-1, 2)
        _, number, count = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
        number, there = number.ravel(), np.repeat(covered, len(_ENDS))
        between = (count == 2) & (np.bincount(number, weights=there) == 1)
        ends = np.flatnonzero(between[number] & there)
        line = np.column_stack([ends // len(_ENDS), _ENDS[ends % len(_ENDS)]])
        corners = connectivity[:, :CORNERS]
        every = np.intersect1d(connectivity[covered], connectivity[~covered])
        nodes = np.intersect1d(every, corners)
        at_line = np.isin(corners, nodes)
        here = [at_line & (covered == side)[:, None] for side in (True, False)]
        covers, bares = (np.argwhere(corner) for corner in here)
        rows, others = (np.searchsorted(nodes, corners[corner]) for corner in here)
        slopes = nodal_gradients[line[:, :1], line[:, 1:]]
        along = _directions(slopes, line, np.searchsorted(
            nodes, connectivity[line[:, :1], line[:, 1:]]), order)
        return cls(nodes, every, (covers, bares), (rows, others), along)

    def averaged(self, values: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Average values over the elements on the covered and on the bare side, each (k, n).

        ``values`` are given at the nodes of elements, (k, elements, local).
        """
        covered, bare = (np.array([self._mean(part, rows) for part in
                                   values[:, places[:, 0], places[:, 1]]])
                         for places, rows in zip(self.places, self.rows, strict=True))
        return covered, bare

    def _mean(self, values: AnyArray, rows: AnyArray) -> AnyArray:
        return np.bincount(rows, values, len(self.nodes)) / np.bincount(rows)

    @cached_property
    def firsts(self) -> tuple[AnyArray, AnyArray]:
        """One of the places on each side of every node, (n, 2)."""
        covered, bare = (places[np.unique(rows, return_index=True)[1]]
                         for places, rows in zip(self.places, self.rows, strict=True))
        return covered, bare


def _directions(slopes: AnyArray, line: AnyArray, rows: AnyArray, order: int) -> AnyArray:
    """Compute unit directions at nodes from the sides of elements that meet there.

    ``slopes``: ∂φ/∂X at the sides' ends (sides, 2, local, 2); ``line``: element and both corners of
    each (sides, 3); ``rows``: the nodes at their ends (sides, 2).
    """
    nodes = ELEMENTS[order].doflocs
    chords = (nodes[line[:, 2]] - nodes[line[:, 1]])[:, None, :, None]
    # ∂ξ/∂X is the sum of the places of the shape functions' nodes times their slopes.
    reference_by_place = np.einsum("li,...lj->...ij", nodes, slopes)
    tangents = np.linalg.solve(reference_by_place, chords)[..., 0]
    tangents = tangents / np.sqrt((tangents**2).sum(axis=-1, keepdims=True))
    total = np.zeros((int(rows.max(initial=-1)) + 1, 2), dtype=tangents.dtype)
    for row, tangent in zip(rows.ravel().tolist(), tangents.reshape(-1, 2), strict=True):
        total[row] += tangent if (total[row] @ tangent).real >= 0 else -tangent
    directions: AnyArray = total / np.sqrt((total**2).sum(axis=1, keepdims=True))
    return directions
