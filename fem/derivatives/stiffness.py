"""The tangent at a state without forming it: products with motions, and what they are made of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.membrane.enclosed_volume import FilmVolume
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
        forces = self.nodal(spread(model, state, motion))
        return forces[model.free], model.plate_forces(forces, state.plate) + self._plate @ motion[1]

    def nodal(self, motion: Array) -> Array:
        """Change of the nodal forces of film and gas with a motion of all nodes, both of shape (nodes, 3) [N]."""
        model, state, (sw, dw) = self.model, self.state, self.weighted
        change = model.deformation(motion)
        by_stress = np.matmul(dw, strains(self.deformation, change)[..., None])[..., 0]
        elements = _gathered(model, _piola(change, sw) + _piola(self.deformation, by_stress))
        if state.pressure:
            local = motion[model.connectivity].reshape(len(elements), -1, 1)
            elements -= state.pressure * np.matmul(self._volume.second(),
                                                   local).reshape(elements.shape)
        return scattered(model, elements)

    @cached_property
    def deformation(self) -> Array:
        """F at the quadrature points, shape (elements, points, 3, 2)."""
        return self.model.deformation(self.state.positions)

    @cached_property
    def c(self) -> tuple[Array, Array, Array]:
        """C at the quadrature points."""
        return cauchy_green(self.deformation)

    @cached_property
    def weighted(self) -> tuple[Array, Array]:
        """Stress and its tangent by strains, times virgin volumes."""
        density = self.model.density(self.state.voltage_squared)(self.c)
        volumes = self.model.volumes[..., None]
        assert density.tangent is not None
        return density.stress * volumes, density.tangent * volumes[..., None]

    @cached_property
    def forces(self) -> Array:
        """Nodal forces of film, gas and own weight, without what acts on the plate [N], shape (nodes, 3)."""
        elements = element_forces(self.model, self.deformation, self.weighted[0])
        if self.state.pressure:
            elements -= self.state.pressure * self.volume_forces
        return scattered(self.model, elements) - self.model.weight

    @cached_property
    def volume_forces(self) -> Array:
        """Derivative of the volume under the film by the elements' nodes [m²], shape (elements, local, 3)."""
        return self._volume.first()

    @cached_property
    def _volume(self) -> FilmVolume:
        model = self.model
        return FilmVolume(self.state.positions[model.connectivity], self.deformation, model.shapes,
                          model.gradients,
                          model.weights)

    @cached_property
    def _plate(self) -> Array:
        """What the turning of the plate adds to its own stiffness: that of the forces on it."""
        model, state = self.model, self.state
        outer = model.loading.on_plate(state, model.centre, model.plate_area)[2] / model.mirrored
        allowed = model.plate_freedoms
        turned = state.plate.curvature(model.arms, self.forces[model.plate_nodes])
        return np.asarray((turned + outer)[np.ix_(allowed, allowed)])


def spread(model: Model, state: State, motion: Parts) -> Array:
    """The motion of all nodes, shape (nodes, 3)."""
    gradient = state.plate.gradient(model.arms)[:, :, model.plate_freedoms]
    nodal = np.zeros(state.positions.shape)
    nodal[model.free] = motion[0]
    nodal[model.plate_nodes] = gradient @ motion[1]
    return nodal


def strains(f: Array, change: Array) -> Array:
    """What S₁₁, S₂₂ and S₁₂ work on when F changes."""
    product = np.matmul(f.swapaxes(-1, -2), change)
    return np.stack([product[..., 0, 0], product[..., 1, 1],
                     product[..., 0, 1] + product[..., 1, 0]], axis=-1)


def element_forces(model: Model, f: Array, weighted: Array) -> Array:
    """Σ F S ∇φ of every element for stresses times volumes, shape (elements, local, 3)."""
    return _gathered(model, _piola(f, weighted))


def _piola(f: Array, weighted: Array) -> Array:
    """F S, its two columns first: shape (2, elements, points, 3)."""
    return np.stack([weighted[..., 0, None] * f[..., 0] + weighted[..., 2, None] * f[..., 1],
                     weighted[..., 2, None] * f[..., 0] + weighted[..., 1, None] * f[..., 1]])


def _gathered(model: Model, piola: Array) -> Array:
    g = model.gradients
    result = np.matmul(g[..., 0].transpose(0, 2, 1),
                       piola[0]) + np.matmul(g[..., 1].transpose(0, 2, 1), piola[1])
    return np.asarray(result)


def scattered(model: Model, elements: Array) -> Array:
    """Sums over the elements at each node, shape (nodes, components)."""
    nodes, count = model.connectivity.ravel(), len(model.reference)
    parts = [np.bincount(nodes, elements[..., axis].ravel(), count)
             for axis in range(elements.shape[-1])]
    return np.stack(parts, axis=1)
