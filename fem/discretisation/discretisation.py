"""The film's mesh, numbered and ready for integration, whatever its material and loads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import skfem
from scipy.sparse import coo_matrix

from tympan.base.arrays import AnyArray, Mask
from tympan.base.fields import FieldsAlone
from tympan.fem.discretisation.assembly import SparsityPattern
from tympan.fem.discretisation.electrode_edge import ElectrodeEdge
from tympan.fem.discretisation.isoparametric import (
    deformation,
    isoparametric,
    quadrature,
    tabulated,
)
from tympan.fem.discretisation.recovery import Recovery
from tympan.fem.linear_solver.direct import Analysis, analyse
from tympan.fem.linear_solver.dissection import elimination_order
from tympan.geometry.mesh import (
    ELEMENTS,
    CurvedTriangles,
    curved_mesh,
    image_planes,
    named_segment,
)


@dataclass(frozen=True, eq=False)
class Unknowns(FieldsAlone):
    """Nodal components that are solved for, and the structure that all their tangents share.

    Their order is an order of elimination with little fill-in. Meshes that differ only in the
    places of their nodes share them.
    """

    connectivity: AnyArray  #: nodes of the elements, shape (elements, local)
    points: AnyArray  #: places of the nodes, which order the elimination, shape (nodes, 2) [m]
    movable: Mask  #: components that are unknown, shape (nodes, 3)

    @cached_property
    def free(self) -> tuple[AnyArray, AnyArray]:
        """Node and component of each unknown: an index into arrays of shape (nodes, 3)."""
        position, component = np.nonzero(self.movable[self.order])
        return self.order[position], component

    @cached_property
    def pattern(self) -> SparsityPattern:
        """Places of the entries of element tangents in the sparse one of the unknowns."""
        return SparsityPattern.of(self.ranked, self.movable[self.order])

    @cached_property
    def analysis(self) -> Analysis:
        """Analysis that the factorisations of all tangents of the unknowns share."""
        return analyse(self.pattern.indices, self.pattern.indptr, ordered=True)

    @cached_property
    def order(self) -> AnyArray:
        """The nodes in their order of elimination."""
        return elimination_order(self.connectivity, self.points)

    @cached_property
    def ranked(self) -> AnyArray:
        """The elements' nodes by their place in that order, shape (elements, local)."""
        rank = np.empty(len(self.movable), dtype=np.int64)
        rank[self.order] = np.arange(len(self.order))
        ranked: AnyArray = rank[self.connectivity]
        return ranked


