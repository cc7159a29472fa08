"""Adjoint solves by factors from nearby."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.fem.derivatives.stiffness import Stiffness
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.subspace import AllMotions
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

    own: Stiffness
    tangent: Tangent

    @classmethod
    def of(cls, model: Model, found: Outcome | Solution | State) -> Adjoint:
        """With the factors a solution brings, if they are of all motions of this model; otherwise with new ones."""
        solution = found.solution if isinstance(found, Outcome) else found
        tangent = solution.tangent if isinstance(solution, Solution) else None
        state = solution if isinstance(solution, State) else solution.state
        if tangent is None or not isinstance(tangent.motions,
                                             AllMotions) or tangent.model.unknowns != model.unknowns:
            tangent = Tangent(model, model.linearised(state), state)
        return cls(Stiffness(model, state), tangent)

    def solve(self, right: Parts) -> Parts:
        """Refined until the next correction would not matter, or would be no shorter than the last."""
        found = self.tangent.respond(right)
        size = last = _length(found)
        for _ in range(_REFINEMENTS):
            product = self.own.product(found)
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


def _length(motion: Parts) -> float:
    return float(max(np.abs(motion[0]).max(initial=0.0), np.abs(motion[1]).max(initial=0.0)))
