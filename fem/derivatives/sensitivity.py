"""Exact derivatives of scalar results by material, film, electrode, loads, surroundings and shape.

A quantity q of an equilibrium R(u, p) = 0, u the displacements of nodes and plate, changes with a
parameter p by dq/dp = ∂q/∂p − λ·∂R/∂p, the tangent being K and K λ = ∂q/∂u (adjoint method; Choi &
Kim, *Structural Sensitivity Analysis and Optimization*, 2005). One back-substitution into the
factors the solve left serves all parameters. Both partial derivatives are complex steps, exact to
rounding; but what lengths do to the forces is read off those of λ
(:mod:`tympan.fem.derivatives.residual_derivative`).

Newton's factors are of an iterate some 1e-4 of the frame's extent before the equilibrium. Iterative
refinement with the equilibrium's own tangent, which needs no factors, gains three digits a step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tympan.fem.complex_step import STEP
from tympan.fem.derivatives.parameters import ModelParameter, parameters
from tympan.fem.derivatives.quantities import Quantity
from tympan.fem.derivatives.residual_derivative import ResidualDerivative, Stiffness
from tympan.fem.equilibrium.arc_length import PathPoint
from tympan.fem.equilibrium.newton import Solution, Tangent
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.equilibrium.subspace import FULL
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State
from tympan.geometry.errors import InputError

#: Relative error of an adjoint solution.
_EXACT = 1e-10
_REFINEMENTS = 12

#: Change of the load, relative to it, per arc length over the frame's half extent, below which a
#: point is a limit.
_FOLD = 1e-2


def gradient(model: Model, equilibrium: Outcome | Solution | State, quantity: Quantity,
             names: Sequence[str]) -> dict[str, float]:
    """Derivatives of a quantity at constant loads by each named parameter [SI unit per SI unit].

    An outcome or a solution brings its factors; a bare state is factorised anew. The names are
    those of :func:`~tympan.fem.derivatives.parameters.parameters`. InputError for any other, and
    for quantities that have no derivative there.
    """
    return gradient_many(model, equilibrium, {"": quantity}, parameters(model, names))[""]


def gradient_many(model: Model, equilibrium: Outcome | Solution | State,
                  quantities: Mapping[str, Quantity],
                  by: Mapping[str, ModelParameter]) -> dict[str, dict[str, float]]:
    """Derivatives of quantities by parameters, by their names; one adjoint solve per quantity."""
    if isinstance(equilibrium, Outcome) and equilibrium.status != "equilibrium":
        raise InputError("has no derivatives: no equilibrium was found", key="state",
                         given=equilibrium.advice)
    state = equilibrium if isinstance(equilibrium, State) else equilibrium.state
    stiffness, nearby = Stiffness(model, state), nearby_tangent(model, equilibrium)
    motions = [solve_adjoint(stiffness, nearby, quantity.slope(model, state))
               for quantity in quantities.values()]
    residual = ResidualDerivative(stiffness, motions)
    result: dict[str, dict[str, float]] = {name: {} for name in quantities}
    for name, parameter in by.items():
        # A quantity is the same for mirror images, so a change and its opposite do the same.
        if parameter.odd & model.discretisation.planes:
            for slopes in result.values():
                slopes[name] = 0.0
            continue
        stepped = parameter.changed(model, state, 1j * STEP)
        shares = residual.by(*stepped)
        for (label, quantity), share in zip(quantities.items(), shares, strict=True):
            result[label][name] = float((quantity.value(*stepped).imag - share) / STEP)
    return result


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
    return float(max(np.abs(part).max(initial=0.0) for part in motion))


def limit_gradient(model: Model, critical: PathPoint, load: Load,
                   by: Mapping[str, ModelParameter]) -> dict[str, float]:
    """Derivatives of a limit load, such as the U² of pull-in [V²], by parameters.

    At a limit point the tangent has a null vector φ, the critical mode, so that dλ/dp = −φ·∂R/∂p /
    φ·∂R/∂λ: no solve. The point and its load are such as ``critical`` and ``limited`` of an
    :class:`~tympan.fem.equilibrium.ramp.Outcome`; InputError where the load has no limit, such as
    at a bifurcation.
    """
    state, mode = critical.state, critical.direction
    if abs(critical.rate) > _FOLD * abs(state.load(load)):
        raise InputError("has no derivatives: the load has no smooth limit there", key="limit",
                         given=load)
    residual = ResidualDerivative(Stiffness(model, state), [mode])
    loads: dict[str, Any] = {load: state.load(load) + 1j * STEP}
    share = residual.by(model, state.under(**loads))[0]
    result = {}
    for name, parameter in by.items():
        if parameter.odd & model.discretisation.planes:
            result[name] = 0.0
        elif name == load:
            raise InputError("is the load that has the limit", key="parameter", given=name)
        else:
            stepped = parameter.changed(model, state, 1j * STEP)
            result[name] = float(-residual.by(*stepped)[0] / share)
    return result
