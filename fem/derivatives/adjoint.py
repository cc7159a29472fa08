"""Adjoint solves by factors from nearby."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.fem.derivatives.stiffness import Stiffness
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.subspace import FullSubspace
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import State

#: Relative error of an adjoint solution.
_EXACT = 1e-10
_REFINEMENTS = 12


@dataclass(frozen=True, eq=False)
class Adjoint:
    """Solves with an equilibrium's own tangent, by the factors of one nearby.

    Newton factorises the tangent of an iterate some 1e-4 of the frame's extent before the
    equilibrium. Iterative refinement with the equilibrium's own tangent, which needs no factors,
    gains three digits a step.
    """

    stiffness: Stiffness
    nearby: Tangent

    @classmethod
    def of(cls, model: Model, equilibrium: Outcome | Solution | State) -> Adjoint:
        """With the factors a solution brings, if of all motions of this model, or new ones."""
        if isinstance(equilibrium, Outcome):
            equilibrium = equilibrium.solution
        tangent = equilibrium.tangent if isinstance(equilibrium, Solution) else None
        state = equilibrium.state if isinstance(equilibrium, Solution) else equilibrium
        if (tangent is None or not isinstance(tangent.subspace, FullSubspace)
                or tangent.model.unknowns != model.unknowns):
            tangent = Tangent(model, model.linearised(state), state)
        return cls(Stiffness(model, state), tangent)

    def solve(self, right: Parts) -> Parts:
        """Refined until the next correction would not matter, or be no shorter than the last."""
        solution = self.nearby.respond(right)
        size = last = _length(solution)
        for _ in range(_REFINEMENTS):
            product = self.stiffness.product(solution)
            more = self.nearby.respond((right[0] - product[0], right[1] - product[1]))
            length = _length(more)
            if not length < last:
                break
            solution = solution[0] + more[0], solution[1] + more[1]
            # The next correction is expected shorter in the same proportion.
            if length * length <= _EXACT * size * last:
                break
            last = length
        return solution


def _length(motion: Parts) -> float:
    return float(max(np.abs(motion[0]).max(initial=0.0), np.abs(motion[1]).max(initial=0.0)))
