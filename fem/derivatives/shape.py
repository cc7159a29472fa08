"""Meshes that move with a length of frame, plate or electrode, for derivatives by shape.

Nodes on the edges of frame, plate and electrode move as those edges do; the others follow smoothly
(a harmonic extension). The derivative of a discrete result by a length then is exact. In the limit
of fine meshes it depends only on how the edges move across themselves, not on how nodes slide along
them or move between them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.complex_step import STEP
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import Outline
from tympan.geometry.outlines.curve import Foot
from tympan.geometry.paths import with_change
from tympan.geometry.specimen import Specimen

Array = NDArray[Any]


def moved_by(model: Model, state: State, specimen: Specimen, motion: Array) -> tuple[Model, State]:
    """The same elements with their nodes elsewhere, and the state of the same displacements.

    ``specimen`` has that shape; ``motion`` of the nodes in the plane, shape (nodes, 2) [m], is real
    or imaginary.
    """
    moved = replace(model, discretisation=model.discretisation.moved(motion), specimen=specimen)
    displaced = state.positions + np.column_stack([motion, np.zeros(len(motion))])
    return moved, replace(state, positions=moved.place(displaced, state.plate))


@lru_cache(maxsize=32)
def velocity(discretisation: Discretisation, specimen: Specimen, path: tuple[str, ...]) -> Array:
    """Motion of the nodes in the plane per unit of the length at a path, shape (nodes, 2).

    InputError where an edge of the electrode runs into another edge, so that nodes would have to
    slide along it, or where the film's stress is infinite at a sharp corner.
    """
    edges, stepped = _edges(specimen), _edges(with_change(specimen, path, 1j * STEP))
    return _extended(discretisation,
                     [(nodes, stepped[name].at(foot).imag / STEP) for name, (nodes, foot)
                      in edge_nodes(discretisation, specimen).items()
                      if edges[name] != stepped[name]])


def motion_between(discretisation: Discretisation, specimen: Specimen, other: Specimen) -> Array:
    """Motion of the nodes to a specimen with the same edges of other lengths, (nodes, 2) [m].

    Nodes on an edge end on the other specimen's edge, however that bends with its lengths.
    """
    edges, others = _edges(specimen), _edges(other)
    return _extended(discretisation,
                     [(nodes, others[name].at(foot) - edges[name].at(foot)) for name, (nodes, foot)
                      in edge_nodes(discretisation, specimen).items()])


def _extended(discretisation: Discretisation, motions: list[tuple[Array, Array]]) -> Array:
    """The motion of all nodes from those of nodes on some edges; the other edges rest."""
    given = np.zeros((len(discretisation.reference), 2))
    for nodes, motion in motions:
        given[nodes] = motion
    return discretisation.extended(given)


@lru_cache(maxsize=8)
def edge_nodes(discretisation: Discretisation, specimen: Specimen
               ) -> dict[str, tuple[Array, Foot]]:
    """Nodes on each edge, and where along it; raises what :func:`velocity` does."""
    _refuse_notches(specimen)
    edges, places = _edges(specimen), discretisation.reference[:, :2]
    nodes: dict[str, Array] = {name: discretisation.boundary_nodes(name)
                               for name in ("frame", "plate") if name in edges}
    inner = discretisation.electrode_edge_nodes
    if len(inner):
        miss = np.stack([np.linalg.norm(edge.at(edge.foot(places[inner])) - places[inner], axis=1)
                         for edge in edges.values()])
        close = miss < 1e-6 * max(specimen.frame.semi_axes)
        if (np.count_nonzero(close, axis=0) > 1).any():
            raise InputError("must have an edge of its own, away from plate, frame and margins, "
                             "whose nodes could not follow both", key="electrode",
                             given=str(specimen.electrode.outline))
        owner = miss.argmin(axis=0)
        nodes |= {name: inner[owner == number] for number, name in enumerate(edges)
                  if name not in nodes}
    return {name: (there, edges[name].foot(places[there])) for name, there in nodes.items()}


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
        return np.asarray(value + np.array(self.centre) + self.distance * normal)


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
    """Sharp corners into the film make derivatives by lengths converge too slowly."""
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
