"""Memory of a whole film's viscous branches, and the heat that they dissipate."""

from __future__ import annotations

from typing import Any

from tympan.fem.film.density import from_virgin
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State


def virgin_strain(model: Model, state: State) -> Any:
    """Compute C of the virgin film at a state's quadrature points, (C₁₁, C₂₂, C₁₂)."""
    return from_virgin(model.cauchy_green(state.positions), model.specimen.membrane.prestretch)


def relaxed_memory(model: Model, state: State) -> Memory:
    """Create the memory of branches that are fully relaxed at a state."""
    return Memory.relaxed(model.specimen.membrane, virgin_strain(model, state))


def first_memory(model: Model, state: State) -> Memory:
    """Create the memory of branches that are fully relaxed at a first state.

    If the film has a mounting time, its branches have relaxed in the flat film since then.
    """
    film = model.specimen.membrane
    if film.mounted is None:
        return relaxed_memory(model, state)
    return Memory.mounted(film, model.volumes.shape)


def branch_heat(model: Model, state: State, memory: Memory) -> float:
    """Compute the power that the whole film's branches dissipate at a state [W]."""
    power = memory.dissipation(virgin_strain(model, state)) * model.volumes
    return float(power.sum()) * model.discretisation.mirrored
