"""Adjoint solves by factors from nearby, and the work of forces along their solutions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.model import Model, Parts, cauchy_green
from fem.motions import AllMotions
from fem.newton import Solution
from fem.paths import Outcome
from fem.state import State
from fem.tangent import Tangent
from fem.volume import FilmVolume

Array = NDArray[Any]

#: Relative error of an adjoint solution.
_EXACT = 1e-10
_REFINEMENTS = 12


@dataclass(frozen=True, eq=False)
class Adjoint:
    """Solves with an equilibrium's own tangent, by the factors of one nearby.

    Newton factorises the tangent of an iterate some 1e-4 of the frame's extent before the equilibrium. Iterative
    refinement with the equilibrium's own tangent, which needs no factors, gains three digits a step.
    """

    model: Model
    state: State
    tangent: Tangent

    @classmethod
    def of(cls, model: Model, found: Outcome | Solution | State) -> Adjoint:
        """With the factors a solution brings, if they are of all motions of this model; otherwise with new ones."""
        solution = found.solution if isinstance(found, Outcome) else found
        tangent = solution.tangent if isinstance(solution, Solution) else None
        state = solution if isinstance(solution, State) else solution.state
        if tangent is None or not isinstance(tangent.motions, AllMotions) or tangent.model.unknowns != model.unknowns:
            tangent = Tangent(model, model.linearised(state), state)
        return cls(model, state, tangent)

    def solve(self, right: Parts) -> Parts:
        """Refined until the next correction would not matter, or would be no shorter than the last."""
        found = self.tangent.respond(right)
        size = last = _length(found)
        for _ in range(_REFINEMENTS):
            product = self.product(found)
            more = self.tangent.respond((right[0] - product[0], right[1] - product[1]))
            length = _length(more)
            if not length < last:
                break
            found = found[0] + more[0], found[1] + more[1]
            # The next correction is expected shorter in the same proportion.
            if length * length <= _EXACT * size * last:
                break
            last = length
        return found

    def product(self, motion: Parts) -> Parts:
        """The equilibrium's tangent times a motion."""
        model, state, (sw, dw) = self.model, self.state, self._weighted
        nodal = _nodal(model, state, motion)
        f, change = self._deformation, model.deformation(nodal)
        by_stress = np.matmul(dw, _strains(f, change)[..., None])[..., 0]
        elements = element_forces(model, change, sw) + element_forces(model, f, by_stress)
        if state.pressure:
            local = nodal[model.connectivity].reshape(len(elements), -1, 1)
            elements -= state.pressure * np.matmul(self._film_volume, local).reshape(elements.shape)
        forces = scattered(model, elements)
        return forces[model.free], model.plate_forces(forces, state.plate) + self._plate @ motion[1]

    @cached_property
    def _deformation(self) -> Array:
        return self.model.deformation(self.state.positions)

    @cached_property
    def _weighted(self) -> tuple[Array, Array]:
        """Stress and its tangent by strains, times virgin volumes."""
        density = self.model.density(self.state.voltage_squared)(cauchy_green(self._deformation))
        volumes = self.model.volumes[..., None]
        assert density.tangent is not None
        return density.stress * volumes, density.tangent * volumes[..., None]

    @cached_property
    def _film_volume(self) -> Array:
        return _volume(self.model, self.state, self._deformation).second()

    @cached_property
    def _plate(self) -> Array:
        """What the turning of the plate adds to its own stiffness: that of the forces on it."""
        model, state = self.model, self.state
        elements = element_forces(model, self._deformation, self._weighted[0])
        if state.pressure:
            elements -= state.pressure * _volume(model, state, self._deformation).first()
        forces = (scattered(model, elements) - model.weight)[model.plate_nodes]
        outer = model.loading.on_plate(state, model.centre, model.plate_area)[2] / model.mirrored
        allowed = model.plate_freedoms
        return np.asarray((state.plate.curvature(model.arms, forces) + outer)[np.ix_(allowed, allowed)])


