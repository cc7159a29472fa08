"""Meshes that move with a length of frame, plate or electrode, for derivatives by shape.

Nodes on the edges of frame, plate and electrode move with those edges. Where edges cross, a node
moves to the new crossing: it slides along both. The nodes of an edge between its crossings slide
along it by what its crossings do, weighted by inverse squared distance. The other nodes move by the
mean of the edges' motions, weighted alike (Shepard's interpolation; for meshes Luke, Collins &
Blades, *J. Comput. Phys.* 231, 2012). Between two edges that is almost linear. The derivative of a
discrete result by a length then is exact. In the limit of fine meshes it depends only on how the
edges move across themselves, not on how nodes slide along them or move between them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray, Mask
from tympan.base.errors import InputError
from tympan.base.paths import with_change
from tympan.fem.complex_step import STEP
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.outlines import Outline
from tympan.geometry.outlines.curve import Foot
from tympan.geometry.outlines.pieces import normals
from tympan.geometry.specimen import Specimen

#: Number of pairs of a node and an edge node that are weighed at once.
_AT_ONCE = 1 << 17

#: Distance from an edge, over the frame's half extent, within which a node lies on it.
_NEAR = 1e-6

#: Sine of the angle between edges below which they count as parallel.
_PARALLEL = 1e-3
#: Motion of a crossing that its edges do not agree on, over their largest motion: beyond rounding.
_AT_ODDS = 1e-6

#: Distance from the other edges, over the frame's half extent, at which moved nodes are on them.
_LANDED = 1e-13
#: Steps of Newton's method for nodes where edges cross; three or four are usual.
_PROJECTIONS = 20

#: Distance from a mirror plane, over the mesh's extent, within which a node lies on it.
_ON_PLANE = 1e-9


def moved_by(model: Model, state: State, specimen: Specimen, motion: AnyArray) -> tuple[Model,
             State]:
    """Move the nodes of a model's elements, and keep the displacements of its state.

    ``specimen`` has the new shape; ``motion`` is that of the nodes in the plane, shape (nodes, 2)
    [m], real or imaginary.
    """
    moved = replace(model, discretisation=model.discretisation.moved(motion), specimen=specimen)
    displaced = state.positions + np.column_stack([motion, np.zeros(len(motion))])
    return moved, replace(state, positions=moved.place(displaced, state.plate))


@lru_cache(maxsize=32)
def velocity(discretisation: Discretisation, specimen: Specimen, path: tuple[str, ...]) -> AnyArray:
    """Compute the motion of the nodes in the plane per unit of a length, shape (nodes, 2).

    InputError where two edges lie on each other and only one of them moves, or where the film's
    stress is infinite at a sharp corner.
    """
    stepped = lengthened(specimen, path, 1j * STEP)
    moved = _on_edges(discretisation, specimen, edges_of(stepped)).imag / STEP
    return _extended(discretisation, moved, _any_edge(discretisation, specimen))


@lru_cache(maxsize=32)
def lengthened(specimen: Specimen, path: tuple[str, ...], change: complex) -> Specimen:
    """Change the length at a path [m] of a specimen by a real or imaginary amount."""
    changed: Specimen = with_change(specimen, path, change)
    return changed


def motion_between(discretisation: Discretisation, specimen: Specimen, other: Specimen) -> AnyArray:
    """Compute the motion of the nodes to a specimen of other lengths, (nodes, 2) [m].

    Nodes on an edge end on the other specimen's edge, even where that bends with its lengths.
    """
    others, on_edge = edges_of(other), _any_edge(discretisation, specimen)
    motion = _on_edges(discretisation, specimen, others)
    if _crossings(discretisation, specimen).any():
        motion[on_edge] = _settled(discretisation, specimen, others, motion)[on_edge]
    return _extended(discretisation, motion, on_edge)


def with_plate(discretisation: Discretisation, motion: AnyArray) -> AnyArray:
    """Extend the motion of the plate's edge, (·, 2) [m], to all nodes; the frame's edge rests."""
    plate, frame = discretisation.plate_nodes, discretisation.boundary_nodes("frame")
    whole = np.zeros((len(discretisation.reference), 2))
    whole[plate] = motion
    on_edge = np.zeros(len(whole), dtype=bool)
    on_edge[np.concatenate([plate, frame])] = True
    return _extended(discretisation, whole, on_edge)


def _extended(discretisation: Discretisation, motion: AnyArray, on_edge: Mask) -> AnyArray:
    """Extend the motion of the nodes on edges to all nodes, (nodes, 2) each."""
    result: AnyArray = np.where(on_edge[:, None], motion, 0.0)
    if result.any():
        places = discretisation.reference[:, :2]
        sources, moved = _with_images(discretisation, on_edge, result)
        result[~on_edge] = _interpolated(places[~on_edge], sources, moved)
    return result


def _with_images(discretisation: Discretisation, chosen: AnyArray, vectors: AnyArray
                 ) -> tuple[AnyArray, AnyArray]:
    """Collect places and vectors of chosen nodes and of their mirror images, (·, 2) each."""
    places, images = discretisation.reference[:, :2], _images(discretisation.planes)
    sources, imaged = ((of[chosen] * images).reshape(-1, 2) for of in (places, vectors))
    # A node on a mirror plane is its own image and counts once.
    apart = np.abs(places[chosen]) > _ON_PLANE * np.ptp(places)
    counted = (apart | (images > 0)).all(axis=-1).ravel()
    return sources[counted], imaged[counted]


def _images(planes: frozenset[str]) -> AnyArray:
    """List the signs of x and y in the mirrored parts of the whole, shape (parts, 1, 2)."""
    sides = [(1, -1) if axis in planes else (1,) for axis in "xy"]
    return np.array(list(product(*sides)))[:, None]


def _interpolated(places: AnyArray, sources: AnyArray, values: AnyArray) -> AnyArray:
    """Interpolate values from sources to places, all of shape (·, 2): exact if they are affine.

    The rest of the best affine function is averaged by inverse squared distance. Squared distances
    come from one product of matrices: its rounding changes no derivative.
    """
    near, far = _lifted(places), _lifted(sources)
    basis = far[:, :3]
    affine = np.linalg.solve(basis.T @ basis, basis.T @ values)
    summed = np.column_stack([values - basis @ affine, basis[:, 2]])
    squares = _SQUARE @ far.T
    result = near[:, :3] @ affine
    step = 1 + _AT_ONCE // len(sources)
    for part in (slice(start, start + step) for start in range(0, len(places), step)):
        weighted = np.reciprocal(near[part] @ squares) @ summed
        result[part] += weighted[:, :2] / weighted[:, 2:]
    return result


#: The squared distance of two points as a form of (x, y, 1, x² + y²) of both.
_SQUARE = np.array([[-2, 0, 0, 0], [0, -2, 0, 0], [0, 0, 0, 1], [0, 0, 1, 0]], dtype=float)


def _lifted(places: AnyArray) -> AnyArray:
    """Lift each place to x, y, 1, x² + y²."""
    return np.column_stack([places, np.ones(len(places)), (places * places).sum(axis=1)])


@lru_cache(maxsize=8)
def edge_nodes(discretisation: Discretisation, specimen: Specimen) -> dict[str, AnyArray]:
    """Find the nodes on each edge; a node where edges cross is on all of them.

    InputError where the film's stress is infinite at a sharp corner.
    """
    _refuse_notches(specimen)
    edges, places = edges_of(specimen), discretisation.reference[:, :2]
    nodes: dict[str, AnyArray] = {name: discretisation.boundary_nodes(name)
                               for name in ("frame", "plate") if name in edges}
    inner = discretisation.interface
    here = places[inner]
    near = _NEAR * max(specimen.frame.semi_axes)
    miss = {name: edge.miss(here, specimen) for name, edge in edges.items() if name not in nodes}
    # Each node is on one edge at least: an outline's polygon may pass a drawn curve by more.
    alone = np.ones(len(inner), dtype=bool)
    for name in nodes:
        alone = alone & np.isin(inner, nodes[name], invert=True)
    closest = np.where(alone, np.min([*miss.values()], axis=0, initial=np.inf), 0.0)
    return nodes | {name: inner[away <= np.maximum(near, closest)] for name, away in miss.items()}


@lru_cache(maxsize=8)
def _any_edge(discretisation: Discretisation, specimen: Specimen) -> Mask:
    """Select the nodes on edges, (nodes,)."""
    return np.asarray(_incidence(discretisation, specimen).any(axis=1), dtype=bool)


@lru_cache(maxsize=8)
def _incidence(discretisation: Discretisation, specimen: Specimen) -> Mask:
    """Mask of the edges that each node is on, (nodes, edges)."""
    nodes = edge_nodes(discretisation, specimen)
    incidence = np.zeros((len(discretisation.reference), len(nodes)), dtype=bool)
    for number, members in enumerate(nodes.values()):
        incidence[members, number] = True
    return incidence


@lru_cache(maxsize=8)
def _crossings(discretisation: Discretisation, specimen: Specimen) -> Mask:
    """Select the nodes on several edges, (nodes,)."""
    crossing: Mask = _incidence(discretisation, specimen).sum(axis=1) > 1
    return crossing


@lru_cache(maxsize=8)
def _normals(discretisation: Discretisation, specimen: Specimen) -> AnyArray:
    """Compute the unit normals of the edges at their nodes, (nodes, edges, 2), 0 elsewhere."""
    edges, nodes = edges_of(specimen), edge_nodes(discretisation, specimen)
    across = np.zeros((*_incidence(discretisation, specimen).shape, 2))
    for number, (name, members) in enumerate(nodes.items()):
        across[members, number] = edges[name].normal(_foot(discretisation, specimen, name))
    return across


@lru_cache(maxsize=32)
def _foot(discretisation: Discretisation, specimen: Specimen, name: str) -> Foot:
    """Project the nodes of an edge onto it."""
    nodes = edge_nodes(discretisation, specimen)[name]
    return edges_of(specimen)[name].foot(discretisation.reference[nodes, :2])


def _on_edges(discretisation: Discretisation, specimen: Specimen, others: Mapping[str, Edge]
              ) -> AnyArray:
    """Compute the motion of the nodes on edges to other edges, to first order, (nodes, 2) [m].

    Nodes keep their places along an edge, but for what its crossings slide.
    """
    edges, nodes = edges_of(specimen), edge_nodes(discretisation, specimen)
    own = {name: others[name].at(foot) - edges[name].at(foot) for name in nodes
           for foot in [_foot(discretisation, specimen, name)]}
    motion = np.zeros((len(discretisation.reference), 2),
                      np.result_type(float, *(part.dtype for part in own.values())))
    # Of several edges, the first in the list gives the motion; frame and plate come first.
    for name in reversed(nodes):
        motion[nodes[name]] = own[name]
    crossing = np.flatnonzero(_crossings(discretisation, specimen))
    if not len(crossing):
        return motion
    across = _normals(discretisation, specimen)
    wanted = np.zeros(across.shape[:2], motion.dtype)
    for number, (name, members) in enumerate(nodes.items()):
        wanted[members, number] = (across[members, number] * own[name]).sum(axis=-1)
    motion[crossing] += _met(across[crossing], wanted[crossing], motion[crossing])
    for name, members in nodes.items():
        _slide(discretisation, specimen, name, motion, motion[members] - own[name])
    return motion


def _met(across: AnyArray, wanted: AnyArray, motion: AnyArray) -> AnyArray:
    """Compute the smallest further motion that meets all edges, (n, 2) [m].

    ``across``: unit normals (n, edges, 2); ``wanted`` (n, edges): motion along each of them.
    """
    left = wanted - (across @ motion[..., None])[..., 0]
    more: AnyArray = (np.linalg.pinv(across, rcond=_PARALLEL) @ left[..., None])[..., 0]
    rest = np.abs(left - (across @ more[..., None])[..., 0])
    if rest.max() > _AT_ODDS * max(np.abs(wanted).max(), np.abs(motion).max()):
        raise InputError("has edges that lie on each other or touch, and only one of them moves: "
                         "leave bare film between them, such as by electrode.gap",
                         key="electrode")
    return more


def _slide(discretisation: Discretisation, specimen: Specimen, name: str, motion: AnyArray,
           slides: AnyArray) -> None:
    """Slide the nodes of an edge between its crossings along it, as these slide (edge's nodes, 2).

    ``motion`` (nodes, 2) [m] is changed in place.
    """
    members = edge_nodes(discretisation, specimen)[name]
    crossing = _crossings(discretisation, specimen)[members]
    if not slides[crossing].any() or crossing.all():
        return
    vectors = np.zeros_like(motion)
    vectors[members] = slides
    sources, values = _with_images(discretisation, members[crossing], vectors)
    # The mirror image of a node may lie on the edge of another segment.
    away = edges_of(specimen)[name].miss(sources, specimen)
    here = away <= _NEAR * max(specimen.frame.semi_axes)
    sources, values = sources[here], values[here]
    between = members[~crossing]
    apart = discretisation.reference[between, None, :2] - sources
    weights = 1 / (apart**2).sum(axis=-1)
    slid = (weights @ values) / weights.sum(axis=1, keepdims=True)
    number = [*edge_nodes(discretisation, specimen)].index(name)
    normal = _normals(discretisation, specimen)[between, number]
    motion[between] += slid - normal * (normal * slid).sum(axis=1, keepdims=True)


def _settled(discretisation: Discretisation, specimen: Specimen, others: Mapping[str, Edge],
             motion: AnyArray) -> AnyArray:
    """Move nodes near other edges onto them, by Newton's method: their motion, (nodes, 2) [m]."""
    nodes = edge_nodes(discretisation, specimen)
    on_edge = np.flatnonzero(_any_edge(discretisation, specimen))
    row = np.zeros(len(motion), dtype=int)
    row[on_edge] = np.arange(len(on_edge))
    motion, places = motion.copy(), discretisation.reference[:, :2]
    size = max(specimen.frame.semi_axes)
    for _ in range(_PROJECTIONS):
        across = np.zeros((len(on_edge), len(nodes), 2))
        left = np.zeros(across.shape[:2])
        for number, (name, members) in enumerate(nodes.items()):
            here = places[members] + motion[members]
            foot = others[name].foot(here)
            normal = across[row[members], number] = others[name].normal(foot)
            left[row[members], number] = ((others[name].at(foot) - here) * normal).sum(axis=1)
        if np.abs(left).max() < _LANDED * size:
            return motion
        motion[on_edge] += (np.linalg.pinv(across, rcond=_PARALLEL) @ left[..., None])[..., 0]
    raise InputError("has edges that no longer meet: change its lengths less", key="electrode")


@dataclass(frozen=True)
class Edge:
    """A curve at a distance from an outline, outwards if positive [m].

    ``segment``: number of the electrode's segment of whose region alone it is an edge.
    """

    outline: Outline
    centre: tuple[Any, Any]
    distance: Any = 0.0
    segment: int | None = None

    def foot(self, places: AnyArray) -> Foot:
        """Find the nearest points on the outline."""
        return self.outline.curve.foot(places - np.array(self.centre))

    def at(self, foot: Foot) -> AnyArray:
        """Evaluate points of the curve, shape (n, 2) [m]."""
        value, slope = self.outline.curve.at(foot)
        points: AnyArray = value + np.array(self.centre) + self.distance * normals(slope)
        return points

    def normal(self, foot: Foot) -> AnyArray:
        """Compute unit normals, shape (n, 2)."""
        return normals(self.outline.curve.at(foot)[1]).real

    def miss(self, places: AnyArray, specimen: Specimen) -> AnyArray:
        """Measure the distance of places to the edge, (n,) [m]; inf beside its segment."""
        miss: AnyArray = np.linalg.norm(self.at(self.foot(places)) - places, axis=1)
        if self.segment is None:
            return miss
        electrode, near = specimen.electrode, _NEAR * max(specimen.frame.semi_axes)
        segment = electrode.segments[self.segment]
        x, y = places.T
        level = segment.level(x, y, specimen.frame, electrode.gap)
        return np.where(np.abs(level) < near, miss, np.inf)


@dataclass(frozen=True)
class Ray(Edge):
    """A straight edge of a sector, from ``centre`` in a direction ``angle`` [rad]."""

    angle: Any = 0.0

    @property
    def _along(self) -> AnyArray:
        return np.array([np.cos(self.angle), np.sin(self.angle)])

    def foot(self, places: AnyArray) -> Foot:
        """Find the nearest points by their distance from the start [m]."""
        away = np.maximum((places - np.array(self.centre)) @ self._along, 0.0)
        return np.zeros(len(places), dtype=int), away

    def at(self, foot: Foot) -> AnyArray:
        """Evaluate points of the ray, shape (n, 2) [m]."""
        points: AnyArray = np.array(self.centre) + foot[1][:, None] * self._along
        return points

    def normal(self, foot: Foot) -> AnyArray:
        """Compute unit normals, shape (n, 2)."""
        return np.broadcast_to(normals(self._along[None]).real, (len(foot[1]), 2))


@lru_cache(maxsize=64)
def edges_of(specimen: Specimen) -> dict[str, Edge]:
    """List the edges of frame, plate and electrode that the mesh follows, by name."""
    electrode, plate = specimen.electrode, specimen.plate
    edges = {"frame": Edge(specimen.frame, (0.0, 0.0))}
    if plate is not None:
        edges["plate"] = Edge(plate.outline, plate.offset)
    if electrode.margin_frame != 0:
        edges["margin_frame"] = Edge(specimen.frame, (0.0, 0.0), -electrode.margin_frame)
    if plate is not None and electrode.margin_plate != 0:
        edges["margin_plate"] = Edge(plate.outline, plate.offset, electrode.margin_plate)
    if electrode.outline is not None:
        edges["electrode"] = Edge(electrode.outline.outline, electrode.outline.offset)
    for number, segment in enumerate(electrode.segments):
        key = f"segment {number}"
        if segment.outline is not None:
            edges[f"{key} outline"] = Edge(segment.outline.outline, segment.outline.offset,
                                           segment=number)
        for end, distance in enumerate(segment.within(electrode.gap)):
            if 0 < np.real(distance) < np.inf:
                edges[f"{key} band {end}"] = Edge(specimen.frame, (0.0, 0.0), -distance, number)
        for end, angle in enumerate(segment.sector or ()):
            edges[f"{key} sector {end}"] = Ray(
                specimen.frame, tuple(segment.apex(electrode.gap)), segment=number, angle=angle)
    return edges


@lru_cache(maxsize=64)
def _refuse_notches(specimen: Specimen) -> None:
    """Refuse sharp corners into the film: derivatives by lengths converge too slowly there."""
    edges: list[tuple[str, Outline, int]] = [("frame", specimen.frame, -1)]
    if specimen.plate is not None:
        edges.insert(0, ("plate", specimen.plate.outline, 1))
    for key, outline, inwards in edges:
        turns = inwards * outline.curve.turns()
        if turns.max() > 1e-3:
            x, y = 1e3 * outline.curve.starts[int(turns.argmax())]
            raise InputError("must be rounded for derivatives by lengths: at the sharp corner at "
                             f"{x:.4g}, {y:.4g} mm the film's stress has no limit",
                             key=key, given=outline.shape)
