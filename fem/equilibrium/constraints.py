"""Equations that close a problem whose loads are not all given: a heave, a charge, or a length along the path."""

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
    """What an equation misses and its derivatives by the free components, the plate's freedoms and the free loads."""

    miss: float
    inner: Array
    plate: Array
    loads: Array


class Control(Protocol):
    """An equation in place of each load that is not given."""

    def equation(self, model: Model, state: State, free: tuple[Load, ...]) -> Equation:
        """The equation at a state."""


@dataclass(frozen=True)
class Heave:
    """The plate is held at a heave [m]."""

    value: float

    def equation(self, model: Model, state: State, free: tuple[Load, ...]) -> Equation:
        """Heave − value."""
        plate = np.zeros(len(model.plate_freedoms))
        plate[model.plate_freedoms.index(HEAVE)] = 1.0
        return Equation(state.plate.heave - self.value, np.zeros(model.discretisation.free_count),
                        plate, np.zeros(len(free)))


@dataclass(frozen=True)
class Charge:
    """The electrodes carry a charge Q [C], the voltage source being cut off: C(x) U = Q."""

    value: float

    def equation(self, model: Model, state: State, free: tuple[Load, ...]) -> Equation:
        """C U − Q, with the capacitance C = −2 ∂energy/∂U² and its derivative −2 ∂forces/∂U²."""
        voltage = max(float(np.sqrt(max(state.voltage_squared, 0.0))), 1e-6)
        capacitance = float(model.capacitance(state))
        inner, plate = model.by_load(state, "voltage")
        loads = np.array([capacitance / (2 * voltage) if name == "voltage" else 0.0
                          for name in free])
        share = -2 * voltage * model.discretisation.mirrored
        return Equation(capacitance * voltage - self.value, share * inner, share * plate, loads)


@dataclass(frozen=True, eq=False)
class Arc:
    """A length along a direction from a state, both of :class:`Motion` (Keller's pseudo-arclength)."""

    origin: State
    direction: Parts
    length: float

    def equation(self, model: Model, state: State, free: tuple[Load, ...]) -> Equation:
        """⟨direction, state − origin⟩ − length."""
        moved = difference(model, state, self.origin)
        inner, plate = metric(model, self.direction)
        miss = float(inner @ moved[0] + plate @ moved[1]) - self.length
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


def length(model: Model, motion: Parts) -> float:
    """Length of a motion of film and plate relative to the frame."""
    inner, plate = metric(model, motion)
    return float(np.sqrt(inner @ motion[0] + plate @ motion[1]))