@dataclass(frozen=True, eq=False)
class Work:
    """Virtual work along fixed motions: the residual times each of them, without forming it.

    ``model`` and ``state`` they start from; ``deformation`` F and ``c`` of the film; ``strains`` what the stress works
    on, shape (motions, elements, points, 3); ``nodal`` motions of the nodes (motions, nodes, 3); ``plate`` of the
    plate's freedoms (motions, freedoms).
    """

    model: Model
    state: State
    deformation: Array
    c: tuple[Array, Array, Array]
    strains: Array
    nodal: Array
    plate: Array

    @classmethod
    def of(cls, model: Model, state: State, motions: Sequence[Parts]) -> Work:
        """Along motions of free components and plate freedoms."""
        f = model.deformation(state.positions)
        nodal = np.stack([_nodal(model, state, motion) for motion in motions])
        strains = np.stack([_strains(f, model.deformation(row)) for row in nodal])
        return cls(model, state, f, cauchy_green(f), strains, nodal, np.stack([motion[1] for motion in motions]))

    def against(self, model: Model, state: State) -> Array:
        """Work of all forces of another material or under other loads [J per unit of motion], shape (motions,)."""
        same = model.specimen is self.model.specimen and state.voltage_squared == self.state.voltage_squared
        work = self._own if same else self._by_stress(model, state)
        if model.specimen.membrane.density * model.loading.gravity:
            work = work - self.nodal[:, :, 2] @ model.weight[:, 2]
        if state.pressure:
            first = _volume(model, state, self.deformation).first()
            work = work - state.pressure * np.tensordot(self.nodal[:, model.connectivity], first, axes=3)
        on_plate = model.loading.on_plate(state, model.centre, model.plate_area)[1][list(model.plate_freedoms)]
        return np.asarray(work + self.plate @ on_plate / model.mirrored)

    def _by_stress(self, model: Model, state: State) -> Array:
        weighted = model.density(state.voltage_squared)(self.c, tangent=False).stress * model.volumes[..., None]
        return np.asarray(np.tensordot(self.strains, weighted, axes=3))

    @cached_property
    def _own(self) -> Array:
        return self._by_stress(self.model, self.state)


def _nodal(model: Model, state: State, motion: Parts) -> Array:
    """The motion of all nodes, shape (nodes, 3)."""
    gradient = state.plate.gradient(model.arms)[:, :, model.plate_freedoms]
    nodal = np.zeros(state.positions.shape, dtype=gradient.dtype)
    nodal[model.free] = motion[0]
    nodal[model.plate_nodes] = gradient @ motion[1]
    return nodal


def _strains(f: Array, change: Array) -> Array:
    """What S₁₁, S₂₂ and S₁₂ work on when F changes."""
    product = np.matmul(f.swapaxes(-1, -2), change)
    return np.stack([product[..., 0, 0], product[..., 1, 1], product[..., 0, 1] + product[..., 1, 0]], axis=-1)


def element_forces(model: Model, f: Array, weighted: Array) -> Array:
    """Σ F S ∇φ of every element for stresses times volumes, shape (elements, local, 3)."""
    first = weighted[..., 0, None] * f[..., 0] + weighted[..., 2, None] * f[..., 1]
    second = weighted[..., 2, None] * f[..., 0] + weighted[..., 1, None] * f[..., 1]
    g = model.gradients
    result = np.matmul(g[..., 0].transpose(0, 2, 1), first) + np.matmul(g[..., 1].transpose(0, 2, 1), second)
    return np.asarray(result)


def scattered(model: Model, elements: Array) -> Array:
    """Sums over the elements at each node, shape (nodes, 3)."""
    nodes, count = model.connectivity.ravel(), len(model.reference)
    return np.stack([np.bincount(nodes, elements[..., axis].ravel(), count) for axis in range(3)], axis=1)


def _volume(model: Model, state: State, deformation: Array) -> FilmVolume:
    return FilmVolume(state.positions[model.connectivity], deformation, model.shapes, model.gradients, model.weights)


def _length(motion: Parts) -> float:
    return float(max(np.abs(motion[0]).max(initial=0.0), np.abs(motion[1]).max(initial=0.0)))
