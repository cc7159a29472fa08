"""Virtual work of all forces along fixed motions, and how it changes with what model and state depend on.

Motions meet the film once. They stretch it by δλ₁ and δλ₂ at every quadrature point, so that a
number of the film costs no more than the materials it changes: their W₁δλ₁ + W₂δλ₂. A change of
shape moves the nodes in the plane by V at constant displacements. The work then changes as if the
film moved by V, and because its virgin state changes at fixed positions: by ∫ T·∇V, with T = (S·δE)
I − δ(C S) for the stored energy (Eshelby's energy-momentum tensor, *J. Elasticity* 5, 1975, along
the motion). Collected at the nodes both serve all lengths. The gas needs no T: the volume under the
film does not depend on what the virgin film was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.derivatives.stiffness import Stiffness, spread, strains
from tympan.fem.film.density import Part, Stretching, plane_stress
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import State

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Work:
    """Work along motions of free components and plate freedoms.

    ``own`` is the state the motions start from.
    """

    own: Stiffness
    motions: Sequence[Parts]

    def change(self, model: Model, state: State) -> Array:
        """Imaginary part of the work when something has an imaginary step [J per unit of motion], shape (motions,).

        What the step does not touch is left out.
        """
        mine = self.own.model
        result = self._by_film(model, state)
        if model.pull != mine.pull:
            result = result - self._nodal[:, :, 2] @ model.weight[:, 2].imag
        if np.imag(state.pressure):
            result = result - np.imag(state.pressure) * self._by_pressure
        if model.loading is not mine.loading or np.any(np.imag([state.force, state.pressure,
                                                                model.plate_area])):
            on_plate = model.loading.on_plate(state, model.centre,
                                              model.plate_area)[1][list(model.plate_freedoms)]
            result = result + self._plate @ on_plate.imag / model.discretisation.mirrored
        if np.iscomplexobj(model.discretisation.reference):
            result = result + self._by_shape(model, state)
        return result

    def _by_film(self, model: Model, state: State) -> Array:
        """By materials that are not those the motions start with, and by the film's virgin thickness."""
        film, result = model.specimen.membrane, np.zeros(len(self.motions))
        if model.specimen is self.own.model.specimen and not np.imag(state.voltage_squared):
            return result
        thickness = film.thickness / film.area_prestretch
        for name, part in model.density(state.voltage_squared).parts.items():
            mine = self._parts.get(name)
            if mine is None or (part.key, part.prestretch) != (mine.key, mine.prestretch):
                result = result + np.imag(thickness * self._power(part))
            elif np.imag(thickness):
                result = result + np.imag(thickness) * self._power(mine)
        return result

    def _power(self, part: Part) -> Any:
        """∫ W₁δλ₁ + W₂δλ₂ over the mounted film for each motion [N]."""
        if part.prestretch == self._stretching.prestretch:
            return self._stretching.power(part.material)
        # Where stretches are all but equal, directions have no derivative by another prestretch;
        # the stress has.
        stress = plane_stress((part.material,), self.own.c, part.prestretch, tangent=False).stress
        weights = self.own.model.discretisation.weights[..., None]
        return np.tensordot(self._strains, stress * weights, axes=3)

    def _by_shape(self, model: Model, state: State) -> Array:
        """By nodes that move within the plane of the mounted film, every one keeping its displacement."""
        mine, plate = self.own.model, self.own.state.plate
        turned = plate.gradient(model.arms)[:, :, mine.plate_freedoms].imag
        forces = self.own.forces[mine.discretisation.plate_nodes]
        follows = np.einsum("nip,mp,ni->m", turned, self._plate, forces)
        moved = np.tensordot(self._returned, state.positions.imag, axes=2)
        slid = np.tensordot(self._configurational, model.discretisation.reference.imag[:, :2], axes=2)
        return np.asarray(moved + slid + follows)

    @cached_property
    def _returned(self) -> Array:
        """The tangent times the motions, at all nodes [N], shape (motions, nodes, 3)."""
        return np.stack([self.own.nodal(row) for row in self._nodal])

    @cached_property
    def _configurational(self) -> Array:
        """Change of the work when a node moves in the virgin film alone [N], shape (motions, nodes, 2)."""
        model, mesh, (sw, dw) = self.own.model, self.own.model.discretisation, self.own.weighted
        result = []
        for change, nodal in zip(self._strains, self._nodal, strict=True):
            by_stress = np.matmul(dw, change[..., None])[..., 0]
            doubled = change * [2, 2, 1]
            tensor = -_matrix(doubled) @ _matrix(sw) - _matrix(np.stack(self.own.c,
                                                                        axis=-1)) @ _matrix(by_stress)
            lift = nodal[:, 2][mesh.connectivity] @ mesh.shapes.T
            own = (change * sw).sum(-1) - model.pull * mesh.weights * lift
            tensor[..., 0, 0] += own
            tensor[..., 1, 1] += own
            elements = np.einsum("eplb,epab->ela", mesh.gradients, tensor, optimize=True)
            result.append(mesh.scatter(elements))
        return np.stack(result)

    @cached_property
    def _by_pressure(self) -> Array:
        """Change of the volume under the film [m³], shape (motions,)."""
        nodes = self.own.model.discretisation.connectivity
        return np.tensordot(self._nodal[:, nodes], self.own.volume_forces, axes=3)

    @cached_property
    def _parts(self) -> dict[str, Part]:
        return self.own.model.density(self.own.state.voltage_squared).parts

    @cached_property
    def _nodal(self) -> Array:
        return np.stack([spread(self.own.model, self.own.state, motion) for motion in self.motions])

    @cached_property
    def _plate(self) -> Array:
        return np.stack([motion[1] for motion in self.motions])

    @cached_property
    def _strains(self) -> Array:
        """What the stress works on, shape (motions, elements, points, 3)."""
        return np.stack([strains(self.own.deformation, self.own.model.discretisation.deformation(row))
                         for row in self._nodal])

    @cached_property
    def _stretching(self) -> Stretching:
        by, model = np.moveaxis(self._strains, -1, 0), self.own.model
        changes = 2 * by[0], 2 * by[1], by[2]
        return Stretching.of(self.own.c, changes, model.specimen.membrane.prestretch,
                             model.discretisation.weights)


def _matrix(triple: Array) -> Array:
    """Symmetric matrices from components 11, 22, 12 on the last axis."""
    return triple[..., [0, 2, 2, 1]].reshape(*triple.shape[:-1], 2, 2)
