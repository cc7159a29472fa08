"""Memory of a whole film's viscous branches, and the heat that they make."""

from __future__ import annotations

from typing import Any

from tympan.fem.film.density import from_virgin
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State


def virgin_strain(model: Model, state: State) -> Any:
    """C of the virgin film at the quadrature points of a state, (C₁₁, C₂₂, C₁₂)."""
    return from_virgin(model.cauchy_green(state.positions), model.specimen.membrane.prestretch)


def relaxed_memory(model: Model, state: State) -> Memory:
    """Memory of branches that have rested at a state for ever."""
    return Memory.relaxed(model.specimen.membrane, virgin_strain(model, state))


def first_memory(model: Model, state: State) -> Memory:
    """Memory of branches at a first state, at which they have rested for ever.

    Those of a film that says when it was mounted have rested flat since then.
    """
    film = model.specimen.membrane
    if film.mounted is None:
        return relaxed_memory(model, state)
    return Memory.mounted(film, model.volumes.shape)


def branch_heat(model: Model, state: State, memory: Memory) -> float:
    """Power that the branches of the whole film turn into heat at a state [W]."""
    power = memory.dissipation(virgin_strain(model, state)) * model.volumes
    return float(power.sum()) * model.discretisation.mirrored
