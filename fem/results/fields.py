"""Results of solved films: fields at points, and integrals over the film.

Fields are computed within each element and not averaged, so jumps between neighbours show the
discretisation error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.fem.discretisation.assembly import first_piola
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.isoparametric import (
    deformation,
    isoparametric,
    middles,
    tabulated,
)
from tympan.fem.film.density import FilmDensity
from tympan.fem.film.memory import Flow
from tympan.fem.film.tension_field import Tension, tension_state
from tympan.fem.membrane.model import Model, cauchy_green
from tympan.fem.membrane.state import State
from tympan.geometry.mesh import ELEMENTS, unfold
from tympan.geometry.specimen import Film

#: Starts and directions of a reference triangle's edges, in scikit-fem's order 01, 12, 02.
_EDGES = (((0, 0), (1, 0)), ((1, 0), (-1, 1)), ((0, 0), (0, 1)))

#: Distance from the centre, relative to the frame, below which no direction leads there.
_CENTRE = 1e-12

#: Largest drop of a stress between nodes below its nodal values, in their differences.
_BETWEEN = 0.5


@dataclass(frozen=True, eq=False)
class Fields:
    """Fields at points; each array's first axis runs over the points.

    True stresses are elastic minus the Maxwell part; add ``maxwell_stress`` for the elastic part
    alone. The radial direction is the deformed radial fibre through the plate's centre, the
    circumferential one its normal within the film.
    """

    position: AnyArray  #: in the flat mounted film [m], shape (n, 3)
    displacement: AnyArray  #: [m], shape (n, 3)
    stretch_1: AnyArray  #: larger total principal stretch
    stretch_2: AnyArray  #: smaller total principal stretch
    thickness: AnyArray  #: [m]
    electric_field: AnyArray  #: true field U/thickness under the electrode, 0 outside [V/m]
    breakdown_strength: AnyArray  #: field of breakdown [V/m], infinite where unknown
    maxwell_stress: AnyArray  #: ε E² [Pa]
    stress_1: AnyArray  #: larger principal true stress [Pa]
    stress_2: AnyArray  #: smaller principal true stress [Pa]
    stress_radial: AnyArray  #: [Pa]
    stress_circumferential: AnyArray  #: [Pa]
    stress_shear: AnyArray  #: [Pa]
    #: force per mounted length on a cut facing the plate's centre [N/m], (n, 3); see edge_fields
    plate_traction: AnyArray
    tension: AnyArray  #: of :class:`tympan.fem.film.tension_field.Tension`

    @property
    def breakdown_share(self) -> AnyArray:
        """Field over strength: 1 where the film breaks down, 0 where uncovered or unknown."""
        return self.electric_field / self.breakdown_strength

    def __getitem__(self, choice: Any) -> Fields:
        return Fields(*(getattr(self, item.name)[choice] for item in fields(self)))


def largest(values: AnyArray) -> float | None:
    """Find the largest value of a field; None for a film that has no fields."""
    return float(values.max()) if values.size else None


def least(values: AnyArray) -> float | None:
    """Find the smallest value of a field; None for a film that has no fields."""
    return float(values.min()) if values.size else None


@dataclass(frozen=True, eq=False)
class Unfolding:
    """The whole of a film that was meshed in part, for that mesh, even if its nodes move.

    ``origin`` is the node in the part for each node of the whole, (nodes,); ``signs`` are those of
    x and y of a node over those of its origin, (2, nodes).
    """

    part: Discretisation
    full: Discretisation
    origin: AnyArray
    signs: AnyArray

    @classmethod
    def of(cls, part: Discretisation) -> Unfolding:
        """Mirror a part of a film into the whole."""
        full, origin, signs = unfold(part.mesh, part.planes)
        return cls(part, Discretisation.of(full), origin, signs)

    def whole(self, model: Model, state: State) -> tuple[Model, State]:
        """Unfold model and state to the whole film; the model's nodes may have moved."""
        mesh, full, flow = model.discretisation, self.full, model.flow
        positions = state.positions[self.origin]
        positions[:, :2] *= self.signs.T
        if mesh is not self.part:
            motion = (mesh.reference - self.part.reference)[:, :2]
            full = full.moved(motion[self.origin] * self.signs.T)
        if flow is not None:
            flow = _unfolded(flow, mesh, full, self.origin, self.signs)
        return (replace(model, discretisation=full, flow=flow),
                replace(state, positions=positions))


