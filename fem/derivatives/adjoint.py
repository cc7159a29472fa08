"""Adjoint solves with an equilibrium's own tangent, by the factors of one nearby.

Newton factorises the tangent of an iterate some 1e-4 of the frame's extent before the equilibrium.
Iterative refinement with the equilibrium's own tangent, which needs no factors, gains three digits
a step.
"""

from __future__ import annotations

import numpy as np

from tympan.fem.derivatives.stiffness import Stiffness
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.subspace import FULL
from tympan.fem.equilibrium.tangent import Tangent
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import State

#: Relative error of an adjoint solution.
_EXACT = 1e-10
_REFINEMENTS = 12


def nearby_tangent(model: Model, equilibrium: Outcome | Solution | State) -> Tangent:
    """The factors a solution brings, if of all motions of this model; or new ones."""
    if isinstance(equilibrium, State):
        return Tangent(model, model.linearised(equilibrium), equilibrium)
    solution = equilibrium.solution if isinstance(equilibrium, Outcome) else equilibrium
    tangent = solution.tangent
    if tangent and tangent.subspace is FULL and tangent.model.unknowns == model.unknowns:
        return tangent
    return nearby_tangent(model, solution.state)


def solve_adjoint(stiffness: Stiffness, nearby: Tangent, right: Parts) -> Parts:
    """Refined until the next correction would not matter, or be no shorter than the last."""
    solution = nearby.respond(right)
    size = last = _length(solution)
    for _ in range(_REFINEMENTS):
        product = stiffness.product(solution)
        more = nearby.respond((right[0] - product[0], right[1] - product[1]))
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
