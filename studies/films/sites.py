"""Points of a mesh at which many films are looked at, by their places in the reference elements.

A mesh that moves with a film's outlines keeps its elements. So the slopes of shapes by reference
coordinates are the same for all films of a family; what differs is ∂X/∂ξ alone.
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
    """Points of elements, and what is known of them whatever the film.

    ``cells``: number of the element of each, (points,); ``nodes`` of these elements, (points,
    local); ``values`` and ``slopes`` of the shape functions by reference coordinates, (points,
    local) and (points, local, 2); ``weights``: area in these coordinates that a point stands for,
    of the whole film; ``covered``, 1 under the electrode; ``turns``: the sign of det ∂X/∂ξ.
    """

    cells: Numbers
    nodes: Numbers
    values: Array
    slopes: Array
    weights: Array
    covered: Array
    turns: Array

    @classmethod
    def of(cls, mesh: Discretisation, places: Array, weights: Array | None = None,
           cells: Numbers | None = None) -> Sites:
        """The same reference points, shape (2, count), in every element, or in some; element-major.

        Without ``weights`` of the points, shape (count,), they stand for no area.
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
                   mesh.covered[each, 0], np.sign(np.linalg.det(slope)).ravel())

    @classmethod
    def quadrature(cls, mesh: Discretisation) -> Sites:
        """All quadrature points."""
        return cls.of(mesh, *quadrature(mesh.mesh.order))

    @classmethod
    def at_nodes(cls, mesh: Discretisation) -> Sites:
        """The nodes of every element."""
        return cls.of(mesh, ELEMENTS[mesh.mesh.order].doflocs.T)

    @classmethod
    def within(cls, mesh: Discretisation, cells: Numbers, parts: int) -> Sites:
        """The middles of ``parts``² triangles in some elements."""
        return cls.of(mesh, middles(parts), cells=cells)

    @cached_property
    def gather(self) -> tuple[csr_matrix, csr_matrix]:
        """Sums of forces against ∂x/∂ξ and ∂x/∂η at the nodes, (nodes, points) each."""
        points = np.broadcast_to(np.arange(len(self.nodes))[:, None], self.nodes.shape).ravel()
        size = int(self.nodes.max()) + 1, len(self.nodes)
        return tuple(coo_matrix((self.slopes[..., along].ravel(), (self.nodes.ravel(), points)),
                                size).tocsr() for along in range(2))

    @cached_property
    def spread(self) -> csr_matrix:
        """Sums of values at the points at the nodes, (nodes, points)."""
        points = np.broadcast_to(np.arange(len(self.nodes))[:, None], self.nodes.shape).ravel()
        size = int(self.nodes.max()) + 1, len(self.nodes)
        return coo_matrix((self.values.ravel(), (self.nodes.ravel(), points)), size).tocsr()

    def some(self, points: Numbers, shares: Array) -> Sites:
        """Some of the points, each for ``shares`` times its own area."""
        chosen = {name: getattr(self, name)[points] for name in
                  ("cells", "nodes", "values", "slopes", "covered", "turns")}
        return replace(self, weights=self.weights[points] * shares, **chosen)

    def tangents(self, positions: Array) -> Array:
        """∂x/∂ξ of nodal positions (..., nodes, 2 or 3), shape (..., components × 2, points)."""
        *many, nodes, components = positions.shape
        flat = positions.reshape(-1, nodes, components).transpose(1, 2, 0).reshape(nodes, -1)
        there = np.stack([(along.T @ flat[: along.shape[0]]).reshape(-1, components, flat.shape[1]
                          // components) for along in self.gather], 2)
        return np.ascontiguousarray(there.reshape(len(there), 2 * components, -1).transpose(
            2, 1, 0)).reshape(*many, 2 * components, -1)

    def at(self, positions: Array) -> Array:
        """Nodal values (..., nodes, components) at the points, (..., points, components)."""
        return np.asarray(np.einsum("...plc,pl->...pc", positions[..., self.nodes, :], self.values,
                                    optimize=True))
