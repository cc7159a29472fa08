"""Memory of a film with branches over the stages of one long step of time.

A step that is collocated at several stages (:mod:`tympan.fem.transient.collocation`) meets Ċ_v =
φ (C − κ C_v)/τ, κ = (C : C_v⁻¹)/3, φ the inverse viscosity, at all of them at once. Without κ and φ
that is linear in C_v: with a constant rate a/τ, C_v at stage i is N_i = (1 − Σ_j W_ij) C_v⁰ +
Σ_j W_ij (φ_j C_j − (φ_j κ_j − a) C_v,j)/a, W = (1 + z A)⁻¹ z A, z = a h/τ, A the stages' matrix.
The term in brackets beside C is small and taken from the iteration before. An error of κ mostly
scales N, and the branch's stress depends on N/det(N)^⅓, so that it hardly matters.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg.lapack import dgesv

from tympan.base.arrays import AnyArray
from tympan.fem.film.memory import (
    Memory,
    add_across,
    cofactor,
    cube_root,
    determinant,
    incompressible,
    inner,
    inverse,
    plane_determinant,
)


@dataclass(frozen=True, eq=False)
class StagedFlow:
    """A step in progress from a memory whose points have the shape (..., 1, points).

    ``weights`` W, (branches, stages, stages); ``rates`` a, (branches,); ``kept`` is the remainder
    of the initial C_v at the stages. ``fluidity`` φ/a, 1 or of shape (branches, ..., stages or 1,
    points), and ``lag`` = (κ φ/a − 1) C_v are those of the iteration before.
    """

    memory: Memory
    weights: AnyArray
    rates: AnyArray
    kept: AnyArray
    fluidity: Any
    lag: AnyArray

    @classmethod
    def of(cls, memory: Memory, c: Any, duration: float, matrix: AnyArray) -> StagedFlow:
        """Prepare a step of a duration [s] from C of the virgin film, (3, ..., points), by A."""
        start = Memory(memory.moduli, memory.times, memory.viscous[..., None, :], memory.flows)
        full = incompressible(np.asarray(c)[..., None, :])[:, None]
        rates = np.ones(len(memory.times))
        if memory.flows:
            rates = start.fluidity(full[:3, 0]).reshape(len(rates), -1).mean(1)
        z = (duration * rates / memory.times)[:, None, None] * matrix
        unit = np.eye(len(matrix))
        weights = np.array([dgesv(unit + each, each)[2] for each in z]).reshape(z.shape)
        ones = (1,) * (full.ndim - 4)
        share = (1 - np.add.reduce(weights, 2)).reshape(-1, *ones, len(matrix), 1)
        flow = cls(start, weights, rates, share * start.viscous, 1.0, np.empty(0))
        return flow._at(full, start.viscous, inner(inverse(start.viscous), full))

    def stress(self, c: Any, *, slopes: bool = True
               ) -> tuple[AnyArray, AnyArray, AnyArray | None, StagedFlow]:
        """Compute P and t [Pa] of branches that act as if they stored ½ (P : C + t/det C).

        C is that of the stages, (3, ..., stages, points); P has that shape and t (..., stages,
        points). The slopes have the shape (3, 3, branches, ..., stages, points): ∂S of one stage by
        E of any over the step's weight for the two, as if C were the same at both, without the
        derivative of ½ (P : C + t/det C) itself; None if not requested. The last result is this
        flow at C.
        """
        full = incompressible(c)[:, None]
        grown = self._grown(full)
        area = plane_determinant(grown)
        size = cube_root(area * grown[3])
        strength = self.memory.each(self.memory.moduli) * size
        plane = cofactor(grown) / area
        thick = strength / grown[3]
        stretch = plane * full[:3]
        stretch[2] *= 2
        trace = np.add.reduce(stretch, 0) + full[3] / grown[3]
        flow = self._at(full, grown, trace, size)
        by_plane = np.add.reduce(strength * plane, 1)
        by_area = np.add.reduce(thick, 0)
        if not slopes:
            return by_plane, by_area, None, flow
        part = full[3] * full[3] / grown[3] * cofactor(full)
        along, pull = plane + part, plane - part
        bend = -(strength * along)[:, None] * along - (strength / 3 * pull)[:, None] * pull
        add_across(bend, -strength / area)
        return by_plane, by_area, bend, flow

    def after(self, c: Any) -> list[Memory]:
        """Compute the memories at the stages, at their C."""
        grown = self._grown(incompressible(c)[:, None])
        viscous = grown / cube_root(determinant(grown))
        memory = self.memory
        return [Memory(memory.moduli, memory.times, viscous[..., stage, :], memory.flows)
                for stage in range(viscous.shape[-2])]

    def _grown(self, full: AnyArray) -> AnyArray:
        """Compute C_v at the stages up to its size, shape (4, branches, ..., stages, points)."""
        weights = self.weights.reshape(-1, *(1,) * (full.ndim - 4), *self.weights.shape[1:])
        moved = full if isinstance(self.fluidity, float) else full * self.fluidity
        return np.asarray(self.kept + weights @ (moved - self.lag))

    def _at(self, full: AnyArray, grown: AnyArray, stretch: AnyArray, size: Any = 1.0
            ) -> StagedFlow:
        """Update fluidity and lag at C and at a C_v known up to its size, given C : C_v⁻¹."""
        memory, fluidity = self.memory, self.fluidity
        if memory.flows:
            fluid = replace(memory, viscous=grown / size).fluidity(full[:3, 0])
            fluidity = fluid / memory.each(self.rates)
            stretch = stretch * fluidity
        return StagedFlow(memory, self.weights, self.rates, self.kept, fluidity,
                          (stretch / 3 - 1 / size) * grown)
