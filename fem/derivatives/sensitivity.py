"""Exact derivatives of scalar results by material, film, electrode, loads, surroundings and shape.

A quantity q of an equilibrium R(u, p) = 0, u the displacements of nodes and plate, changes with a
parameter p by dq/dp = ∂q/∂p − λ·∂R/∂p, the tangent being K and K λ = ∂q/∂u (adjoint method; Choi &
Kim, *Structural Sensitivity Analysis and Optimization*, 2005). One back-substitution into the
factors the solve left serves all parameters. Both partial derivatives are complex steps, exact to
rounding; but what lengths do to the forces is read off those of λ
(:mod:`tympan.fem.derivatives.residual_derivative`).

The factors belong to an iterate of Newton shortly before the equilibrium;
:mod:`tympan.fem.derivatives.adjoint` makes up for that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tympan.fem.complex_step import STEP
from tympan.fem.derivatives.adjoint import nearby_tangent, solve_adjoint
from tympan.fem.derivatives.parameters import LOADS, ModelParameter, parameters
from tympan.fem.derivatives.quantities import QUANTITIES, Quantity
from tympan.fem.derivatives.residual_derivative import ResidualDerivative
from tympan.fem.derivatives.stiffness import Stiffness
from tympan.fem.equilibrium.arc_length import PathPoint
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.ramp import Outcome
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load, State
from tympan.geometry.errors import InputError

#: Change of the load, relative to it, per arc length over the frame's half extent, below which a
#: point is a limit.
_FOLD = 1e-2


def gradient(model: Model, equilibrium: Outcome | Solution | State, quantity: Quantity,
             names: Sequence[str]) -> dict[str, float]:
    """Derivatives of a quantity at constant loads by each named parameter [SI unit per SI unit].

    An outcome or a solution brings its factors; a bare state is factorised anew. The names are
    those of :func:`~tympan.fem.derivatives.parameters.parameters`.

    Raises
    ------
    InputError
        For a name that is no parameter of the model; on a part of a film, for a parameter that
        breaks the mirror symmetry and a quantity that is not the same for mirror images; for
        quantities that have no derivative.
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
        if parameter.odd & model.discretisation.planes:
            for label, quantity in quantities.items():
                # A quantity that differs between mirror images may have a slope there.
                if not quantity.even:
                    raise InputError("breaks the mirror symmetry of the meshed part: mesh the "
                                     "whole film (symmetry off)",
                                     key=name, given=label or "a quantity")
                result[label][name] = 0.0
            continue
        stepped = parameter.changed(model, state, 1j * STEP)
        shares = residual.by(*stepped)
        for (label, quantity), share in zip(quantities.items(), shares, strict=True):
            result[label][name] = float((quantity.value(*stepped).imag - share) / STEP)
    return result


def deflection_gradient(model: Model, equilibrium: Outcome | Solution | State,
                   names: Sequence[str]) -> dict[str, float]:
    """Derivatives of the deflection at constant loads by named parameters [m per SI unit]."""
    return gradient(model, equilibrium, QUANTITIES["heave"], names)


def limit_gradient(model: Model, critical: PathPoint, load: Load,
                   by: Mapping[str, ModelParameter]) -> dict[str, float]:
    """Derivatives of a limit load, such as the U² of pull-in [V²], by parameters.

    At a limit point the tangent has a null vector φ, the critical mode, so that dλ/dp = −φ·∂R/∂p /
    φ·∂R/∂λ: no solve. The point and its load are such as ``critical`` and ``limited`` of an
    :class:`~tympan.fem.equilibrium.ramp.Outcome`.

    Raises
    ------
    InputError
        Where the load has no limit: at a bifurcation, or away from the limit point.
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
        elif name in LOADS and name == load:
            raise InputError("is the load that has the limit", key="parameter", given=name)
        else:
            stepped = parameter.changed(model, state, 1j * STEP)
            result[name] = float(-residual.by(*stepped)[0] / share)
    return result
