"""Virtual work of all forces along fixed motions, and its derivatives by whatever it depends on.

Motions meet the film once. They stretch it by δλ₁ and δλ₂ at every quadrature point, so that a
number of the film costs no more than the materials it changes: their W₁δλ₁ + W₂δλ₂. A change of
shape moves the nodes in the plane by V at constant displacements. The work then changes as if the
film moved by V, and because its virgin state changes at fixed positions: by ∫ T·∇V, with T = (S·δE)
I − δ(C S) for the stored energy (Eshelby's energy-momentum tensor, *J. Elasticity* 5, 1975, along
the motion). Collected at the nodes both serve all lengths. The gas needs no T: the volume under the
film does not depend on what the virgin film was.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.derivatives.stiffness import Stiffness, spread, strains
from tympan.fem.film.density import Part, plane_stress, virtual_work
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import State

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class ResidualDerivative:
    """Derivatives of the residual, times motions of film and plate, by what it depends on.

    ``at`` is the state the motions start from.
    """

    at: Stiffness
    motions: Sequence[Parts]

    def by(self, model: Model, state: State) -> Array:
        """Imaginary part of the virtual work for an imaginary step, shape (motions,).

        In J per unit of motion. What the step does not touch is left out.
        """
        mine = self.at.model
        result = self._by_film(model, state)
        if model.pull != mine.pull:
            result = result - self._nodal[:, :, 2] @ model.weight[:, 2].imag
        if np.imag(state.pressure):
            result = result - np.imag(state.pressure) * self._by_pressure
        loads = state.force, state.pressure, model.plate_area
        if model.loading is not mine.loading or np.any(np.imag(loads)):
            on_plate = model.loading.on_plate(state, model.centre, model.plate_area)[1]
            on_plate = on_plate[list(model.plate_freedoms)].imag / model.discretisation.mirrored
            result = result + self._plate @ on_plate
        if np.iscomplexobj(model.discretisation.reference):
            result = result + self._by_shape(model, state)
        return result

    def _by_film(self, model: Model, state: State) -> Array:
        """By materials that are not those at the start, and by the film's virgin thickness."""
        film, result = model.specimen.membrane, np.zeros(len(self.motions))
        if model.specimen is self.at.model.specimen and not np.imag(state.voltage_squared):
            return result
        thickness = film.thickness / film.area_prestretch
        for name, part in model.density(state.voltage_squared).parts.items():
            mine = self._parts.get(name)
            if mine is None or (part.key, part.prestretch) != (mine.key, mine.prestretch):
                result = result + np.imag(thickness * self._virtual_work(part))
            elif np.imag(thickness):
                result = result + np.imag(thickness) * self._virtual_work(mine)
        return result

    def _virtual_work(self, part: Part) -> Any:
        """∫ W₁δλ₁ + W₂δλ₂ over the mounted film for each motion [N]."""
        if part.prestretch == self.at.model.specimen.membrane.prestretch:
            return self._stretching(part.material)
        # Where stretches are all but equal, directions have no derivative by another prestretch;
        # the stress has.
        stress = plane_stress((part.material,), self.at.c, part.prestretch, tangent=False).stress
        weights = self.at.model.discretisation.weights[..., None]
        return np.tensordot(self._strains, stress * weights, axes=3)

    def _by_shape(self, model: Model, state: State) -> Array:
        """By nodes that move in the mounted film's plane, each keeping its displacement."""
        mine, plate = self.at.model, self.at.state.plate
        turned = plate.gradient(model.arms)[:, :, mine.plate_freedoms].imag
        forces = self.at.forces[mine.discretisation.plate_nodes]
        follows = np.einsum("nip,mp,ni->m", turned, self._plate, forces)
        moved = np.tensordot(self._returned, state.positions.imag, axes=2)
        places = model.discretisation.reference.imag[:, :2]
        slid = np.tensordot(self._configurational, places, axes=2)
        return np.asarray(moved + slid + follows)

    @cached_property
    def _returned(self) -> Array:
        """The tangent times the motions, at all nodes [N], shape (motions, nodes, 3)."""
        return np.stack([self.at.nodal(row) for row in self._nodal])

    @cached_property
    def _configurational(self) -> Array:
        """Change of the work as nodes move in the virgin film alone [N], (motions, nodes, 2)."""
        model, mesh, (sw, dw) = self.at.model, self.at.model.discretisation, self.at.weighted
        c = _matrix(np.stack(self.at.c, axis=-1))
        result = []
        for change, nodal in zip(self._strains, self._nodal, strict=True):
            by_stress = np.matmul(dw, change[..., None])[..., 0]
            doubled = change * [2, 2, 1]
            tensor = -_matrix(doubled) @ _matrix(sw) - c @ _matrix(by_stress)
            lift = nodal[:, 2][mesh.connectivity] @ mesh.shapes.T
            scalar = (change * sw).sum(-1) - model.pull * mesh.weights * lift
            tensor[..., 0, 0] += scalar
            tensor[..., 1, 1] += scalar
            elements = np.einsum("eplb,epab->ela", mesh.gradients, tensor, optimize=True)
            result.append(mesh.scatter(elements))
        return np.stack(result)

    @cached_property
    def _by_pressure(self) -> Array:
        """Change of the volume under the film [m³], shape (motions,)."""
        nodes = self.at.model.discretisation.connectivity
        return np.tensordot(self._nodal[:, nodes], self.at.volume_forces, axes=3)

    @cached_property
    def _parts(self) -> dict[str, Part]:
        return self.at.model.density(self.at.state.voltage_squared).parts

    @cached_property
    def _nodal(self) -> Array:
        return np.stack([spread(self.at.model, self.at.state, motion) for motion in self.motions])

    @cached_property
    def _plate(self) -> Array:
        return np.stack([motion[1] for motion in self.motions])

    @cached_property
    def _strains(self) -> Array:
        """What the stress works on, shape (motions, elements, points, 3)."""
        return np.stack([strains(self.at.deformation, self.at.model.discretisation.deformation(row))
                         for row in self._nodal])

    @cached_property
    def _stretching(self) -> Callable[[Any], Any]:
        by, model = np.moveaxis(self._strains, -1, 0), self.at.model
        changes = 2 * by[0], 2 * by[1], by[2]
        return virtual_work(self.at.c, changes, model.specimen.membrane.prestretch,
                            model.discretisation.weights)


def _matrix(triple: Array) -> Array:
    """Symmetric matrices from components 11, 22, 12 on the last axis."""
    return triple[..., [0, 2, 2, 1]].reshape(*triple.shape[:-1], 2, 2)
