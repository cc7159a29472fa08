"""Derivatives of the residual at a state by motions, and along fixed motions by parameters.

The motions are applied to the film once. They stretch it by δλ₁ and δλ₂ at every quadrature point,
so that a parameter of the film costs only its materials' W₁δλ₁ + W₂δλ₂. A change of shape moves the
nodes in the plane by V at constant displacements. The work then changes as if the film moved by V,
and because its virgin state changes at fixed positions: by ∫ T·∇V, with T = (P·δF) I − δ(Fᵀ P) for
the stored energy (Eshelby's energy-momentum tensor, *J. Elasticity* 5, 1975, along the motion).
Both are collected at the nodes once for all lengths. The gas needs no T: the volume under the film
does not depend on its virgin state.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.fem.discretisation.assembly import first_piola, gathered
from tympan.fem.film.density import EnergyPart, plane_stress, virtual_work
from tympan.fem.membrane.loading import film_volume
from tympan.fem.membrane.model import Model, Parts, cauchy_green
from tympan.fem.membrane.state import State


@dataclass(frozen=True, eq=False)
class Stiffness:
    """The exact tangent of a model at a state, as an operator."""

    model: Model
    state: State

    def product(self, motion: Parts) -> Parts:
        """Multiply the tangent by a motion of free components and plate freedoms."""
        model, state = self.model, self.state
        if not model.meshed:
            return np.zeros(0), model.linearised(state).corner @ motion[1]
        inner, plate = model.on_freedoms(self.nodal(self.spread(motion)), state.plate)
        return inner, plate + self._turning @ motion[1]

    def nodal(self, motion: AnyArray) -> AnyArray:
        """Multiply the nodal tangent of film and gas by a motion, both (nodes, 3) [N]."""
        return self.collected(motion, self.stressed(self.model.discretisation.deformation(motion)))

    def stressed(self, change: AnyArray) -> AnyArray:
        """Compute the change of the first Piola–Kirchhoff stress, as ``piola``, when F changes."""
        stress, tangent = self.weighted
        by_stress = np.einsum("...ij,...j->...i", tangent, self.strains(change))
        return first_piola(change, stress) + first_piola(self.deformation, by_stress)

    def collected(self, motion: AnyArray, piola: AnyArray) -> AnyArray:
        """Collect the change of nodal forces from a motion and its stresses, (nodes, 3) [N]."""
        mesh, pressure = self.model.discretisation, self.state.pressure
        elements = gathered(mesh.gradients, piola)
        if pressure:
            local = motion[mesh.connectivity].reshape(len(elements), -1, 1)
            elements -= pressure * np.matmul(self.volume[1], local).reshape(elements.shape)
        return mesh.scatter(elements)

    def spread(self, motion: Parts) -> AnyArray:
        """Spread a motion to all nodes, shape (nodes, 3)."""
        mesh = self.model.discretisation
        nodal = np.zeros(self.state.positions.shape)
        nodal[mesh.free] = motion[0]
        nodal[mesh.plate_nodes] = self._following @ motion[1]
        return nodal

    def strains(self, change: AnyArray) -> AnyArray:
        """Compute the strains conjugate to S₁₁, S₂₂ and S₁₂ when F changes."""
        a, b = np.moveaxis(self.deformation, -1, 0)
        by_a, by_b = np.moveaxis(change, -1, 0)
        shear = _dot(a, by_b) + _dot(b, by_a)
        return np.stack([_dot(a, by_a), _dot(b, by_b), shear], axis=-1)

    @cached_property
    def _following(self) -> AnyArray:
        """Derivative of plate nodes by the plate's freedoms, (plate nodes, 3, freedoms)."""
        return self.state.plate.gradient(self.model.arms)[:, :, self.model.plate_freedoms]

    @cached_property
    def deformation(self) -> AnyArray:
        """F at the quadrature points, shape (elements, points, 3, 2)."""
        return self.model.discretisation.deformation(self.state.positions)

    @cached_property
    def c(self) -> tuple[AnyArray, AnyArray, AnyArray]:
        """C at the quadrature points."""
        return cauchy_green(self.deformation)

    @cached_property
    def taut(self) -> bool:
        """Whether the film has no wrinkles."""
        return self.model.in_tension(self.state)

    @cached_property
    def weighted(self) -> tuple[AnyArray, AnyArray]:
        """Stress and its tangent by strains, times virgin volumes."""
        density = self.model.density(self.state.voltage_squared)(self.c)
        volumes = self.model.volumes[..., None]
        return density.stress * volumes, density.tangent * volumes[..., None]

    @cached_property
    def piola(self) -> AnyArray:
        """First Piola–Kirchhoff stress times virgin volumes, (2, elements, points, 3)."""
        return first_piola(self.deformation, self.weighted[0])

    @cached_property
    def forces(self) -> AnyArray:
        """Nodal forces of film, gas and own weight, without what acts on the plate [N]."""
        mesh = self.model.discretisation
        elements = gathered(mesh.gradients, self.piola)
        if self.state.pressure:
            elements -= self.state.pressure * self.volume[0]
        return mesh.scatter(elements) - self.model.weight

    @cached_property
    def volume(self) -> tuple[AnyArray, Any]:
        """Derivatives of the film's volume, the second only under pressure."""
        return film_volume(self.model.discretisation, self.state.positions,
                           second=self.state.pressure != 0)[1:]

    @cached_property
    def _turning(self) -> AnyArray:
        """Stiffness that turning the plate adds, from the forces on it."""
        return self.model.plate_curvature(self.forces, self.state)


