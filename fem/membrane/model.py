"""A specimen on a mesh, the actions on it, and the nonlinear equations of its equilibrium."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from tympan.base.arrays import AnyArray
from tympan.fem.complex_step import STEP, complex_step
from tympan.fem.discretisation.assembly import element_forces, element_tangents
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.discretisation.isoparametric import deformation, isoparametric, tabulated
from tympan.fem.film.density import FilmDensity, plane_stress, principal_stretches
from tympan.fem.film.memory import Flow
from tympan.fem.film.tension_field import total
from tympan.fem.membrane.loading import GUIDES, Loading, film_volume, plate_volume
from tympan.fem.membrane.state import FREEDOMS, HEAVE, Load, PlateMotion, State
from tympan.geometry.specimen import Specimen

#: A right-hand side or a correction: free nodal components, and plate freedoms in the model's
#: order.
Parts = tuple[AnyArray, AnyArray]

#: Large height of a balloon, in half extents of its frame: one of neo-Hookean film bears the most
#: pressure at about one and a half.
_BALLOON = 4.0

#: Plate freedoms that change sign in the mirror: mirroring x reverses x, ry and rz.
_REVERSED = {"x": frozenset({"x", "ry", "rz"}), "y": frozenset({"y", "rx", "rz"})}


@dataclass(frozen=True, eq=False)
class Sampled:
    """Film at places of some states, one state after another, for its fields there.

    ``places`` in the mounted film and deformed ``positions`` [m], (n, 3) each; ``deformation``, F
    from the mounted film, (n, 3, 2); share ``covered`` by the electrode, and ``share`` of the
    film's voltage on it, (n,) each.
    """

    places: AnyArray
    positions: AnyArray
    deformation: AnyArray
    covered: AnyArray
    share: Any = 1.0


@dataclass(frozen=True, eq=False)
class Model:
    """A specimen on a mesh and its surroundings.

    ``wrinkles`` says whether the film wrinkles rather than carry compression
    (:mod:`tympan.fem.film.tension_field`). A :func:`dataclasses.replace` gives another specimen of
    the same outlines, or other surroundings, on the same discretisation. It also gives a step of
    time (``flow``) of a film with viscous branches, which without a step are at rest.
    """

    discretisation: Discretisation
    specimen: Specimen
    loading: Loading = field(default_factory=Loading)
    wrinkles: bool = True
    flow: Flow | None = None

    def __post_init__(self) -> None:
        if any(arm and plane in self.discretisation.planes
               for plane, arm in zip("xy", self.loading.arm, strict=True)):
            raise ValueError("a weight beside a mirror plane needs a mesh not mirrored there")

    def mounted(self, voltage_squared: float = 0.0) -> State:
        """Lay the film flat with the plate at rest."""
        return State(self.discretisation.reference.copy(), PlateMotion.rest(), voltage_squared)

    @cached_property
    def volumes(self) -> AnyArray:
        """Virgin volume of all layers at every quadrature point [m³], shape (elements, points)."""
        film = self.specimen.membrane
        even = self.discretisation.weights * film.volume_per_area
        return np.asarray(even * self.relative_thickness)

    @cached_property
    def relative_thickness(self) -> Any:
        """Virgin thickness over the stated one, 1 or of shape (elements, points)."""
        return self.specimen.relative_thickness(*self._places)

    @cached_property
    def covered(self) -> Any:
        """Share of the film under the electrode, shape (elements, 1 or points)."""
        return self.discretisation.covered * self.specimen.electrode.coverage(*self._places)

    @cached_property
    def shares(self) -> Any:
        """Voltage of the electrode over the film's, 1 or of shape (elements, 1).

        It is the same in all mirror images. The mean of these has the derivative by the voltage of
        one segment that a result of the whole film has.
        """
        share = self.specimen.electrode.share(self.discretisation.images[..., None])
        return share if np.ndim(share) == 0 else share.mean(axis=0)

    @property
    def even(self) -> bool:
        """Whether thickness and coverage are the same wherever points of an element move."""
        return np.ndim(self.relative_thickness) == 0 and not self.specimen.electrode.patches

    @cached_property
    def _places(self) -> tuple[AnyArray, AnyArray]:
        """x and y of the quadrature points in the mounted film [m], (elements, points) each."""
        mesh = self.discretisation
        x, y, _ = np.moveaxis(mesh.shapes @ mesh.reference[mesh.connectivity], -1, 0)
        return x, y

    @property
    def meshed(self) -> bool:
        """Whether the film consists of elements, so that it has a surface and fields on it."""
        return bool(self.discretisation.mesh.nelements)

    @property
    def bears_gas(self) -> bool:
        """Whether the volume below the film is known, so that a gas may lift it."""
        return True

    @property
    def centre(self) -> AnyArray:
        """The plate's centre in the mounted film, or the frame's without a plate [m]."""
        return np.array([*self.specimen.centre, 0.0])

    @cached_property
    def centre_node(self) -> int:
        """The node in the centre: meshes of films without plate have such a node."""
        return int(np.hypot(*self.discretisation.reference[:, :2].T.real).argmin())

    def deflection(self, state: State) -> float:
        """Measure the deflection along the load [m] of the plate or, without one, of the centre."""
        if self.specimen.plate is not None:
            return state.plate.deflection
        deflection: float = state.positions[self.centre_node, HEAVE].item()
        return deflection

    @cached_property
    def lift(self) -> Parts:
        """Derivative of the deflection by the free components and the plate's freedoms."""
        film = np.zeros((len(self.discretisation.reference), 3))
        if self.specimen.plate is None:
            film[self.centre_node, HEAVE] = 1.0
        plate = np.array([float(freedom == HEAVE) for freedom in self.plate_freedoms])
        return film[self.discretisation.free], plate

    def sloped(self, state: State, axis: int) -> Parts:
        """Differentiate the plate's slope along x or y, arcsin R_z,axis, by the unknowns.

        A rotation ω changes R by ω × R.
        """
        x, y, z = state.plate.rotation[:, axis]
        cosine = np.sqrt(1 - z * z)
        by_turns = {"rx": y / cosine, "ry": -x / cosine}
        plate = np.array([by_turns.get(FREEDOMS[number], 0.0) for number in self.plate_freedoms])
        return np.zeros(self.discretisation.free_count), plate

    @property
    def pushed_by(self) -> Load:
        """Load that pushes the film out: the force on the plate, or gas where there is no plate."""
        return "pressure" if self.specimen.plate is None else "force"

    @cached_property
    def arms(self) -> AnyArray:
        """Plate nodes relative to the plate's centre [m]."""
        mesh = self.discretisation
        return mesh.reference[mesh.plate_nodes] - self.centre

    @cached_property
    def plate_freedoms(self) -> tuple[int, ...]:
        """Numbers of the plate's freedoms that the guide and the symmetry of motions allow."""
        mesh = self.discretisation
        allowed = GUIDES["fixed" if self.specimen.plate is None else self.loading.guide]
        return tuple(number for number, name in enumerate(FREEDOMS)
                     if name in allowed
                     and all((name in _REVERSED[plane]) == (plane in mesh.odd)
                             for plane in mesh.planes))

    @cached_property
    def arm_of_freedom(self) -> AnyArray:
        """1 for plate freedoms that translate, the frame's half extent for those that rotate."""
        return np.where(np.array(self.plate_freedoms, dtype=int) < 3, 1.0, self.size)

    @property
    def axisymmetric(self) -> bool:
        """Whether film, plate and loads are axisymmetric."""
        return self.specimen.axisymmetric and self.loading.arm == (0.0, 0.0)

    @property
    def unknowns(self) -> int:
        """Number of unknowns: nodal components and plate freedoms."""
        return self.discretisation.free_count + len(self.plate_freedoms)

    @cached_property
    def size(self) -> float:
        """The frame's larger half extent [m], the scale of corrections."""
        return max(self.specimen.frame.semi_axes)

    @property
    def high(self) -> float:
        """A large deflection [m]: the frame's larger half extent, for a balloon four times that."""
        return self.size * (_BALLOON if self.specimen.plate is None else 1.0)

    @cached_property
    def plate_area(self) -> Any:
        """Area of the whole plate [m²], 0 without one."""
        return self.specimen.plate_area

    @cached_property
    def mass_per_area(self) -> Any:
        """Mass of film and electrodes per mounted area [kg/m²], shape (elements, 1 or points)."""
        film = self.specimen.membrane
        bare = film.density * film.volume_per_area
        bare = bare * self.relative_thickness
        return bare + film.layers * self.specimen.electrode.mass * self.covered

    @property
    def mass_and_volume(self) -> tuple[float, float]:
        """Mass of the whole film and its electrodes [kg], and virgin volume of the film [m³]."""
        mesh = self.discretisation
        mass = (self.mass_per_area * mesh.weights).sum() * mesh.mirrored
        return float(mass), float(self.volumes.sum() * mesh.mirrored)

    @property
    def pull(self) -> Any:
        """Weight of film and electrodes per mounted area [Pa], as :attr:`mass_per_area`."""
        return self.loading.gravity * self.mass_per_area

    @cached_property
    def weight(self) -> AnyArray:
        """Nodal forces of the mass of film and electrodes [N], shape (nodes, 3)."""
        mesh, pull = self.discretisation, self.pull
        if not np.any(pull):
            return np.zeros(mesh.reference.shape)
        elements = np.zeros((*mesh.connectivity.shape, 3), dtype=np.result_type(mesh.weights, pull))
        elements[..., 2] = np.matmul(pull * mesh.weights, mesh.shapes)
        return mesh.scatter(elements)

    def place(self, positions: AnyArray, plate: PlateMotion) -> AnyArray:
        """Copy the positions and put the plate's edge where the plate is."""
        placed = positions.copy()
        placed[self.discretisation.plate_nodes] = plate.positions(self.centre, self.arms)
        return placed

    def cauchy_green(self, positions: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Compute C₁₁, C₂₂, C₁₂ from the mounted film, shape (elements, points) each."""
        return cauchy_green(self.discretisation.deformation(positions))

    def sampled(self, states: Sequence[State], cells: AnyArray, points: AnyArray) -> Sampled:
        """Deform the film at reference points, (2, k), of some elements; element-major."""
        mesh = self.discretisation
        nodes = mesh.connectivity[cells]
        shapes = tabulated(mesh.mesh.order, points)[0]
        gradients = isoparametric(mesh.mesh.order, points, mesh.reference[nodes, :2])[0]
        here = np.matmul(shapes.T, mesh.reference[nodes]).reshape(-1, 3)
        places = np.tile(here, (len(states), 1))
        positions = np.stack([state.positions[nodes] for state in states])
        covered, segments = (np.tile(np.repeat(values[cells], points.shape[1]), len(states))
                             for values in (mesh.covered[:, 0], mesh.segments))
        return Sampled(places, np.matmul(shapes.T, positions).reshape(-1, 3),
                       deformation(gradients, positions).reshape(-1, 3, 2),
                       covered * self.specimen.electrode.coverage(*places[:, :2].T),
                       self.specimen.electrode.share(segments))

    def density(self, voltage_squared: Any, *, nodal: bool = False) -> FilmDensity:
        """Make the film's energy density at U² [V²] at quadrature points, or elements' nodes."""
        thickness, covered = self.relative_thickness, self.covered
        if nodal:
            mesh = self.discretisation
            x, y, _ = np.moveaxis(mesh.reference[mesh.connectivity], -1, 0)
            thickness = self.specimen.relative_thickness(x, y)
            covered = mesh.covered * self.specimen.electrode.coverage(x, y)
        return FilmDensity(self.specimen, voltage_squared, covered, self.wrinkles, self.flow,
                           thickness, self.shares)

    def in_tension(self, state: State) -> bool:
        """Check that the film is in tension at all quadrature points."""
        return self.least_tension(state) > 0

    def least_tension(self, state: State) -> float:
        """Find the smallest principal tension, if the film could not wrinkle.

        It is ∂W/∂λ₂ at the quadrature points [Pa], and may be negative.
        """
        return self._least_tension(self.cauchy_green(state.positions), state.voltage_squared)

    def _least_tension(self, c: tuple[AnyArray, AnyArray, AnyArray], voltage_squared: Any) -> float:
        materials = self.density(voltage_squared).material.materials
        stretches = principal_stretches(c, self.specimen.membrane.prestretch)
        return float(total(materials, *stretches)[2].min(initial=np.inf))

    def least_stress(self, state: State) -> float | None:
        """Find the smallest principal true stress at the nodes of a film kept from wrinkling [Pa].

        None if it does not follow from the principal stretches alone.
        """
        density, (l1, l2) = self._at_nodes(state)
        if density.flow is not None or not density.coaxial:
            return None
        _, w1, w2, *_ = total(density.material.materials, l1, l2)
        return float(min((l1 * w1).min(), (l2 * w2).min()))

    def _at_nodes(self, state: State) -> tuple[FilmDensity, tuple[AnyArray, AnyArray]]:
        """Make the film's density and compute principal stretches at the nodes of every element."""
        mesh = self.discretisation
        c = cauchy_green(deformation(mesh.nodal_gradients,
                                     state.positions[mesh.connectivity]))
        return (self.density(state.voltage_squared, nodal=True),
                principal_stretches(c, self.specimen.membrane.prestretch))

    def thinning_margin(self, state: State) -> float:
        """Find the least stiffness or tension of a wrinkling film [Pa]; see :class:`TensionField`.

        It is taken at the nodes of every element, so that the film's edges count, and is negative
        where the film gets thinner until it breaks down.
        """
        density, stretches = self._at_nodes(state)
        return float(density.material.thinning_margin(*stretches).min())

    @cached_property
    def slack_when_mounted(self) -> bool:
        """Whether the flat film has, somewhere, less tension than the residual one it keeps."""
        state = self.mounted()
        material = self.density(state.voltage_squared).material
        stretches = self.stretches(state.positions)
        tension = total(material.materials, *stretches)[2] / stretches[1]
        return bool((tension < material.residual).any())

    def residual_share(self, state: State) -> float:
        """Compute the share of residual tension in the stresses' work up to a state."""
        material = self.density(state.voltage_squared).material
        c, prestretch = self.cauchy_green(state.positions), self.specimen.membrane.prestretch
        f = self.discretisation.deformation(state.positions)
        motion = state.positions - self.discretisation.reference

        def work(residual: Any) -> Any:
            film = replace(material, residual=residual)
            stress = plane_stress(film, c, prestretch, tangent=False).stress
            return (self._nodal(f, stress) * motion).sum()

        whole = work(material.residual)
        part = material.residual * complex_step(work, material.residual)
        return float(part / whole) if whole else 0.0

    def stretches(self, positions: AnyArray) -> tuple[AnyArray, AnyArray]:
        """Compute the principal stretches from the virgin film, if it does not wrinkle."""
        return principal_stretches(self.cauchy_green(positions),
                                   self.specimen.membrane.prestretch)

    def energy(self, positions: AnyArray, voltage_squared: Any) -> Any:
        """Integrate the stored energy of this mesh, counted from the virgin film [J]."""
        density = self.density(voltage_squared)(self.cauchy_green(positions), tangent=False)
        return (density.energy * self.volumes).sum()

    def forces(self, positions: AnyArray, voltage_squared: Any) -> AnyArray:
        """Differentiate the energy by the node positions [N], shape (nodes, 3)."""
        f = self.discretisation.deformation(positions)
        stress = self.density(voltage_squared)(cauchy_green(f), tangent=False).stress
        return self._nodal(f, stress)

    def reaction(self, state: State) -> Any:
        """Compute the force with which the film pulls the whole plate back [N], against the load.

        It is the virtual work of stresses, weight and gas of the film when the plate alone moves
        along the load. In equilibrium it equals, on any mesh, the force on the plate itself. Gas
        and weight that elements at the plate's edge pass on to it count as the film's.
        """
        return self.nodal_forces(state)[self.discretisation.plate_nodes, 2].sum() * (
            self.discretisation.mirrored)

    def capacitance(self, state: State) -> Any:
        """Compute Q/U = −2 ∂energy/∂U² of the whole film [F].

        The energy includes the electrostatic one at constant voltage, which is linear in U² where
        the film does not wrinkle; model and state may then be complex.
        """
        material = self.density(state.voltage_squared).material
        first, second, _ = material.stretches(*self.stretches(state.positions))
        slope = (self.density(1.0).maxwell.derivatives(first, second)[0] * self.volumes).sum()
        return -2 * slope * self.discretisation.mirrored

    def integrals(self, states: Sequence[State]) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Integrate reaction [N], capacitance [F] and energy [J] of the whole film, each (states,).

        The results are those of :meth:`reaction`, :meth:`capacitance` and :meth:`energy`, of all
        states together from one evaluation of the film's density, at U² with an imaginary step. The
        reaction is the work of stresses, weight and gas when the plate's edge alone is lifted by
        one.
        """
        mesh = self.discretisation
        f = mesh.deformation(np.stack([state.positions for state in states]))
        squared = np.array([state.voltage_squared for state in states])[:, None, None]
        density = self.density(squared + 1j * STEP)(cauchy_green(f), tangent=False)
        energy = (density.energy * self.volumes).sum(axis=(1, 2)) * mesh.mirrored
        stress = density.stress.real * self.volumes[..., None]
        edge = np.zeros(len(mesh.reference))
        edge[mesh.plate_nodes] = 1.0
        lift = np.matmul(mesh.gradients.swapaxes(-1, -2),
                         edge[mesh.connectivity][:, None, :, None])[..., 0]
        matrices = stress[..., [[0, 2], [2, 1]]]
        work = np.einsum("sepi,sepij,epj->s", f[..., 2, :], matrices, lift)
        loads = np.array([self._load_on_edge(state) for state in states])
        return (work - loads) * mesh.mirrored, -2 * energy.imag / STEP, energy.real

    def _load_on_edge(self, state: State) -> float:
        """Sum weight and gas [N] of the film at the nodes of the plate's edge, along the load."""
        edge = self.discretisation.plate_nodes
        load = self.weight[edge, 2].sum()
        if state.pressure:
            load += state.pressure * self._volume_forces(state)[edge, 2].sum()
        return float(load)

    def gas_volume(self, state: State) -> Any:
        """Compute the gas volume below this mesh's film [m³]; see :func:`film_volume`."""
        return film_volume(self.discretisation, state.positions)[0]

    def nodal_forces(self, state: State) -> AnyArray:
        """Differentiate the potential by node positions, without the actions on the plate [N]."""
        forces = self.forces(state.positions, state.voltage_squared) - self.weight
        return forces - state.pressure * self._volume_forces(state) if state.pressure else forces

    def residual(self, forces: AnyArray, state: State) -> Parts:
        """Compute unbalanced forces on free components and plate freedoms, from nodal forces."""
        outer = self._on_plate(state)[1][list(self.plate_freedoms)] / self.discretisation.mirrored
        inner, plate = self.on_freedoms(forces, state.plate)
        return inner, plate + outer

    def guiding(self, state: State) -> AnyArray:
        """Compute forces [N] and moments [N m] with which the guide holds the plate, (6,).

        Moments are about axes through the plate's centre. They are derivatives of film energy and
        load by the motions that the guide forbids, and 0 for motions that it allows or that
        symmetry excludes.
        """
        mesh = self.discretisation
        forces = self.nodal_forces(state)[mesh.plate_nodes]
        whole = state.plate.gathered(self.arms, forces) * mesh.mirrored + self._on_plate(state)[1]
        free = GUIDES[self.loading.guide].union(*(_REVERSED[plane] for plane in mesh.planes))
        return np.where([name in free for name in FREEDOMS], 0.0, whole)

    def unbalanced(self, state: State) -> float:
        """Find the largest unbalanced force on a free component, over the largest nodal force."""
        forces = self.nodal_forces(state)
        return float(np.abs(forces[self.discretisation.free]).max(initial=0.0)
                     / np.abs(forces).max())

    def by_load(self, state: State, load: Load) -> Parts:
        """Differentiate the residual by force, U² or pressure, at a fixed configuration."""
        mesh, allowed = self.discretisation, list(self.plate_freedoms)
        if load == "voltage":
            return self.on_freedoms(self._electric_forces(state), state.plate)
        if load == "pressure":
            inner, plate = self.on_freedoms(-self._volume_forces(state), state.plate)
            outer = -plate_volume(self.plate_area, state.plate)[1][allowed] / mesh.mirrored
            return inner, plate + outer
        lift = self.loading.lift(state.plate)[allowed]
        return np.zeros(mesh.free_count), -lift / mesh.mirrored

    def _electric_forces(self, state: State) -> AnyArray:
        """Differentiate nodal forces by U² [N/V²]; they are not linear in it if wrinkled."""
        f = self.discretisation.deformation(state.positions)
        c = cauchy_green(f)
        if self.wrinkles and not self._least_tension(c, state.voltage_squared) > 0:
            return np.asarray(complex_step(lambda squared: self.forces(state.positions, squared),
                                           state.voltage_squared))
        electric = self.density(1.0).maxwell
        stress = plane_stress(electric, c, self.specimen.membrane.prestretch, tangent=False).stress
        return self._nodal(f, stress)

    def linearised(self, state: State) -> Linearised:
        """Compute forces and tangent, with the plate's freedoms as border."""
        mesh = self.discretisation
        f = mesh.deformation(state.positions)
        density = self.density(state.voltage_squared)(cauchy_green(f))
        elements = element_tangents(mesh.gradients, f, density.stress, density.tangent,
                                    self.volumes)
        forces = self._nodal(f, density.stress) - self.weight
        if state.pressure:
            _, first, second = film_volume(mesh, state.positions, second=True)
            elements = elements - state.pressure * np.asarray(second)
            forces = forces - state.pressure * mesh.scatter(first)
        gradient = state.plate.gradient(self.arms)[:, :, self.plate_freedoms]
        border, corner = mesh.plate_coupling(elements, gradient)
        return Linearised(forces, mesh.unknowns.pattern.assemble(elements), border,
                          corner + self.plate_curvature(forces, state))

    def plate_curvature(self, forces: AnyArray, state: State) -> AnyArray:
        """Compute the stiffness of plate freedoms by the curvature of their motions, (p, p)."""
        mesh, allowed = self.discretisation, self.plate_freedoms
        bend = self._on_plate(state)[2] / mesh.mirrored
        if any(freedom >= 3 for freedom in allowed):  # if the plate may turn
            bend = bend + state.plate.curvature(self.arms, forces[mesh.plate_nodes])
        return bend[np.ix_(allowed, allowed)]

    def on_freedoms(self, forces: AnyArray, plate: PlateMotion) -> Parts:
        """Collect nodal forces [N] on free components, and on the plate's freedoms [N, N m]."""
        mesh = self.discretisation
        on_plate = plate.gathered(self.arms, forces[mesh.plate_nodes])
        return forces[mesh.free], on_plate[list(self.plate_freedoms)]

    def _nodal(self, f: AnyArray, stress: AnyArray) -> AnyArray:
        mesh = self.discretisation
        return mesh.scatter(element_forces(mesh.gradients, f, stress * self.volumes[..., None]))

    def _on_plate(self, state: State) -> tuple[Any, AnyArray, AnyArray]:
        area = self.plate_area if state.pressure else 0.0
        return self.loading.on_plate(state, self.centre, area)

    def _volume_forces(self, state: State) -> AnyArray:
        return self.discretisation.scatter(film_volume(self.discretisation, state.positions)[1])


@dataclass(frozen=True)
class Linearised:
    """Forces and tangent at one state.

    ``forces`` (nodes, 3); ``inner`` is the tangent of the free components (n, n); ``border`` (n, p)
    and ``corner`` (p, p) couple the plate's allowed freedoms.
    """

    forces: AnyArray
    inner: csc_matrix
    border: AnyArray
    corner: AnyArray


def cauchy_green(f: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Compute (C₁₁, C₂₂, C₁₂) of C = FᵀF, F of shape (..., 3, 2), without complex conjugation."""
    a, b = f[..., 0], f[..., 1]
    return tuple(np.einsum("...i,...i", *pair) for pair in ((a, a), (b, b), (a, b)))
