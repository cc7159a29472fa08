"""Equations that replace a load that is not given: a deflection, a charge, an arc length."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State, turned


@dataclass(frozen=True, eq=False)
class Equation:
    """Linearised constraint at a state.

    ``miss``: residual. ``by_motion``: derivative with respect to the motion of film and plate.
    ``by_load``: derivatives with respect to the loads.
    """

    miss: float
    by_motion: Parts
    by_load: Mapping[Load, float] = field(default_factory=dict)


#: Function of model and state that gives the equation which replaces a free load.
Constraint = Callable[[Model, State], Equation]


def held_plate(deflection: float) -> Constraint:
    """Prescribe the deflection [m] of the plate, or of the centre of a film without plate."""
    def equation(model: Model, state: State) -> Equation:
        return Equation(model.deflection(state) - deflection, model.lift)
    return equation


def held_charge(charge: float, further: float = 0.0) -> Constraint:
    """Prescribe the charge Q [C] of disconnected electrodes: C(x) U = Q.

    The capacitance is C = −2 ∂energy/∂U², its derivative −2 ∂forces/∂U². A ``further`` capacitance
    [F] in parallel with the film holds part of the charge.
    """
    def equation(model: Model, state: State) -> Equation:
        voltage = max(float(np.sqrt(max(state.voltage_squared, 0.0))), 1e-6)
        capacitance = float(model.capacitance(state)) + further
        inner, plate = model.by_load(state, "voltage")
        share = -2 * voltage * model.discretisation.mirrored
        return Equation(capacitance * voltage - charge, (share * inner, share * plate),
                        {"voltage": capacitance / (2 * voltage)})
    return equation


def arc_length(origin: State, direction: Parts, distance: float) -> Constraint:
    """Prescribe ⟨direction, state − origin⟩, Keller's pseudo-arclength."""
    def equation(model: Model, state: State) -> Equation:
        along = product(model, direction, difference(model, state, origin))
        return Equation(along - distance, metric(model, direction))
    return equation


def difference(model: Model, state: State, origin: State) -> Parts:
    """Compute the motion of free components and plate from one state to another."""
    plate = np.concatenate([state.plate.translation - origin.plate.translation,
                            turned(state.plate, origin.plate)])
    film = (state.positions - origin.positions)[model.discretisation.free]
    return film, plate[list(model.plate_freedoms)]


def metric(model: Model, motion: Parts) -> Parts:
    """Convert a motion to the linear form that, applied to it, gives its squared length.

    Length is relative to the frame: the mean square over the film plus the plate's. Loads do not
    contribute, since they cannot change without motion.
    """
    return (motion[0] / (model.size**2 * max(1, motion[0].size)),
            motion[1] * (model.arm_of_freedom / model.size) ** 2)


def product(model: Model, first: Parts, second: Parts) -> float:
    """Compute the inner product of two motions of film and plate, relative to the frame."""
    inner, plate = metric(model, first)
    return float(inner @ second[0] + plate @ second[1])


def length(model: Model, motion: Parts) -> float:
    """Compute the length of a motion of film and plate, relative to the frame."""
    return float(np.sqrt(product(model, motion, motion)))