class ResidualDerivative:
    """Derivatives of the residual by parameters, multiplied by given motions from a state."""

    def __init__(self, at: Stiffness, motions: Sequence[Parts]) -> None:
        self.at = at
        self._nodal = np.stack([at.spread(motion) for motion in motions])
        self._plate = np.stack([motion[1] for motion in motions])

    def by(self, model: Model, state: State) -> AnyArray:
        """Compute the imaginary part of the virtual work for an imaginary step, shape (motions,).

        The unit is J per unit of motion. Terms that the step does not change are left out.
        """
        if not model.meshed:
            plate = model.residual(model.nodal_forces(state), state)[1]
            return np.asarray(self._plate @ np.imag(plate))
        mine, other_film = self.at.model, not self._same_film(model)
        result = np.zeros(len(self._plate))
        if other_film or np.imag(state.voltage_squared):
            result = self._by_film(model, state)
        if (other_film or model.loading is not mine.loading) and np.any(np.imag(model.pull)):
            mesh = mine.discretisation
            lift = self._nodal[:, mesh.connectivity, 2] @ mesh.shapes.T
            result = result - np.tensordot(lift, np.imag(model.pull) * mesh.weights, axes=2)
        if np.imag(state.pressure):
            nodes = mine.discretisation.connectivity
            volume = np.tensordot(self._nodal[:, nodes], self.at.volume[0], axes=3)
            result = result - np.imag(state.pressure) * volume
        loads = state.force, state.pressure, model.plate_area
        if model.loading is not mine.loading or np.any(np.imag(loads)):
            on_plate = model.loading.on_plate(state, model.centre, model.plate_area)[1]
            on_plate = on_plate[list(model.plate_freedoms)].imag / model.discretisation.mirrored
            result = result + self._plate @ on_plate
        if np.iscomplexobj(model.discretisation.reference):
            result = result + self._by_shape(model, state)
        return result

    def _by_film(self, model: Model, state: State) -> AnyArray:
        """Differentiate by materials other than those at the start, and by virgin thickness."""
        film, result = model.specimen.membrane, np.zeros(len(self._plate))
        thickness = film.volume_per_area
        uneven = bool(np.any(np.imag(model.relative_thickness)))
        stirred = uneven or bool(np.any(np.imag(model.covered)) or np.any(np.imag(model.shares)))
        relative = model.relative_thickness if uneven else self.at.model.relative_thickness
        for part in self._parts_of(model, state):
            if stirred or part not in self._parts:
                result = result + np.imag(thickness * self._virtual_work(*part, relative))
            elif np.imag(thickness):
                result = result + np.imag(thickness) * np.real(self._virtual_work(*part, relative))
        return result

    def _same_film(self, model: Model) -> bool:
        """Check that film and electrode are those at the start, even if their points moved."""
        mine, other = self.at.model.specimen, model.specimen
        same = other.membrane is mine.membrane and other.electrode is mine.electrode
        return same and self.at.model.even

    def _virtual_work(self, material: Any, prestretch: tuple[Any, Any], relative: Any) -> Any:
        """Integrate W₁δλ₁ + W₂δλ₂ over the mounted film for each motion [N].

        ``relative`` is the virgin thickness over the stated one.
        """
        if prestretch == self.at.model.specimen.membrane.prestretch:
            even = relative is self.at.model.relative_thickness
            return (self._stretching if even else self._stretched(relative))(material)
        # Where both stretches are almost equal, their directions have no derivative by another
        # prestretch; the stress has one.
        stress = plane_stress(material, self.at.c, prestretch, tangent=False).stress
        weights = (self.at.model.discretisation.weights * relative)[..., None]
        return np.tensordot(self._strains, stress * weights, axes=3)

    def _by_shape(self, model: Model, state: State) -> AnyArray:
        """Differentiate by nodes that move in the mounted film, at constant displacements."""
        mine, plate = self.at.model, self.at.state.plate
        turned = plate.gradient(model.arms)[:, :, mine.plate_freedoms].imag
        forces = self.at.forces[mine.discretisation.plate_nodes]
        follows = np.einsum("nip,mp,ni->m", turned, self._plate, forces)
        returned, configurational = self._nodal_changes
        moved = np.tensordot(returned, state.positions.imag, axes=2)
        places = model.discretisation.reference.imag[:, :2]
        slid = np.tensordot(configurational, places, axes=2)
        slopes: AnyArray = moved + slid + follows
        return slopes

    @cached_property
    def _nodal_changes(self) -> tuple[AnyArray, AnyArray]:
        """The tangent times the motions at all nodes [N], and the configurational forces.

        The shapes are (motions, nodes, 3) and (motions, nodes, 2). Configurational forces are the
        change of the work as nodes move in the virgin film alone.
        """
        at, model, mesh = self.at, self.at.model, self.at.model.discretisation
        rows = []
        for nodal in self._nodal:
            change = mesh.deformation(nodal)
            stressed = at.stressed(change)
            tensor = -_pulled_back(at.deformation, stressed) - _pulled_back(change, at.piola)
            lift = nodal[:, 2][mesh.connectivity] @ mesh.shapes.T
            work = np.einsum("epia,aepi->ep", change, at.piola) - model.pull * mesh.weights * lift
            tensor[0, ..., 0] += work
            tensor[1, ..., 1] += work
            rows.append((at.collected(nodal, stressed),
                         mesh.scatter(gathered(mesh.gradients, tensor))))
        returned, configurational = zip(*rows, strict=True)
        return np.stack(returned), np.stack(configurational)

    @cached_property
    def _parts(self) -> list[EnergyPart]:
        return self._parts_of(self.at.model, self.at.state)

    def _parts_of(self, model: Model, state: State) -> list[EnergyPart]:
        """List the parts of the energy density; without wrinkles, one for each material."""
        density = model.density(state.voltage_squared)
        return replace(density, wrinkles=model.wrinkles and not self.at.taut).parts

    @cached_property
    def _strains(self) -> AnyArray:
        """Strains conjugate to the stress, shape (motions, elements, points, 3)."""
        deformation = self.at.model.discretisation.deformation
        return np.stack([self.at.strains(deformation(row)) for row in self._nodal])

    @cached_property
    def _stretching(self) -> Callable[[Any], Any]:
        return self._stretched(self.at.model.relative_thickness)

    def _stretched(self, relative: Any) -> Callable[[Any], Any]:
        by, model = np.moveaxis(self._strains, -1, 0), self.at.model
        changes = 2 * by[0], 2 * by[1], by[2]
        return virtual_work(self.at.c, changes, model.specimen.membrane.prestretch,
                            model.discretisation.weights * relative)


def _dot(a: AnyArray, b: AnyArray) -> AnyArray:
    product: AnyArray = np.einsum("...i,...i", a, b)
    return product


def _pulled_back(f: AnyArray, piola: AnyArray) -> AnyArray:
    """Multiply Fᵀ P by columns of P, (2, elements, points, 2)."""
    product: AnyArray = np.einsum("epia,bepi->bepa", f, piola)
    return product
