"""The discretised film: energy, nodal forces and tangent by batched contractions over the scikit-fem basis."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import skfem
from numpy.typing import NDArray
from scipy.sparse import csc_matrix

from tympan.fem.discretisation.assembly import element_forces, element_tangents
from tympan.fem.discretisation.isoparametric import isoparametric
from tympan.fem.discretisation.pattern import Pattern
from tympan.fem.film.density import FilmDensity, plane_stress, principal_stretches
from tympan.fem.linear_solver.direct import Analysis, analyse
from tympan.fem.linear_solver.dissection import elimination_order
from tympan.fem.membrane.enclosed_volume import FilmVolume, plate_volume
from tympan.fem.membrane.loading import GUIDES, Loading
from tympan.fem.membrane.plate import FREEDOMS, PlateMotion
from tympan.geometry.mesh import CurvedTriangles
from tympan.geometry.outlines import area
from tympan.geometry.specimen import Specimen

if TYPE_CHECKING:
    from tympan.fem.membrane.state import Load, State

Array = NDArray[Any]

#: A right-hand side or a correction: free nodal components, and plate freedoms in the model's
#: order.
Parts = tuple[Array, Array]

_STEP = 1e-30

#: Plate freedoms that survive when a coordinate may change sign: mirroring x reverses x, ry and rz.
_ODD = {"x": frozenset({"x", "ry", "rz"}), "y": frozenset({"y", "rx", "rz"})}


@dataclass(frozen=True, eq=False)
class Model:
    """One specimen on one mesh.

    ``planes`` are the coordinates about whose zero the mesh is half of a mirrored whole.
    ``wrinkles`` says whether the film wrinkles rather than carry compression
    (:mod:`tympan.fem.film.tension_field`). All nodal arrays have shape (nodes, 3); node positions,
    not displacements, are the unknowns.
    """

    specimen: Specimen
    mesh: CurvedTriangles
    planes: frozenset[str] = frozenset()
    loading: Loading = field(default_factory=Loading)
    wrinkles: bool = False

    def __post_init__(self) -> None:
        """Refuse a weight that the mirror planes would repeat."""
        if any(arm and plane in self.planes
               for plane, arm in zip("xy", self.loading.arm, strict=True)):
            raise ValueError("a weight beside a mirror plane needs a mesh that is not mirrored there")

    def with_specimen(self, specimen: Specimen) -> Model:
        """The same mesh with another film or electrode of the same outlines; what depends on the mesh alone is kept."""
        return self._keeping(replace(self, specimen=specimen))

    def with_loading(self, loading: Loading) -> Model:
        """The same film under other surroundings."""
        return self._keeping(replace(self, loading=loading))

    def _keeping(self, model: Model) -> Model:
        """The model, with what depends on the mesh and the outlines alone."""
        kept = ("basis", "connectivity", "shapes", "gradients", "weights", "covered", "reference",
                "centre",
                "plate_nodes", "arms", "free", "size", "plate_area", "_plate_elements", "_pattern",
                "analysis",
                "velocities")
        vars(model).update({name: vars(self)[name] for name in kept if name in vars(self)})
        return model

    @cached_property
    def basis(self) -> skfem.CellBasis:
        """The scalar scikit-fem basis everything is integrated with."""
        return skfem.CellBasis(self.mesh, self.mesh.elem(), intorder=max(2, 2 * self.mesh.order))

    @cached_property
    def connectivity(self) -> Array:
        """Nodes of the elements, shape (elements, local)."""
        return np.ascontiguousarray(self.basis.element_dofs.T)

    @cached_property
    def gradients(self) -> Array:
        """∂φ/∂X at the quadrature points, shape (elements, points, local, 2) [1/m]."""
        if np.iscomplexobj(self.reference):
            return self._complex_geometry[0]
        stacked = np.stack([shape[0].grad for shape in self.basis.basis])
        return np.ascontiguousarray(stacked.transpose(2, 3, 0, 1))

    @cached_property
    def shapes(self) -> Array:
        """φ at the quadrature points, shape (points, local)."""
        return np.stack([np.atleast_2d(np.asarray(shape[0]))[0] for shape in self.basis.basis],
                        axis=1)

    @cached_property
    def weights(self) -> Array:
        """Mounted area of every quadrature point of this mesh [m²], shape (elements, points)."""
        return self._complex_geometry[1] if np.iscomplexobj(self.reference) else np.asarray(self.basis.dx)

    @cached_property
    def _complex_geometry(self) -> tuple[Array, Array]:
        """Of complex nodes (``fem.derivatives.shape.moved_by``), which scikit-fem does not map."""
        return isoparametric(self.mesh, self.basis.X, self.basis.W,
                             self.reference[self.connectivity, :2])

    @cached_property
    def volumes(self) -> Array:
        """Virgin volume of every quadrature point of this mesh [m³], shape (elements, points)."""
        film = self.specimen.membrane
        return self.weights * (film.thickness / film.area_prestretch)

    @cached_property
    def covered(self) -> Array:
        """1 in elements under the electrode, 0 outside, shape (elements, 1)."""
        covered = np.ones((self.mesh.nelements, 1))
        covered[(self.mesh.subdomains or {}).get("bare", [])] = 0
        return covered

    @cached_property
    def reference(self) -> Array:
        """Node positions of the flat mounted film [m]."""
        flat = self.basis.doflocs.T
        return np.column_stack([flat, np.zeros(len(flat))])

    @cached_property
    def centre(self) -> Array:
        """The plate's centre in the mounted film [m]."""
        return np.array([*self.specimen.plate.offset, 0.0])

    @cached_property
    def plate_nodes(self) -> Array:
        """Nodes on the plate's edge."""
        return self.boundary_nodes("plate")

    @cached_property
    def arms(self) -> Array:
        """Plate nodes relative to the plate's centre [m]."""
        return self.reference[self.plate_nodes] - self.centre

    @property
    def mirrored(self) -> int:
        """How often the mesh repeats in the whole film: 1, 2 or 4."""
        return 2 ** len(self.planes)

    @cached_property
    def plate_freedoms(self) -> tuple[int, ...]:
        """Numbers of the plate's freedoms that the symmetry and the guide allow."""
        odd = frozenset().union(*(_ODD[plane] for plane in self.planes))
        allowed = GUIDES[self.loading.guide] - odd
        return tuple(number for number, name in enumerate(FREEDOMS) if name in allowed)

    @property
    def axisymmetric(self) -> bool:
        """Whether film, plate and loads are the same all around."""
        return self.specimen.axisymmetric and self.loading.arm == (0.0, 0.0)

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Which nodal components are unknowns, shape (nodes, 3)."""
        free = np.ones(self.reference.shape, dtype=bool)
        free[self.boundary_nodes("frame")] = False
        free[self.plate_nodes] = False
        for axis, plane in enumerate("xy"):
            if plane in self.planes:
                free[self.boundary_nodes(f"axis_{'yx'[axis]}"), axis] = False
        return free

    @property
    def unknowns(self) -> int:
        """Number of nodal unknowns and plate freedoms solved for."""
        return int(self.free.sum()) + len(self.plate_freedoms)

    @cached_property
    def size(self) -> float:
        """The frame's larger half extent [m], the scale of corrections."""
        return max(self.specimen.frame.semi_axes)

    @cached_property
    def plate_area(self) -> float:
        """Area of the whole plate [m²]."""
        return area(self.specimen.plate.outline)

    @property
    def pull(self) -> Any:
        """The film's own weight per mounted area [Pa]."""
        film = self.specimen.membrane
        return film.density * self.loading.gravity * (film.thickness / film.area_prestretch)

    @cached_property
    def weight(self) -> Array:
        """Nodal forces of the film's own mass [N], shape (nodes, 3)."""
        pull = self.pull
        elements = np.zeros((*self.connectivity.shape, 3), dtype=np.result_type(self.weights, pull))
        elements[..., 2] = pull * np.matmul(self.weights, self.shapes)
        return self._scatter(elements)

    def boundary_nodes(self, name: str) -> Array:
        """Nodes on a named boundary, empty if the mesh has none of that name."""
        facets = (self.mesh.boundaries or {}).get(name)
        return np.array([], dtype=int) if facets is None else self.basis.get_dofs(facets).flatten()

    def place(self, positions: Array, plate: PlateMotion) -> Array:
        """A copy of the positions with the plate's edge where the plate is."""
        placed = positions.copy()
        placed[self.plate_nodes] = plate.positions(self.centre, self.arms)
        return placed

    def deformation(self, positions: Array) -> Array:
        """F at the quadrature points, shape (elements, points, 3, 2)."""
        local = positions[self.connectivity].transpose(0, 2, 1)
        return np.matmul(local[:, None], self.gradients)

    def density(self, voltage_squared: Any) -> FilmDensity:
        """The film's energy density at U² [V²]."""
        return FilmDensity(self.specimen, voltage_squared, self.covered, self.wrinkles)

    def tense(self, state: State) -> bool:
        """Whether the film is in tension everywhere, at the quadrature points."""
        c = cauchy_green(self.deformation(state.positions))
        seen = principal_stretches(c, self.specimen.membrane.prestretch)
        return bool((self.density(state.voltage_squared).material.derivatives(*seen)[2] > 0).all())

    def energy(self, positions: Array, voltage_squared: Any) -> Any:
        """Stored energy of this mesh, counted from the virgin film [J]."""
        f = self.deformation(positions)
        return (self.density(voltage_squared)(cauchy_green(f), tangent=False).energy
                * self.volumes).sum()

    def forces(self, positions: Array, voltage_squared: Any) -> Array:
        """Derivative of the energy by the node positions [N], shape (nodes, 3)."""
        f = self.deformation(positions)
        stress = self.density(voltage_squared)(cauchy_green(f), tangent=False).stress
        return self._scatter(self._element_forces(f, stress))

    def potential(self, state: State) -> Any:
        """Energy of this mesh and of its share of the loads [J]; stationary at equilibrium."""
        loads = self.weight[:, 2] @ state.positions[:, 2]
        loads = loads + state.pressure * self._film_volume(state.positions).value
        plate = self._on_plate(state)[0] / self.mirrored
        return self.energy(state.positions, state.voltage_squared) - loads + plate

    def nodal_forces(self, state: State) -> Array:
        """Derivative of the potential by the node positions, without what acts on the plate [N], shape (nodes, 3)."""
        forces = self.forces(state.positions, state.voltage_squared) - self.weight
        return forces - state.pressure * self._volume_forces(state.positions) if state.pressure else forces

    def residual(self, forces: Array, state: State) -> Parts:
        """Unbalanced forces of the free components and of the plate's allowed freedoms, from the nodal forces."""
        outer = self._on_plate(state)[1][list(self.plate_freedoms)] / self.mirrored
        return forces[self.free], self.plate_forces(forces, state.plate) + outer

    def unbalanced(self, state: State) -> float:
        """Largest unbalanced force on a free component, relative to the largest nodal force."""
        forces = self.nodal_forces(state)
        return float(np.abs(forces[self.free]).max(initial=0.0) / np.abs(forces).max())

    def by_load(self, state: State, load: Load) -> Parts:
        """Derivative of the residual by the force, U² or the pressure, at a fixed configuration."""
        allowed = list(self.plate_freedoms)
        if load == "voltage":
            forces = self._electric_forces(state)
            return forces[self.free], self.plate_forces(forces, state.plate)
        if load == "pressure":
            forces = -self._volume_forces(state.positions)
            outer = -plate_volume(self.plate_area, state.plate)[1][allowed] / self.mirrored
            return forces[self.free], self.plate_forces(forces, state.plate) + outer
        return np.zeros(int(self.free.sum())), -self.loading.lift(state.plate)[allowed] / self.mirrored

    def _electric_forces(self, state: State) -> Array:
        """Derivative of the nodal forces by U² [N/V²]; where the film wrinkles they need not be linear in it."""
        if self.wrinkles:
            return np.asarray(self.forces(state.positions, state.voltage_squared + 1j * _STEP).imag
                              / _STEP)
        f = self.deformation(state.positions)
        electric = self.density(1.0).maxwell
        stress = plane_stress((electric,), cauchy_green(f), self.specimen.membrane.prestretch,
                              tangent=False).stress
        return self._scatter(self._element_forces(f, stress))

    def linearised(self, state: State) -> Linearised:
        """Forces and tangent with the plate's freedoms as border."""
        f = self.deformation(state.positions)
        density = self.density(state.voltage_squared)(cauchy_green(f))
        elements = self._element_tangents(f, density.stress, density.tangent)
        forces = self._scatter(self._element_forces(f, density.stress)) - self.weight
        if state.pressure:
            volume = self._film_volume(state.positions)
            elements = elements - state.pressure * volume.second()
            forces = forces - state.pressure * self._scatter(volume.first())
        inner = self._pattern.assemble(elements)
        gradient = state.plate.gradient(self.arms)[:, :, self.plate_freedoms]
        border, corner = self._plate_coupling(elements, gradient)
        bend = state.plate.curvature(self.arms,
                                     forces[self.plate_nodes]) + self._on_plate(state)[2] / self.mirrored
        return Linearised(forces, inner, border,
                          corner + bend[np.ix_(self.plate_freedoms, self.plate_freedoms)])

    def plate_forces(self, forces: Array, plate: PlateMotion) -> Array:
        """Nodal forces gathered on the plate's allowed freedoms [N, N m]."""
        gradient = plate.gradient(self.arms)[:, :, self.plate_freedoms]
        return np.einsum("nip,ni->p", gradient, forces[self.plate_nodes])

    def _on_plate(self, state: State) -> tuple[Any, Array, Array]:
        return self.loading.on_plate(state, self.centre, self.plate_area)

    def _film_volume(self, positions: Array) -> FilmVolume:
        return FilmVolume(positions[self.connectivity], self.deformation(positions), self.shapes,
                          self.gradients,
                          self.weights)

    def _volume_forces(self, positions: Array) -> Array:
        return self._scatter(self._film_volume(positions).first())

    def _element_forces(self, f: Array, stress: Array) -> Array:
        return element_forces(self.gradients, f, stress * self.volumes[..., None])

    def _element_tangents(self, f: Array, stress: Array, tangent: Any) -> Array:
        """Shape (elements, 3 local, 3 local), node-major."""
        return element_tangents(self.gradients, f, stress, tangent, self.volumes)

    def _scatter(self, element_forces: Array) -> Array:
        """Sum element vectors into nodal ones."""
        nodes = self.connectivity.ravel()
        count = len(self.reference)
        parts = element_forces.reshape(-1, 3)
        if np.iscomplexobj(parts):
            return self._scatter(element_forces.real) + 1j * self._scatter(element_forces.imag)
        return np.stack([np.bincount(nodes, parts[:, axis], count) for axis in range(3)], axis=1)

    @cached_property
    def _plate_elements(self) -> tuple[Array, Array]:
        """Elements with plate nodes, and for each local node its row in ``plate_nodes`` or the row after the last."""
        row = np.full(len(self.reference), len(self.plate_nodes))
        row[self.plate_nodes] = np.arange(len(self.plate_nodes))
        rows = row[self.connectivity]
        touching = np.flatnonzero((rows < len(self.plate_nodes)).any(axis=1))
        return touching, rows[touching]

    def _plate_coupling(self, elements: Array, gradient: Array) -> tuple[Array, Array]:
        """Tangent's columns for the plate's freedoms: rows of the free components, and the corner."""
        touching, rows = self._plate_elements
        freedoms = gradient.shape[2]
        padded = np.concatenate([gradient, np.zeros((1, 3, freedoms))])
        local = padded[rows].reshape(len(touching), 3 * rows.shape[1], freedoms)
        product = np.matmul(elements[touching], local)
        corner = np.einsum("eap,eaq->pq", local, product)
        nodes = (3 * self.connectivity[touching][:, :, None] + np.arange(3)).ravel()
        flat = product.reshape(len(nodes), freedoms)  # a fixed plate has none
        border = np.empty((self.reference.size, freedoms))
        for freedom in range(freedoms):
            border[:, freedom] = np.bincount(nodes, flat[:, freedom], self.reference.size)
        return border[self.free.ravel()], corner

    @cached_property
    def _pattern(self) -> Pattern:
        return Pattern.of(self.connectivity, self.free)

    @cached_property
    def analysis(self) -> Analysis:
        """What depends on the mesh alone in the factorisation of :attr:`Linearised.inner`."""
        nodes = elimination_order(self.connectivity, self.reference[:, :2])
        number = (np.cumsum(self.free) - 1).reshape(self.free.shape)
        return analyse(self._pattern.indices, self._pattern.indptr, number[nodes][self.free[nodes]])


@dataclass(frozen=True)
class Linearised:
    """Forces and tangent at one state.

    ``forces`` (nodes, 3); ``inner`` the tangent of the free components (n, n); ``border`` (n, p)
    and ``corner`` (p, p) couple the plate's allowed freedoms.
    """

    forces: Array
    inner: csc_matrix
    border: Array
    corner: Array


def cauchy_green(f: Array) -> tuple[Array, Array, Array]:
    """(C₁₁, C₂₂, C₁₂) of C = FᵀF for F of shape (..., 3, 2); complex-safe, without conjugation."""
    a, b = f[..., 0], f[..., 1]
    return (a * a).sum(-1), (b * b).sum(-1), (a * b).sum(-1)
