"""What a film with branches remembers over the stages of one long step of time.

A step that is collocated at several stages (:mod:`tympan.fem.transient.collocation`) meets Ċ_v =
φ (C − κ C_v)/τ, κ = (C : C_v⁻¹)/3, φ the inverse viscosity, at all of them at once. That is linear
in C_v but for κ and φ: with a constant rate a/τ, C_v at stage i is N_i = (1 − Σ_j W_ij) C_v⁰ +
Σ_j W_ij (φ_j C_j − (φ_j κ_j − a) C_v,j)/a, W = (1 + z A)⁻¹ z A, z = a h/τ, A the stages' matrix.
What is in brackets beside C is small and taken from the iteration before. An error of κ mostly
scales N, and what the branch pulls with belongs to N/det(N)^⅓, so that hardly feels it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tympan.fem.film.memory import (
    ACROSS,
    Array,
    Memory,
    cube_root,
    determinant,
    incompressible,
    inner,
    inverse,
    plane_determinant,
)


@dataclass(frozen=True, eq=False)
class StagedFlow:
    """A step under way from a memory whose points have the shape (..., 1, points).

    ``weights`` W, (branches, stages, stages); ``rates`` a, (branches,); ``kept``: what is left of
    C_v at the stages. ``fluidity`` φ/a, 1 or of shape (branches, ..., stages or 1, points), and
    ``lag`` = (κ φ/a − 1) C_v, both as they were at the iteration before.
    """

    memory: Memory
    weights: Array
    rates: Array
    kept: Array
    fluidity: Any
    lag: Array

    @classmethod
    def of(cls, memory: Memory, c: Any, duration: float, matrix: Array) -> StagedFlow:
        """A step of a duration [s] from C of the virgin film, (3, ..., points), by a rule's A."""
        start = replace(memory, viscous=memory.viscous[..., None, :])
        before = np.asarray(c)[..., None, :]
        rates = np.ones(len(memory.times))
        if memory.flows:
            rates = start.fluidity(before).reshape(len(rates), -1).mean(1)
        z = (duration * rates / memory.times)[:, None, None] * matrix
        weights = np.linalg.solve(np.eye(len(matrix)) + z, z)
        points = (1,) * (start.viscous.ndim - 4)
        share = 1 - weights.sum(2).reshape(len(rates), *points, len(matrix), 1)
        flow = cls(start, weights, rates, share * start.viscous, 1.0, np.empty(0))
        return flow._at(incompressible(before)[:, None], start.viscous, inverse(start.viscous))

    def stress(self, c: Any) -> tuple[Array, Array, StagedFlow]:
        """At C of the stages, (3, ..., stages, points): S = 2∂/∂C [Pa] in that shape, its slopes.

        The slopes have the shape (3, 3, 1 + branches, ..., stages, points): ∂S/∂E where nothing
        flows, then, by branches, ∂S of one stage by E of any over the step's weight for the two, as
        if C were the same at both. Last comes this flow as it is at C.
        """
        full = incompressible(c)[:, None]
        grown = self._grown(full)
        back, by_full, size = inverse(grown), inverse(full)[:3], cube_root(determinant(grown))
        strength, plane = self.memory.each(self.memory.moduli) * size, back[:3]
        ratio = full[3] / grown[3]
        part = ratio * by_full
        pull = plane - part
        flat, stiffer, along = by_full[:, 0], (strength * ratio).sum(0), plane + part
        slopes = np.empty((3, 3, 1 + len(strength), *stiffer.shape))
        slopes[:, :, 0] = (4 * stiffer * flat)[:, None] * flat + _across(
            stiffer * plane_determinant(flat))
        slopes[:, :, 1:] = ((-strength * along)[:, None] * along
                            - (strength / 3 * pull)[:, None] * pull
                            - _across(strength * plane_determinant(plane)))
        return (strength * pull).sum(1), slopes, self._at(full, grown / size, size * back)

    def after(self, c: Any) -> list[Memory]:
        """The memories at the stages, at their C."""
        grown = self._grown(incompressible(c)[:, None])
        viscous = grown / cube_root(determinant(grown))
        return [replace(self.memory, viscous=viscous[..., stage, :])
                for stage in range(viscous.shape[-2])]

    def _grown(self, full: Array) -> Array:
        """C_v at the stages but for its size, shape (4, branches, ..., stages, points)."""
        weights = self.weights.reshape(-1, *(1,) * (full.ndim - 4), *self.weights.shape[1:])
        return np.asarray(self.kept + weights @ (full * self.fluidity - self.lag))

    def _at(self, full: Array, viscous: Array, back: Array) -> StagedFlow:
        """Flowing as it does at C and C_v, whose inverse is known."""
        fluidity = self.fluidity
        if self.memory.flows:
            fluid = replace(self.memory, viscous=viscous).fluidity(full[:3, 0])
            fluidity = fluid / self.memory.each(self.rates)
        lag = (inner(back, full) / 3 * fluidity - 1) * viscous
        return replace(self, fluidity=fluidity, lag=lag)


def _across(value: Array) -> Array:
    return np.multiply.outer(ACROSS, value)
