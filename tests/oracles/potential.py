"""What an equilibrium makes stationary: the energy of a film less the work of its loads."""

from __future__ import annotations

from typing import Any

from tympan.fem.membrane.loading import film_volume
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State


def potential(film: Model, state: State) -> Any:
    """Energy of a mesh and of its share of the loads [J]; stationary at equilibrium."""
    loads = film.weight[:, 2] @ state.positions[:, 2]
    loads = loads + state.pressure * film_volume(film.discretisation, state.positions)[0]
    plate = film.loading.on_plate(state, film.centre, film.plate_area)[0]
    energy = film.energy(state.positions, state.voltage_squared)
    return energy - loads + plate / film.discretisation.mirrored
