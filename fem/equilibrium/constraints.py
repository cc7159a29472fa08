"""Equations in place of loads that are not given: a deflection, a charge, a length of path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.plate import HEAVE, turned
from tympan.fem.membrane.state import Load, State

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Equation:
    """What a constraint misses; its derivatives by free components, plate freedoms, free loads."""

    miss: float
    inner: Array
    plate: Array
    loads: Array


class Constraint(Protocol):
    """An equation in place of each load that is not given."""

    def equation(self, model: Model, state: State, free: tuple[Load, ...]) -> Equation:
        """The equation at a state, ``free`` being the loads that are not given."""


@dataclass(frozen=True)
class HeldPlate:
    """The plate is held at a deflection [m]."""

    deflection: float

    def equation(self, model: Model, state: State, free: tuple[Load, ...]) -> Equation:
        plate = np.zeros(len(model.plate_freedoms))
        plate[model.plate_freedoms.index(HEAVE)] = 1.0
        return Equation(state.plate.deflection - self.deflection,
                        np.zeros(model.discretisation.free_count), plate, np.zeros(len(free)))


@dataclass(frozen=True)
class HeldCharge:
    """The electrodes carry a charge Q [C], the voltage source being cut off: C(x) U = Q."""

    charge: float

    def equation(self, model: Model, state: State, free: tuple[Load, ...]) -> Equation:
        """C U − Q, with the capacitance C = −2 ∂energy/∂U² and its derivative −2 ∂forces/∂U²."""
        voltage = max(float(np.sqrt(max(state.voltage_squared, 0.0))), 1e-6)
        capacitance = float(model.capacitance(state))
        inner, plate = model.by_load(state, "voltage")
        loads = np.array([capacitance / (2 * voltage) if name == "voltage" else 0.0
                          for name in free])
        share = -2 * voltage * model.discretisation.mirrored
        return Equation(capacitance * voltage - self.charge, share * inner, share * plate, loads)


@dataclass(frozen=True, eq=False)
class ArcLength:
    """A length along a direction from a state (Keller's pseudo-arclength)."""

    origin: State
    direction: Parts
    length: float

    def equation(self, model: Model, state: State, free: tuple[Load, ...]) -> Equation:
        """⟨direction, state − origin⟩ − length."""
        inner, plate = metric(model, self.direction)
        miss = product(model, self.direction, difference(model, state, self.origin)) - self.length
        return Equation(miss, inner, plate, np.zeros(len(free)))


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
    scale = model.size ** np.where(np.array(model.plate_freedoms, dtype=int) < 3, 2.0, 0.0)
    return motion[0] / (model.size**2 * max(1, motion[0].size)), motion[1] / scale


def product(model: Model, first: Parts, second: Parts) -> float:
    """Inner product of two motions of film and plate relative to the frame."""
    inner, plate = metric(model, first)
    return float(inner @ second[0] + plate @ second[1])


def length(model: Model, motion: Parts) -> float:
    """Length of a motion of film and plate relative to the frame."""
    return float(np.sqrt(product(model, motion, motion)))
