"""Added mass of the air that moves with film and plate, for each pair of motions.

Frame and stand are a baffle. The air is treated as incompressible: frequencies are far below those
at which the wavelength of sound equals the film's size. Let V(k) = ∫ v e^(−ik·x) dA for a velocity
v of film and plate along the load. The kinetic energy of the air on one side is ½ ρ/(4π²) ∫ |V|²/k
d²k. This is Rayleigh's integral ½ ρ/(2π) ∬ v(x) v(x')/|x − x'| dA dA' (Lamb, Proc. R. Soc. A 98,
1920, 205) without its singularity. Motions normal to the load, such as a plate that slides or
twists, move no air. The modes in vacuo are the basis for the modes of film, plate and air.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg
import skfem.quadrature

from tympan.base.arrays import Array
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.isoparametric import isoparametric, tabulated
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import FREEDOMS, PlateMotion
from tympan.fem.vibration.modes import Modes
from tympan.geometry.mesh import ELEMENTS
from tympan.geometry.outlines import Outline
from tympan.geometry.specimen import Specimen

#: Plate freedoms with motion along the load: up and down, and rotation about both axes.
_ALONG = tuple(FREEDOMS.index(name) for name in ("z", "rx", "ry"))

#: Degree of the quadrature on elements: waves of ten radians across an element still have an
#: accuracy of three digits.
_DEGREE = 10

#: Quadrature points around a plate's edge: several for each of the shortest waves in the sum.
_AROUND = 96
#: Quadrature points from the edge to the centre, for the same reason.
_INWARDS = 10

#: Largest wave number times the frame's smaller half extent. A film fixed to its frame has 1e-6 of
#: its energy above it. A piston with a jump of velocity at the frame has 1e-4.
_SHORTEST_WAVE = 60.0
#: Largest wave number times the frame's larger half extent: a bound for long frames. A film whose
#: frame is four times as long as wide has 2e-5 of its energy above it.
_MOST = 100.0

#: Number of wave numbers per radian across the frame's larger half extent. Set by trial.
_DENSITY = 0.7
#: Number of additional wave numbers, for a small frame. Set by trial.
_WAVES = 24

#: Number of wave directions over half a turn per radian: enough to resolve a pattern of such short
#: waves.
_TURN = 0.8
#: Number of additional wave directions, for long waves. Set by trial.
_DIRECTIONS = 16

#: Largest number of products of waves and points computed at once.
_TOGETHER = 2_000_000


def with_air(specimen: Specimen, mesh: Discretisation, modes: Modes, plate: RigidPlate,
             density: float, count: int) -> Modes:
    """Compute the lowest modes of film, plate and air from those in vacuo.

    ``density``: density of the air [kg/m³]. ``mesh``: mesh of the whole film. Shapes are normalised
    to the mass of film, plate and air together.
    """
    stiffness = (2 * np.pi * modes.frequencies_Hz) ** 2 - modes.growth**2
    volumes = air_volumes(specimen, mesh, modes.shapes[..., 2], modes.plate[:, _ALONG])
    values, mixes = scipy.linalg.eigh(np.diag(stiffness), np.eye(len(stiffness))
                                      + density * volumes)
    chosen = slice(0, count)
    mixed = mixes[:, chosen].T
    motion = mixed @ modes.plate
    return replace(modes, frequencies_Hz=np.sqrt(np.maximum(values[chosen], 0)) / (2 * np.pi),
                   growth=np.sqrt(np.maximum(-values[chosen], 0)),
                   shapes=np.tensordot(mixed, modes.shapes, axes=1), plate=motion,
                   shares=motion * (motion @ plate.matrix(PlateMotion.rest())))


def air_volumes(specimen: Specimen, mesh: Discretisation, heights: Array,
                plate: Array | None = None) -> Array:
    """Compute added masses over the air's density, for motions along the load."""
    return MovedAir.of(specimen, mesh, heights, plate).volumes


