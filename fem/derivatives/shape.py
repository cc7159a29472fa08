"""Meshes that move with a length of frame, plate or electrode, so that results can be differentiated by their shape.

Nodes on the edges of frame, plate and electrode move as those edges do; the others follow smoothly
(a harmonic extension). The derivative of a discrete result by a length then is exact. In the limit
of fine meshes it depends only on how the edges move across themselves, not on how nodes slide along
them or move between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.errors import InputError
from tympan.geometry.mesh import CurvedTriangles
from tympan.geometry.outlines import Outline, area
from tympan.geometry.outlines.curve import Foot
from tympan.geometry.specimen import Specimen

Array = NDArray[Any]

_STEP = 1e-40


def moved_by(model: Model, state: State, specimen: Specimen, motion: Array) -> tuple[Model, State]:
    """The same elements with their nodes elsewhere, and the state of the same displacements.

    Parameters
    ----------
    specimen
        The specimen of that shape.
    motion
        Of the nodes in the plane (nodes, 2) [m], real or imaginary.
    """
    nodes = model.reference[:, :2] + motion
    if np.iscomplexobj(nodes):
        moved = model.with_loading(model.loading)
        for name in ("gradients", "weights"):
            vars(moved).pop(name, None)
        vars(moved).update(_geometry(model, specimen, nodes))
    else:
        moved = replace(model, specimen=specimen, mesh=_mesh(model.mesh, nodes))
    displaced = state.positions + np.column_stack([motion, np.zeros(len(motion))])
    return moved, replace(state, positions=moved.place(displaced, state.plate))


def velocities(model: Model) -> Velocities:
    """Those of a model, kept with what else depends on its mesh alone."""
    kept: Velocities = vars(model).setdefault("velocities", Velocities(model))
    return kept


@dataclass(frozen=True)
class Velocities:
    """How fast the nodes of a model move with a length of its shape."""

    model: Model
    _known: dict[tuple[str, ...], Array] = field(default_factory=dict, repr=False, compare=False)

    def of(self, path: Sequence[str]) -> Array:
        """Motion of the nodes in the plane per unit of the length at a path of the specimen, shape (nodes, 2).

        Raises
        ------
        InputError
            Where an edge of the electrode runs into another edge, so that nodes would have to slide
            along it, or where the film's stress is infinite at a sharp corner.
        """
        key = tuple(path)
        if key not in self._known:
            self._known[key] = self._new(key)
        return self._known[key]

    def _new(self, path: tuple[str, ...]) -> Array:
        from tympan.fem.derivatives.parameters import with_change

        specimen = self.model.specimen
        edges, stepped = _edges(specimen), _edges(with_change(specimen, path, 1j * _STEP))
        known = np.zeros((len(self._places), 2))
        for name, (nodes, foot) in self._feet.items():
            if edges[name] != stepped[name]:
                known[nodes] = stepped[name].at(foot).imag / _STEP
        return np.column_stack([self._extended(axis, known[:, axis]) for axis in range(2)])

    def towards(self, specimen: Specimen) -> Array:
        """Motion of the nodes in the plane to a specimen with the same edges, of other lengths; shape (nodes, 2).

        Nodes on an edge end on the other specimen's edge, however that bends with its lengths.
        """
        edges, others = _edges(self.model.specimen), _edges(specimen)
        known = np.zeros((len(self._places), 2))
        for name, (nodes, foot) in self._feet.items():
            known[nodes] = others[name].at(foot) - edges[name].at(foot)
        return np.column_stack([self._extended(axis, known[:, axis]) for axis in range(2)])

    def check(self) -> None:
        """Raise what :meth:`of` would."""
        _ = self._feet

    @cached_property
    def _places(self) -> Array:
        return np.asarray(self.model.reference[:, :2])

    @cached_property
    def _feet(self) -> dict[str, tuple[Array, Foot]]:
        """Nodes on each edge, and where along it."""
        model, edges = self.model, _edges(self.model.specimen)
        _refuse_notches(model.specimen)
        rims = {name: model.boundary_nodes(name) for name in ("frame", "plate")}
        inner = _electrode_nodes(model)
        if len(inner):
            places = self._places[inner]
            miss = np.stack([np.linalg.norm(edge.at(edge.foot(places)) - places, axis=1)
                             for edge in edges.values()])
            if (np.count_nonzero(miss < 1e-6 * model.size, axis=0) > 1).any():
                raise InputError("must have an edge of its own, away from plate, frame and margins, whose nodes could "
                                 "not follow both", key="electrode",
                                 given=str(model.specimen.electrode.outline))
            owner = miss.argmin(axis=0)
            rims |= {name: inner[owner == number] for number, name in enumerate(edges)
                     if name not in rims}
        return {name: (nodes, edges[name].foot(self._places[nodes]))
                for name, nodes in rims.items()}

    def _extended(self, axis: int, known: Array) -> Array:
        """The harmonic extension of one component; it vanishes on the mirror plane across it."""
        factor, matrix, free, fixed = self._laplacians[axis]
        result = known.copy()
        result[free] = factor.solve(-(matrix @ known[fixed]))
        return result

    @cached_property
    def _laplacians(self) -> list[tuple[Any, Any, Array, Array]]:
        """For both components: the factorised Laplacian, its coupling to what is known, free and known nodes."""
        model = self.model
        laplacian = _laplacian(model)
        edges = [nodes for nodes, _ in self._feet.values()]
        result: list[tuple[Any, Any, Array, Array]] = []
        for axis in "xy":
            still = [model.boundary_nodes(f"axis_{'y' if axis == 'x' else 'x'}")] if axis in model.planes else []
            if result and not still and not model.planes:
                return [*result, result[0]]
            known = np.zeros(len(self._places), dtype=bool)
            known[np.concatenate([*edges, *still])] = True
            free, fixed = np.flatnonzero(~known), np.flatnonzero(known)
            rows = laplacian[free]
            factor = splu(rows[:, free].tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                          options={"SymmetricMode": True})
            result.append((factor, rows[:, fixed], free, fixed))
        return result


@dataclass(frozen=True)
class Edge:
    """A curve at a distance from an outline, outwards if positive [m]."""

    outline: Outline
    centre: tuple[Any, Any]
    distance: Any = 0.0

    def foot(self, places: Array) -> Foot:
        """Where on the outline the nearest points are."""
        return self.outline.curve.foot(places - np.array(self.centre))

    def at(self, foot: Foot) -> Array:
        """Points of the curve, shape (n, 2) [m]."""
        value, slope = self.outline.curve.at(foot)
        length = np.sqrt((slope * slope).sum(axis=1, keepdims=True))
        normal = np.column_stack([slope[:, 1], -slope[:, 0]]) / length
        return value + np.array(self.centre) + self.distance * normal


def _edges(specimen: Specimen) -> dict[str, Edge]:
    """The edges nodes may lie on, by name."""
    electrode, plate = specimen.electrode, specimen.plate
    edges = {"frame": Edge(specimen.frame, (0.0, 0.0)), "plate": Edge(plate.outline, plate.offset)}
    if electrode.margin_frame != 0:
        edges["margin_frame"] = Edge(specimen.frame, (0.0, 0.0), -electrode.margin_frame)
    if electrode.margin_plate != 0:
        edges["margin_plate"] = Edge(plate.outline, plate.offset, electrode.margin_plate)
    if electrode.outline is not None:
        edges["electrode"] = Edge(electrode.outline.outline, electrode.outline.offset)
    return edges


def _refuse_notches(specimen: Specimen) -> None:
    """Sharp corners of the plate, or of the frame into the film, make derivatives by lengths converge too slowly."""
    for key, outline, inwards in (("plate", specimen.plate.outline, 1),
                                  ("frame", specimen.frame, -1)):
        turns = inwards * outline.curve.turns()
        if turns.max() > 1e-3:
            x, y = 1e3 * outline.curve.starts[int(turns.argmax())]
            raise InputError(f"must be rounded for derivatives by lengths: at the sharp corner at {x:.4g}, {y:.4g} mm "
                             "the film's stress has no limit", key=key, given=outline.shape)


def _electrode_nodes(model: Model) -> Array:
    """Nodes between what is covered and what is bare."""
    mesh = model.mesh
    bare = model.covered[:, 0] == 0
    inside = np.flatnonzero(mesh.f2t[1] >= 0)
    first, second = mesh.f2t[:, inside]
    facets = inside[bare[first] != bare[second]]
    return model.basis.get_dofs(facets).flatten() if len(facets) else np.array([], dtype=int)


def _laplacian(model: Model) -> Any:
    """∫ ∇φ·∇φ dX, sparse by rows."""
    gradients = model.gradients
    elements, points, local, _ = gradients.shape
    flat = gradients.transpose(0, 2, 1, 3).reshape(elements, local, 2 * points)
    entries = np.matmul(flat * np.repeat(model.weights, 2, axis=1)[:, None],
                        flat.transpose(0, 2, 1))
    nodes = model.connectivity
    rows, columns = np.repeat(nodes, local, axis=1).ravel(), np.tile(nodes, local).ravel()
    return coo_matrix((entries.ravel(), (rows, columns)), shape=(len(model.reference),) * 2).tocsr()


def _geometry(model: Model, specimen: Specimen, nodes: Array) -> dict[str, Array]:
    """What a model has of its geometry, for complex nodes and lengths; the rest follows when it is asked for."""
    centre = np.array([*specimen.plate.offset, 0.0])
    reference = np.column_stack([nodes, np.zeros(len(nodes))])
    same = specimen.plate.outline is model.specimen.plate.outline
    plate_area = model.plate_area if same else area(specimen.plate.outline)
    return {"reference": reference, "centre": centre, "plate_area": plate_area,
            "arms": reference[model.plate_nodes] - centre}


def _mesh(mesh: CurvedTriangles, nodes: Array) -> CurvedTriangles:
    """The same elements with their nodes elsewhere, tags kept."""
    moved = CurvedTriangles(np.ascontiguousarray(nodes.T), mesh.t, elem=mesh.elem, validate=False)
    return moved.with_boundaries(mesh.boundaries or {}).with_subdomains(mesh.subdomains or {})
