"""Points of a mesh at which many films are evaluated, by their reference coordinates.

A mesh that moves with a film's outlines keeps its elements. The slopes of shapes by reference
coordinates are therefore the same for all films of a family. Only ∂X/∂ξ differs.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from tympan.base.arrays import Array, Numbers
from tympan.base.fields import FieldsAlone
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.isoparametric import middles, quadrature, tabulated
from tympan.geometry.mesh import ELEMENTS


@dataclass(frozen=True, eq=False)
class Sites(FieldsAlone):
    """Points of elements, and their properties that do not depend on the film.

    ``cells``: element of each point, (points,). ``nodes``: nodes of these elements, (points,
    local). ``values`` and ``slopes``: shape functions and their derivatives by reference
    coordinates, (points, local) and (points, local, 2). ``weights``: area of the whole film in
    these coordinates that a point represents. ``covered``: 1 under the electrode, in the segment of
    the number ``segments``. ``turns``: sign of det ∂X/∂ξ.
    """

    cells: Numbers
    nodes: Numbers
    values: Array
    slopes: Array
    weights: Array
    covered: Array
    segments: Numbers
    turns: Array

    @classmethod
    def of(cls, mesh: Discretisation, places: Array, weights: Array | None = None,
           cells: Numbers | None = None) -> Sites:
        """Create equal reference points, shape (2, count), in every element, or in some.

        Points are ordered by element. Without ``weights``, shape (count,), the points represent no
        area.
        """
        cells = np.arange(len(mesh.connectivity)) if cells is None else cells
        count = places.shape[1]
        values, slopes = tabulated(mesh.mesh.order, places)
        area = np.zeros(count) if weights is None else weights * mesh.mirrored
        each = np.repeat(cells, count)
        slope = np.einsum("epla,elc->epca", np.tile(slopes, (len(cells), 1, 1)).reshape(
            len(cells), count, -1, 2), mesh.reference[mesh.connectivity[cells], :2])
        return cls(each, mesh.connectivity[each], np.tile(values.T, (len(cells), 1)),
                   np.tile(slopes, (len(cells), 1, 1)), np.tile(area, len(cells)),
                   mesh.covered[each, 0], mesh.segments[each],
                   np.sign(np.linalg.det(slope)).ravel())

    @classmethod
    def quadrature(cls, mesh: Discretisation) -> Sites:
        """Create all quadrature points."""
        return cls.of(mesh, *quadrature(mesh.mesh.order))

    @classmethod
    def at_nodes(cls, mesh: Discretisation) -> Sites:
        """Create points at the nodes of every element."""
        return cls.of(mesh, ELEMENTS[mesh.mesh.order].doflocs.T)

    @classmethod
    def within(cls, mesh: Discretisation, cells: Numbers, parts: int) -> Sites:
        """Create points at the middles of ``parts``² triangles in some elements."""
        return cls.of(mesh, middles(parts), cells=cells)

    @cached_property
    def gather(self) -> tuple[csr_matrix, csr_matrix]:
        """Matrices that sum forces against ∂x/∂ξ and ∂x/∂η to nodes, (nodes, points) each."""
        points = np.broadcast_to(np.arange(len(self.nodes))[:, None], self.nodes.shape).ravel()
        size = int(self.nodes.max()) + 1, len(self.nodes)
        return tuple(coo_matrix((self.slopes[..., along].ravel(), (self.nodes.ravel(), points)),
                                size).tocsr() for along in range(2))

    @cached_property
    def spread(self) -> csr_matrix:
        """Matrix that sums values at the points to the nodes, (nodes, points)."""
        points = np.broadcast_to(np.arange(len(self.nodes))[:, None], self.nodes.shape).ravel()
        size = int(self.nodes.max()) + 1, len(self.nodes)
        return coo_matrix((self.values.ravel(), (self.nodes.ravel(), points)), size).tocsr()

    def some(self, points: Numbers, shares: Array) -> Sites:
        """Select some of the points; each represents ``shares`` times its own area."""
        chosen = {name: getattr(self, name)[points] for name in
                  ("cells", "nodes", "values", "slopes", "covered", "segments", "turns")}
        return replace(self, weights=self.weights[points] * shares, **chosen)

    def tangents(self, positions: Array) -> Array:
        """Compute ∂x/∂ξ from nodal positions (..., nodes, 2 or 3).

        Its shape is (..., components × 2, points).
        """
        *many, nodes, components = positions.shape
        flat = positions.reshape(-1, nodes, components).transpose(1, 2, 0).reshape(nodes, -1)
        there = np.stack([(along.T @ flat[: along.shape[0]]).reshape(-1, components, flat.shape[1]
                          // components) for along in self.gather], 2)
        return np.ascontiguousarray(there.reshape(len(there), 2 * components, -1).transpose(
            2, 1, 0)).reshape(*many, 2 * components, -1)

    def at(self, positions: Array) -> Array:
        """Interpolate nodal values (..., nodes, components) at the points.

        The result has the shape (..., points, components).
        """
        return np.asarray(np.einsum("...plc,pl->...pc", positions[..., self.nodes, :], self.values,
                                    optimize=True))
