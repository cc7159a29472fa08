"""Meshes that move with a length of frame, plate or electrode, for derivatives by shape.

Nodes on the edges of frame, plate and electrode move with those edges. The other nodes move by the
mean of the edges' motions, weighted by inverse squared distance (Shepard's interpolation; for
meshes Luke, Collins & Blades, *J. Comput. Phys.* 231, 2012). Between two edges that is almost
linear. The derivative of a discrete result by a length then is exact. In the limit of fine meshes
it depends only on how the edges move across themselves, not on how nodes slide along them or move
between them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.paths import with_change
from tympan.fem.complex_step import STEP
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.outlines import Outline
from tympan.geometry.outlines.curve import Foot
from tympan.geometry.specimen import Specimen

#: Number of pairs of a node and an edge node that are weighed at once.
_AT_ONCE = 1 << 17

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

    InputError where an edge of the electrode runs into another edge, so that nodes would have to
    slide along it, or where the film's stress is infinite at a sharp corner.
    """
    edges, stepped = _edges(specimen), _edges(lengthened(specimen, path, 1j * STEP))
    moving = {name: stepped[name] for name in edges if edges[name] != stepped[name]}
    return _extended(discretisation, {
        name: edge.at(_foot(discretisation, specimen, name)).imag / STEP
        for name, edge in moving.items()}, edge_nodes(discretisation, specimen))


@lru_cache(maxsize=32)
def lengthened(specimen: Specimen, path: tuple[str, ...], change: complex) -> Specimen:
    """Change the length at a path [m] of a specimen by a real or imaginary amount."""
    changed: Specimen = with_change(specimen, path, change)
    return changed


def motion_between(discretisation: Discretisation, specimen: Specimen, other: Specimen) -> AnyArray:
    """Compute the motion of the nodes to a specimen of other lengths, (nodes, 2) [m].

    Nodes on an edge end on the other specimen's edge, even where that bends with its lengths.
    """
    edges, others = _edges(specimen), _edges(other)
    feet = {name: _foot(discretisation, specimen, name) for name in edges}
    return _extended(discretisation, {
        name: others[name].at(foot) - edges[name].at(foot) for name, foot in feet.items()},
        edge_nodes(discretisation, specimen))


def with_plate(discretisation: Discretisation, motion: AnyArray) -> AnyArray:
    """Extend the motion of the plate's edge, (·, 2) [m], to all nodes; the frame's edge rests."""
    nodes = {"plate": discretisation.plate_nodes, "frame": discretisation.boundary_nodes("frame")}
    return _extended(discretisation, {"plate": motion}, nodes)


def _extended(discretisation: Discretisation, motions: Mapping[str, AnyArray],
              nodes: Mapping[str, AnyArray]) -> AnyArray:
    """Extend the motion of nodes on some edges to all nodes; the other edges rest."""
    result = np.zeros((len(discretisation.reference), 2))
    for name, motion in motions.items():
        result[nodes[name]] = motion
    if result.any():
        places = discretisation.reference[:, :2]
        edges = np.zeros(len(places), dtype=bool)
        edges[np.concatenate([*nodes.values()])] = True
        images = _images(discretisation.planes)
        sources, moved = ((of[edges] * images).reshape(-1, 2) for of in (places, result))
        # A node on a mirror plane is its own image and counts once.
        apart = np.abs(places[edges]) > _ON_PLANE * np.ptp(places)
        counted = (apart | (images > 0)).all(axis=-1).ravel()
        result[~edges] = _interpolated(places[~edges], sources[counted], moved[counted])
    return result


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
    """Find the nodes on each edge; raises what :func:`velocity` does."""
    _refuse_notches(specimen)
    edges, places = _edges(specimen), discretisation.reference[:, :2]
    nodes: dict[str, AnyArray] = {name: discretisation.boundary_nodes(name)
                               for name in ("frame", "plate") if name in edges}
    inner = discretisation.electrode_edge.every
    if len(inner):
        here = places[inner]
        miss = np.stack([np.linalg.norm(edge.at(edge.foot(here)) - here, axis=1)
                         for edge in edges.values()])
        close = miss < 1e-6 * max(specimen.frame.semi_axes)
        if (np.count_nonzero(close, axis=0) > 1).any():
            raise InputError("must have an edge of its own, away from plate, frame and margins, "
                             "whose nodes could not follow both", key="electrode",
                             given=str(specimen.electrode.outline))
        owner = miss.argmin(axis=0)
        nodes |= {name: inner[owner == number] for number, name in enumerate(edges)
                  if name not in nodes}
    return nodes


@lru_cache(maxsize=32)
def _foot(discretisation: Discretisation, specimen: Specimen, name: str) -> Foot:
    """Project the nodes of an edge onto it."""
    nodes = edge_nodes(discretisation, specimen)[name]
    return _edges(specimen)[name].foot(discretisation.reference[nodes, :2])


@dataclass(frozen=True)
class Edge:
    """A curve at a distance from an outline, outwards if positive [m]."""

    outline: Outline
    centre: tuple[Any, Any]
    distance: Any = 0.0

    def foot(self, places: AnyArray) -> Foot:
        """Find the nearest points on the outline."""
        return self.outline.curve.foot(places - np.array(self.centre))

    def at(self, foot: Foot) -> AnyArray:
        """Evaluate points of the curve, shape (n, 2) [m]."""
        value, slope = self.outline.curve.at(foot)
        length = np.sqrt((slope * slope).sum(axis=1, keepdims=True))
        normal = np.column_stack([slope[:, 1], -slope[:, 0]]) / length
        points: AnyArray = value + np.array(self.centre) + self.distance * normal
        return points


def _edges(specimen: Specimen) -> dict[str, Edge]:
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