@dataclass(frozen=True, eq=False)
class MovedAir:
    """Motions of film and plate along the load; the air follows them on both sides.

    ``places``: quadrature points on film and plate, (n, 2). ``flow``: motions times weights there,
    (motions, n). ``semi_axes`` of the frame [m], the smaller one first.
    """

    places: Array
    flow: Array
    semi_axes: tuple[float, float]

    @classmethod
    def of(cls, specimen: Specimen, mesh: Discretisation, heights: Array,
           plate: Array | None = None) -> MovedAir:
        """Create from the ``heights`` of a mesh's nodes, (motions, nodes), and the plate's motions.

        On a mirrored mesh the motions are even about its planes, or odd about those planes about
        which the mesh is odd. ``plate``: motions along the load and about x and y, (motions, 3);
        None without motion or plate.
        """
        places, flow = _film(mesh, heights)
        for plane in mesh.planes:
            axis, sign = "xy".index(plane), -1.0 if plane in mesh.odd else 1.0
            image = places.copy()
            image[:, axis] *= -1
            places, flow = np.vstack([places, image]), np.hstack([flow, sign * flow])
        if specimen.plate is not None and plate is not None:
            inside, weights = _within(specimen.plate.outline)
            lifts = plate @ np.stack([np.ones(len(inside)), inside[:, 1], -inside[:, 0]])
            places = np.vstack([places, inside + specimen.centre])
            flow = np.hstack([flow, lifts * weights])
        small, large = sorted(specimen.frame.semi_axes)
        return cls(places, flow, (small, large))

    @cached_property
    def volumes(self) -> Array:
        """Added masses over the air's density, both sides, shape (motions, motions).

        The unit is m³ if the motions have no unit.
        """
        result = np.zeros((len(self.flow), len(self.flow)))
        small, large = self.semi_axes
        for waves, weights in _waves(min(_SHORTEST_WAVE / small, _MOST / large), large):
            for start in range(0, len(waves), step := max(1, _TOGETHER // len(self.places))):
                part = slice(start, start + step)
                phase = waves[part] @ self.places.T
                for values in (np.cos(phase) @ self.flow.T, np.sin(phase) @ self.flow.T):
                    result += values.T @ (weights[part, None] * values)
        # Factor 2 for both sides, and 2 for both halves of the turn.
        return 2 * 2 * result / (4 * np.pi**2)


def _film(mesh: Discretisation, heights: Array) -> tuple[Array, Array]:
    """Compute quadrature points on the elements (n, 2) and motions times weights (motions, n)."""
    order = mesh.mesh.order
    points, weights = skfem.quadrature.get_quadrature(ELEMENTS[order].refdom, _DEGREE)
    corners = mesh.reference[mesh.connectivity, :2]
    shapes = tabulated(order, points)[0]
    areas = isoparametric(order, points, corners)[1] * weights
    flow = (heights[:, mesh.connectivity] @ shapes) * areas
    places = np.einsum("lp,elx->epx", shapes, corners)
    return places.reshape(-1, 2), flow.reshape(len(heights), -1)


def _within(outline: Outline) -> tuple[Array, Array]:
    """Compute points within an outline from its centre, (n, 2), and their areas, (n,).

    Rays lead from the centre to the edge: ∫ g dA = ∮ ∫ g(s x) s ds x × dx. This also holds for
    edges that turn back, where areas are negative.
    """
    s, along = (np.asarray(part) for part in np.polynomial.legendre.leggauss(_INWARDS))
    s, along = (1 + s) / 2, along / 2
    pieces = outline.curve.pieces
    lengths = outline.curve.lengths
    places, areas = [], []
    for piece, length in zip(pieces, lengths, strict=True):
        # The number of waves along a piece is proportional to its length.
        count = max(4, int(np.ceil(_AROUND * length / lengths.sum())))
        t, weights = np.polynomial.legendre.leggauss(count)
        edge, slope = piece.at((1 + t) / 2)[:2]
        swept = (edge[:, 0] * slope[:, 1] - edge[:, 1] * slope[:, 0]) * weights / 2
        places.append((s[:, None, None] * edge).reshape(-1, 2))
        areas.append(((s * along)[:, None] * swept).ravel())
    return np.vstack(places), np.concatenate(areas)


def _waves(highest: float, size: float) -> Iterator[tuple[Array, Array]]:
    """Yield wave vectors [1/m] over half a turn, (n, 2), and weights of ∫∫ dk dθ, (n,)."""
    reach = highest * size
    nodes, weights = np.polynomial.legendre.leggauss(_WAVES + int(_DENSITY * reach))
    numbers, weights = highest * (1 + nodes) / 2, highest * weights / 2
    for number, weight in zip(numbers, weights, strict=True):
        # Enough directions to resolve a pattern of such short waves.
        count = _DIRECTIONS + int(_TURN * number * size)
        angles = np.pi * np.arange(count) / count
        yield (number * np.column_stack([np.cos(angles), np.sin(angles)]),
               np.full(count, weight * np.pi / count))
