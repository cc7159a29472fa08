"""The tangent at a state without forming it: products with motions, and what they are made of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.discretisation.assembly import element_forces, first_piola, gathered
from tympan.fem.membrane.enclosed_volume import film_volume
from tympan.fem.membrane.model import Model, Parts, cauchy_green
from tympan.fem.membrane.state import State

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Stiffness:
    """The exact tangent of a model at a state, as an operator."""

    model: Model
    state: State

    def product(self, motion: Parts) -> Parts:
        """Change of the residual with a motion of free components and plate freedoms."""
        model, state = self.model, self.state
        inner, plate = model.on_freedoms(self.nodal(spread(model, state, motion)), state.plate)
        return inner, plate + self._plate @ motion[1]

    def nodal(self, motion: Array) -> Array:
        """Change of the nodal forces of film and gas with a motion, both (nodes, 3) [N]."""
        mesh, pressure, (sw, dw) = self.model.discretisation, self.state.pressure, self.weighted
        change = mesh.deformation(motion)
        by_stress = np.matmul(dw, strains(self.deformation, change)[..., None])[..., 0]
        elements = gathered(mesh.gradients, first_piola(change, sw)
                            + first_piola(self.deformation, by_stress))
        if pressure:
            local = motion[mesh.connectivity].reshape(len(elements), -1, 1)
            elements -= pressure * np.matmul(self._volume_stiffness, local).reshape(elements.shape)
        return mesh.scatter(elements)

    @cached_property
    def deformation(self) -> Array:
        """F at the quadrature points, shape (elements, points, 3, 2)."""
        return self.model.discretisation.deformation(self.state.positions)

    @cached_property
    def c(self) -> tuple[Array, Array, Array]:
        """C at the quadrature points."""
        return cauchy_green(self.deformation)

    @cached_property
    def weighted(self) -> tuple[Array, Array]:
        """Stress and its tangent by strains, times virgin volumes."""
        density = self.model.density(self.state.voltage_squared)(self.c)
        volumes = self.model.volumes[..., None]
        return density.stress * volumes, density.tangent * volumes[..., None]

    @cached_property
    def forces(self) -> Array:
        """Nodal forces of film, gas and own weight, without what acts on the plate [N]."""
        mesh = self.model.discretisation
        elements = element_forces(mesh.gradients, self.deformation, self.weighted[0])
        if self.state.pressure:
            elements -= self.state.pressure * self.volume_forces
        return mesh.scatter(elements) - self.model.weight

    @cached_property
    def volume_forces(self) -> Array:
        """Derivative of the film's volume by the elements' nodes [m²], (elements, local, 3)."""
        return film_volume(self.model.discretisation, self.state.positions)[1]

    @cached_property
    def _volume_stiffness(self) -> Any:
        return film_volume(self.model.discretisation, self.state.positions, second=True)[2]

    @cached_property
    def _plate(self) -> Array:
        """What the turning of the plate adds to its own stiffness: that of the forces on it."""
        return self.model.plate_curvature(self.forces, self.state)


def spread(model: Model, state: State, motion: Parts) -> Array:
    """The motion of all nodes, shape (nodes, 3)."""
    mesh = model.discretisation
    gradient = state.plate.gradient(model.arms)[:, :, model.plate_freedoms]
    nodal = np.zeros(state.positions.shape)
    nodal[mesh.free] = motion[0]
    nodal[mesh.plate_nodes] = gradient @ motion[1]
    return nodal


def strains(f: Array, change: Array) -> Array:
    """What S₁₁, S₂₂ and S₁₂ work on when F changes."""
    product = np.matmul(f.swapaxes(-1, -2), change)
    return np.stack([product[..., 0, 0], product[..., 1, 1],
                     product[..., 0, 1] + product[..., 1, 0]], axis=-1)