def whole(model: Model, state: State, unfolding: Unfolding | None = None) -> tuple[Model, State]:
    """Unfold model and state to the whole film if only a part of it was meshed.

    ``unfolding`` is that of the model's mesh, if it is known.
    """
    mesh = model.discretisation
    if not mesh.planes:
        return model, state
    return (unfolding or Unfolding.of(mesh)).whole(model, state)


def _unfolded(flow: Flow, part: Discretisation, full: Discretisation, origin: AnyArray,
              signs: AnyArray
              ) -> Flow:
    """Unfold the memory to the whole film; its elements are the part's, then their images."""
    count = len(part.connectivity)
    part_nodes = np.tile(part.connectivity, (len(full.connectivity) // count, 1))
    # The local node of the part for every local node of the whole.
    order = np.argsort(np.argsort(origin[full.connectivity], axis=1), axis=1)
    local = np.take_along_axis(np.argsort(part_nodes, axis=1), order, axis=1)
    elements = np.arange(len(local))[:, None] % count
    turned = signs[:, full.connectivity].min(axis=2).prod(axis=0)
    return flow.at(lambda values: (values @ part.fitted)[..., elements, local] @ full.shapes.T,
                   turned[:, None])


def _flow_at(model: Model, cells: AnyArray, points: AnyArray) -> Flow | None:
    """Continue the memory of the film to reference points of elements by its polynomial."""
    mesh, flow = model.discretisation, model.flow
    shapes = tabulated(mesh.mesh.order, points)[0]
    return None if flow is None else flow.at(
        lambda values: values[..., cells, :] @ mesh.fitted @ shapes)


def cell_fields(model: Model, states: Sequence[State], points: AnyArray) -> list[Fields]:
    """Compute fields of each state at reference points, (2, k), of every element; element-major.

    States are computed together.
    """
    joined = _fields(model, states, np.arange(len(model.discretisation.connectivity)), points)
    count = len(joined.position) // len(states)
    return [joined[number * count : (number + 1) * count] for number in range(len(states))]


def edge_fields(model: Model, state: State, name: str, points: int = 9, *,
                quadrature: bool = False) -> tuple[Fields, AnyArray]:
    """Compute fields along a boundary of the whole film, and the points' weights [m].

    The points lie on every edge of the boundary, edge-major. Weights are quadrature weights times
    mounted arc length: at Gauss points for integrals (``quadrature``), otherwise at equally spaced
    points with both ends, for pictures. On the edges of plate and frame ``plate_traction`` is that
    on the edge itself; elsewhere that on a cut across the line to the plate's centre.
    """
    if quadrature:
        gauss, weight = np.polynomial.legendre.leggauss(points)
        s, weight = (gauss + 1) / 2, weight / 2
    else:
        s, weight = np.linspace(0, 1, points), np.full(points, 1 / points)
    model, state = whole(model, state)
    discretisation, mesh = model.discretisation, model.discretisation.mesh
    boundaries = mesh.boundaries or {}
    if name not in boundaries:
        raise ValueError(f"the mesh has no boundary {name!r}: it has {sorted(boundaries)}")
    parts, weights = [], []
    for local, (start, along) in enumerate(np.array(_EDGES, float)):
        cells = np.flatnonzero(np.isin(mesh.t2f[local], boundaries[name]))
        # An inner edge belongs to two elements: the one that scikit-fem lists first counts.
        cells = cells[mesh.f2t[0][mesh.t2f[local][cells]] == cells]
        if len(cells):
            edge = start[:, None] + s * along[:, None]
            slopes = tabulated(mesh.order, edge)[1] @ along
            nodes = discretisation.reference[discretisation.connectivity[cells], :2]
            tangent = np.matmul(slopes, nodes)
            cut = tangent if name in ("plate", "frame") else None
            parts.append(_fields(model, [state], cells, edge, cut))
            weights.append((np.linalg.norm(tangent, axis=-1) * weight).ravel())
    joined = Fields(*(np.concatenate([getattr(part, item.name) for part in parts])
                      for item in fields(Fields)))
    return joined, np.concatenate(weights)


@dataclass(frozen=True)
class LostTension:
    """Mounted area of the whole film with tension in one direction only, and in none [m²]."""

    wrinkled: float
    slack: float
    share: float  #: of the film's mounted area, both together


def node_fields(model: Model, states: Sequence[State]) -> list[Fields]:
    """Compute fields of each state at the nodes of every element of the model's mesh."""
    return cell_fields(model, states, ELEMENTS[model.discretisation.mesh.order].doflocs.T)


def lost_tension(model: Model, states: Sequence[State], parts: int = 8,
                 at_nodes: Sequence[Fields] = ()) -> list[LostTension]:
    """Measure the parts of the film that have lost tension in each state.

    Points are the middles of ``parts``² triangles in every element that may have lost tension by
    its fields ``at_nodes``, :func:`node_fields` unless given; states are computed together.
    """
    mesh, points = model.discretisation, middles(parts)
    if not model.meshed:
        return [LostTension(0.0, 0.0, 0.0)] * len(states)
    at_nodes = at_nodes or node_fields(model, states)
    shape = len(states), mesh.mesh.nelements, -1
    tension, stress = (np.stack(values).reshape(shape) for values in zip(
        *((fields.tension, fields.stress_2) for fields in at_nodes), strict=True))
    taut = (tension == Tension.TAUT).all(axis=-1)
    near = ~taut | (stress.min(axis=-1) < _BETWEEN * np.ptp(stress, axis=-1))
    cells = np.flatnonzero(near.any(axis=0))
    gradients, stretched = isoparametric(mesh.mesh.order, points,
                                         mesh.reference[mesh.connectivity[cells], :2])
    whole_area = mesh.weights[cells].sum(axis=1)
    areas = stretched * (whole_area / stretched.sum(axis=1))[:, None]
    result = []
    for tension in _tension(model, states, gradients, points, cells):
        wrinkled, slack = (float(areas[tension == kind].sum())
                           for kind in (Tension.WRINKLED, Tension.SLACK))
        result.append(LostTension(wrinkled * mesh.mirrored, slack * mesh.mirrored,
                                  (wrinkled + slack) / float(mesh.weights.sum())))
    return result


def _tension(model: Model, states: Sequence[State], gradients: AnyArray, points: AnyArray,
             cells: AnyArray) -> AnyArray:
    """Classify the tension at reference points, shape (states, cells, points).

    ``gradients`` are those at the reference points.
    """
    mesh = model.discretisation
    positions = np.stack([state.positions for state in states])
    nodes = mesh.connectivity[cells]
    c = cauchy_green(deformation(gradients, positions[:, nodes]))
    squared = np.array([state.voltage_squared for state in states])[:, None, None]
    there = tabulated(mesh.mesh.order, points)[0].T @ mesh.reference[nodes]
    x, y = there[..., 0], there[..., 1]
    covered = mesh.covered[cells] * model.specimen.electrode.coverage(x, y)
    density = FilmDensity(model.specimen, squared, covered, model.wrinkles,
                          _flow_at(model, cells, points), model.specimen.relative_thickness(x, y),
                          model.specimen.electrode.share(mesh.segments[cells, None]))
    # Principal stresses are the eigenvalues of S C.
    s11, s22, s12 = np.moveaxis(density(c, tangent=False).stress, -1, 0)
    c11, c22, c12 = c
    mean = (s11 * c11 + s22 * c22) / 2 + s12 * c12
    product = (s11 * s22 - s12**2) * (c11 * c22 - c12**2)
    radius = np.sqrt(np.maximum(mean**2 - product, 0.0))
    return tension_state(mean + radius, mean - radius, density.stretches(c)[2])


def strength(film: Film, l1: AnyArray, l2: AnyArray, thickness: AnyArray) -> AnyArray:
    """Compute the field at which the film breaks down [V/m], infinite without a strength law."""
    if film.strength is None:
        return np.full(np.shape(thickness), np.inf)
    return film.strength.field(l1, l2, thickness)


def _fields(model: Model, states: Sequence[State], cells: AnyArray, points: AnyArray,
            along: AnyArray | None = None) -> Fields:
    """Compute fields in some elements, one state after another; ``along`` serves one state.

    ``plate_traction`` is on cuts ``along`` these vectors, shape (cells, points, 2).
    """
    film, sampled = model.specimen.membrane, model.sampled(states, cells, points)
    reference, f, covered = sampled.places, sampled.deformation, sampled.covered
    each = len(reference) // len(states)
    voltage_squared = np.repeat([state.voltage_squared for state in states], each)

    c = cauchy_green(f)
    flow = _flow_at(model, cells, points)
    if flow is not None:
        flow = flow.at(lambda values: values.reshape(*values.shape[:-2], -1))
        assert len(states) == 1
    relative = model.specimen.relative_thickness(reference[:, 0], reference[:, 1])
    density = FilmDensity(model.specimen, voltage_squared, covered, model.wrinkles, flow, relative,
                          sampled.share)
    stress = density(c, tangent=False).stress
    l1, l2, tense = density.stretches(c)
    inward = _inward(model, reference[:, :2])
    s11, s22, s12 = _cauchy(f, stress, -inward)
    mean, radius = (s11 + s22) / 2, np.hypot((s11 - s22) / 2, s12)
    cut = inward if along is None else _normal(along.reshape(-1, 2), inward)
    traction = np.einsum("kni,nk->ni", first_piola(f, stress), cut)
    w1 = density.maxwell.derivatives(l1, l2)[1]
    thickness = film.thickness * relative / (l1 * l2)
    mounted = film.volume_per_area * np.broadcast_to(relative, len(reference))
    return Fields(
        position=reference, displacement=sampled.positions - reference, stretch_1=l1, stretch_2=l2,
        thickness=thickness,
        electric_field=(covered * sampled.share * np.sqrt(np.maximum(voltage_squared, 0.0))
                        / thickness),
        breakdown_strength=strength(film, l1, l2, thickness), maxwell_stress=-l1 * w1,
        stress_1=mean + radius, stress_2=mean - radius, stress_radial=s11,
        stress_circumferential=s22, stress_shear=s12,
        plate_traction=traction * mounted[:, None],
        tension=tension_state(mean + radius, mean - radius, tense))


def _inward(model: Model, places: AnyArray) -> AnyArray:
    """Compute unit vectors towards the plate's centre, or the frame's; in the centre −x."""
    inward = model.centre[:2] - places
    distance = np.linalg.norm(inward, axis=1, keepdims=True)
    inward = np.where(distance > _CENTRE * model.size, inward, (-1.0, 0.0))
    unit: AnyArray = inward / np.linalg.norm(inward, axis=1, keepdims=True)
    return unit


def _cauchy(f: AnyArray, stress: AnyArray, radial: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Compute true stress (radial, circumferential, shear) within the film: σ = F S Fᵀ."""
    first = np.einsum("nik,nk->ni", f, radial)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    normal = np.cross(f[:, :, 0], f[:, :, 1])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    second = np.cross(normal, first)
    a1, a2 = np.einsum("ni,nik->kn", first, f)
    b1, b2 = np.einsum("ni,nik->kn", second, f)
    s11, s22, s12 = stress[:, 0], stress[:, 1], stress[:, 2]
    radial_stress = a1 * a1 * s11 + a2 * a2 * s22 + 2 * a1 * a2 * s12
    around = b1 * b1 * s11 + b2 * b2 * s22 + 2 * b1 * b2 * s12
    shear = a1 * b1 * s11 + a2 * b2 * s22 + (a1 * b2 + a2 * b1) * s12
    return radial_stress, around, shear


def _normal(along: AnyArray, towards: AnyArray) -> AnyArray:
    """Compute unit normals of vectors in the plane, on the side of ``towards``."""
    normal = np.column_stack([along[:, 1], -along[:, 0]])
    normal /= np.linalg.norm(along, axis=1, keepdims=True)
    normal *= np.sign((normal * towards).sum(axis=1, keepdims=True))
    return normal
