"""Equations in place of loads that are not given: a deflection, a charge, a length of path."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State, turned


@dataclass(frozen=True, eq=False)
class Equation:
    """Residual of a constraint; its derivatives by a motion of film and plate, and by loads."""

    miss: float
    by_motion: Parts
    by_load: Mapping[Load, float] = field(default_factory=dict)


#: An equation at a state, in place of a load that is not given.
Constraint = Callable[[Model, State], Equation]


def held_plate(deflection: float) -> Constraint:
    """The plate, or the centre of a film without one, is held at a deflection [m]."""
    def equation(model: Model, state: State) -> Equation:
        return Equation(model.deflection(state) - deflection, model.lift)
    return equation


def held_charge(charge: float, further: float = 0.0) -> Constraint:
    """The electrodes carry a charge Q [C], the voltage source being cut off: C(x) U = Q.

    The capacitance is C = −2 ∂energy/∂U², its derivative −2 ∂forces/∂U²; a ``further`` one beside
    the film's holds part of the charge [F].
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
    """⟨direction, state − origin⟩ is a distance along a path (Keller's pseudo-arclength)."""
    def equation(model: Model, state: State) -> Equation:
        along = product(model, direction, difference(model, state, origin))
        return Equation(along - distance, metric(model, direction))
    return equation


def difference(model: Model, state: State, origin: State) -> Parts:
    """Motion of the free components and of the plate from one state to another."""
    plate = np.concatenate([state.plate.translation - origin.plate.translation,
                            turned(state.plate, origin.plate)])
    film = (state.positions - origin.positions)[model.discretisation.free]
    return film, plate[list(model.plate_freedoms)]


def metric(model: Model, motion: Parts) -> Parts:
    """The motion as a linear form, so that with itself it gives its squared length.

    Length is relative to the frame: the mean square over the film plus the plate's; loads do not
    count, since without motion they cannot change.
    """
    return (motion[0] / (model.size**2 * max(1, motion[0].size)),
            motion[1] * (model.arm_of_freedom / model.size) ** 2)


def product(model: Model, first: Parts, second: Parts) -> float:
    """Inner product of two motions of film and plate relative to the frame."""
    inner, plate = metric(model, first)
    return float(inner @ second[0] + plate @ second[1])


def length(model: Model, motion: Parts) -> float:
    """Length of a motion of film and plate relative to the frame."""
    return float(np.sqrt(product(model, motion, motion)))