@dataclass(frozen=True, eq=False)
class Discretisation(FieldsAlone):
    """A mesh of the flat mounted film with its basis functions, quadrature and unknowns.

    Node positions, not displacements, are the unknowns; all nodal arrays have shape (nodes, 3).
    """

    mesh: CurvedTriangles
    planes: frozenset[str]  #: coordinates about whose zero the mesh is half of a mirrored whole
    odd: frozenset[str]  #: planes about which motions are odd instead of even
    boundaries: Mapping[str, AnyArray]  #: nodes on each named boundary
    reference: AnyArray  #: node positions of the flat mounted film [m], shape (nodes, 3)
    shapes: AnyArray  #: φ at the quadrature points, shape (points, local)
    unknowns: Unknowns

    @classmethod
    def of(cls, mesh: CurvedTriangles, planes: frozenset[str] = frozenset(),
           odd: frozenset[str] = frozenset()) -> Discretisation:
        """Discretise a mesh, with quadrature exact for the square of the shape functions."""
        flat, dofs = mesh.doflocs.T, mesh.dofs
        nodes = {name: dofs.get_facet_dofs(facets).flatten()
                 for name, facets in (mesh.boundaries or {}).items()}
        movable = np.ones((len(flat), 3), dtype=bool)
        for edge in ("frame", "plate"):
            movable[nodes.get(edge, [])] = False
        for plane in planes:
            across = np.arange(3) == "xy".index(plane)
            movable[nodes[{"x": "axis_y", "y": "axis_x"}[plane]]] &= (
                across if plane in odd else ~across)
        return cls(mesh, planes, odd, nodes, np.column_stack([flat, np.zeros(len(flat))]),
                   tabulated(mesh.order, quadrature(mesh.order)[0])[0].T,
                   Unknowns(np.ascontiguousarray(dofs.element_dofs.T), flat, movable))

    @classmethod
    def of_plate(cls, centre: tuple[float, float]) -> Discretisation:
        """Make the mesh of a film without elements: its one node is the centre [m] of the plate."""
        places = np.array([centre], dtype=float)
        mesh = CurvedTriangles(places.T, np.zeros((3, 0), dtype=int), elem=ELEMENTS[1],
                               validate=False)
        shapes = tabulated(1, quadrature(1)[0])[0].T
        nodes = {"plate": np.arange(1), "frame": np.arange(0)}
        return cls(mesh, frozenset(), frozenset(), nodes, np.array([[*centre, 0.0]]), shapes,
                   Unknowns(np.zeros((0, shapes.shape[1]), dtype=int), places,
                            np.zeros((1, 3), dtype=bool)))

    def moved(self, motion: AnyArray) -> Discretisation:
        """Move the nodes in the plane by (nodes, 2) [m], real or imaginary; keep the elements."""
        nodes, mesh = self.reference[:, :2] + motion, self.mesh
        if not np.iscomplexobj(nodes):
            places: dict[str, Any] = {"doflocs": np.ascontiguousarray(nodes.T)}
            mesh = replace(mesh, **places)
        return replace(self, mesh=mesh, reference=np.column_stack([nodes, np.zeros(len(nodes))]))

    def of_order(self, order: int) -> Discretisation:
        """Give the same triangles nodes of another order, if these elements have such places."""
        mesh = self.mesh
        shapes = tabulated(mesh.order, ELEMENTS[order].doflocs.T)[0].T
        nodes = (shapes @ self.reference[self.connectivity, :2]).transpose(2, 1, 0)
        other = curved_mesh(mesh.doflocs[:, :mesh.nvertices], mesh.t, order, nodes)
        return Discretisation.of(
            other.with_boundaries(mesh.boundaries or {}).with_subdomains(mesh.subdomains or {}),
            self.planes, self.odd)

    def interpolated(self, coarse: Discretisation, values: AnyArray) -> AnyArray:
        """Interpolate a nodal field of other elements on the same triangles, (nodes, …) each."""
        shapes = tabulated(coarse.mesh.order, ELEMENTS[self.mesh.order].doflocs.T)[0].T
        nodal = np.empty((len(self.reference), *values.shape[1:]))
        nodal[self.connectivity] = np.einsum("lc,ec...->el...", shapes,
                                             values[coarse.connectivity])
        return nodal

    @cached_property
    def basis(self) -> skfem.CellBasis:
        """Scikit-fem's scalar basis on the same elements and points."""
        return skfem.CellBasis(self.mesh, self.mesh.elem(), quadrature=quadrature(self.mesh.order))

    @cached_property
    def fitted(self) -> AnyArray:
        """Matrix from values at an element's quadrature points to nodal values, (points, local).

        It fits the nearest polynomial of the elements' order.
        """
        fitted: AnyArray = np.linalg.pinv(self.shapes).T
        return fitted

    @property
    def gradients(self) -> AnyArray:
        """∂φ/∂X at the quadrature points, shape (elements, points, local, 2) [1/m]."""
        return self._geometry[0]

    @property
    def weights(self) -> AnyArray:
        """Mounted area of every quadrature point [m²], shape (elements, points)."""
        return self._geometry[1]

    @cached_property
    def _geometry(self) -> tuple[AnyArray, AnyArray]:
        """Gradients and weights."""
        points, weights = quadrature(self.mesh.order)
        gradients, areas = isoparametric(self.mesh.order, points,
                                         self.reference[self.connectivity, :2])
        return gradients, areas * weights

    @cached_property
    def nodal_gradients(self) -> AnyArray:
        """∂φ/∂X at the nodes of every element [1/m], shape (elements, local, local, 2)."""
        return isoparametric(self.mesh.order, ELEMENTS[self.mesh.order].doflocs.T,
                             self.reference[self.connectivity, :2])[0]

    @property
    def mirrored(self) -> int:
        """Number of times that the mesh repeats in the whole film: 1, 2 or 4."""
        return 1 << len(self.planes)

    @cached_property
    def covered(self) -> AnyArray:
        """1 in elements under the electrode, 0 outside, shape (elements, 1)."""
        covered = np.ones((self.mesh.nelements, 1))
        covered[(self.mesh.subdomains or {}).get("bare", [])] = 0
        return covered

    @cached_property
    def segments(self) -> AnyArray:
        """Number of the electrode's segment of every element, 0 where there is none, (elements,).

        An electrode in one piece is segment 0.
        """
        own: AnyArray = self.images[0]
        return own

    @cached_property
    def images(self) -> AnyArray:
        """Number of the segment of every element in each mirror image, (mirrored, elements).

        The mesh itself comes first. Elements without a segment have 0.
        """
        order = image_planes(self.planes)
        number = np.zeros((len(order), self.mesh.nelements), dtype=np.int64)
        for name, members in (self.mesh.subdomains or {}).items():
            segment = named_segment(name)
            if segment is not None:
                number[order.index(segment[1]), members] = segment[0]
        return number

    @cached_property
    def _sides(self) -> AnyArray:
        """A number for each part of the electrode and one for bare film, shape (elements,)."""
        return np.where(self.covered[:, 0] > 0, 1 + self.segments, 0)

    @cached_property
    def interface(self) -> AnyArray:
        """Nodes between different parts of the electrode, or of electrode and bare film, (n,)."""
        sides = np.broadcast_to(self._sides[:, None], self.connectivity.shape)
        low = np.full(len(self.reference), self._sides.max(initial=0))
        high = np.zeros_like(low)
        np.minimum.at(low, self.connectivity, sides)
        np.maximum.at(high, self.connectivity, sides)
        nodes: AnyArray = np.flatnonzero(low < high)
        return nodes

    def boundary_nodes(self, name: str) -> AnyArray:
        """Find the nodes on a named boundary; empty if the mesh has none of that name."""
        return self.boundaries.get(name, np.array([], dtype=int))

    @property
    def plate_nodes(self) -> AnyArray:
        """Nodes on the plate's edge."""
        return self.boundary_nodes("plate")

    @property
    def connectivity(self) -> AnyArray:
        """Nodes of the elements, shape (elements, local)."""
        return self.unknowns.connectivity

    @property
    def free(self) -> tuple[AnyArray, AnyArray]:
        """Index of the unknowns among nodal components, as :attr:`Unknowns.free`."""
        return self.unknowns.free

    @property
    def free_count(self) -> int:
        """Number of nodal components that are unknowns."""
        return len(self.free[0])

    def deformation(self, positions: AnyArray) -> AnyArray:
        """Compute F at the quadrature points, (elements, points, 3, 2), from positions (nodes, 3).

        Positions of several states, (states, nodes, 3), give F with the states first.
        """
        return deformation(self.gradients, positions[..., self.connectivity, :])

    def scatter(self, elements: AnyArray, nodes: AnyArray | None = None) -> AnyArray:
        """Sum vectors of elements, (elements, local, components), to (nodes, components).

        ``nodes`` are those of the elements, by default of all elements of the mesh.
        """
        if np.iscomplexobj(elements):
            return self.scatter(elements.real, nodes) + 1j * self.scatter(elements.imag, nodes)
        nodes = self.connectivity if nodes is None else nodes
        result = np.empty((len(self.reference), elements.shape[-1]))
        for axis in range(elements.shape[-1]):
            result[:, axis] = np.bincount(nodes.ravel(), elements[..., axis].ravel(), len(result))
        return result

    def plate_coupling(self, elements: AnyArray, gradient: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Compute the tangent's columns for motions of the plate: free rows, and the corner.

        ``elements`` are node-major tangents (elements, 3 local, 3 local); ``gradient`` is the
        motion of the plate's nodes by p freedoms, (plate nodes, 3, p).
        """
        touching, rows = self._plate_elements
        freedoms = gradient.shape[2]
        padded = np.concatenate([gradient, np.zeros((1, 3, freedoms))])
        local = padded[rows].reshape(len(touching), 3 * rows.shape[1], freedoms)
        product = np.matmul(elements[touching], local)
        corner = np.tensordot(local, product, axes=((0, 1), (0, 1)))
        border = self.scatter(product.reshape(*rows.shape, 3 * freedoms),
                              self.connectivity[touching])
        return border.reshape(*self.reference.shape, freedoms)[self.free], corner

    @cached_property
    def _plate_elements(self) -> tuple[AnyArray, AnyArray]:
        """Elements with plate nodes; their nodes' rows in ``plate_nodes``, or its length."""
        row = np.full(len(self.reference), len(self.plate_nodes))
        row[self.plate_nodes] = np.arange(len(self.plate_nodes))
        rows = row[self.connectivity]
        touching = np.flatnonzero((rows < len(self.plate_nodes)).any(axis=1))
        return touching, rows[touching]

    @cached_property
    def electrode_edge(self) -> ElectrodeEdge:
        """The line between covered and bare elements."""
        return ElectrodeEdge.of(self.connectivity, self.covered[:, 0] > 0, self.nodal_gradients,
                                self.mesh.order)

    @cached_property
    def recovery(self) -> Recovery:
        """Values at the corners of elements from those at the quadrature points around."""
        places = np.matmul(self.shapes, self.reference[self.connectivity])[..., :2]
        return Recovery(self.connectivity, self._sides, self.reference[:, :2], places,
                        self.mesh.order)

    def nodal_matrix(self, elements: AnyArray) -> Any:
        """Sum element matrices (elements, local, local) to a sparse one, shape (nodes, nodes)."""
        nodes = self.connectivity
        rows, columns = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
        shape = (len(self.reference),) * 2
        return coo_matrix((elements.ravel(), (rows.ravel(), columns.ravel())), shape=shape).tocsr()
