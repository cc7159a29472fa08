"""Rows of a sweep that a family of films solves, for what else is asked of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.fem.rig import Rig
from tympan.studies.films.family import FamilyStates, FilmFamily
from tympan.studies.films.many_films import Films

#: The largest error of a row, as a share of its number, that is not left to finite elements.
EXACT = 1e-4

#: How far a film's least tension is from none in a row that is not left to finite elements, over
#: its largest stress: between nodes it may be less than at these.
TENSE = 0.01


@dataclass(frozen=True, eq=False)
class FamilyRows:
    """Films of a family and their states under every mass and voltage, masses first.

    ``forces`` on the plates [N], (films, masses), with nothing else that acts on them, and
    ``voltages`` across the films [V], (films, voltages).
    """

    family: FilmFamily
    films: Films
    rig: Rig
    forces: Array
    voltages: Array
    states: FamilyStates

    @classmethod
    def of(cls, family: FilmFamily, rows: Array, rig: Rig, forces: Array, voltages: Array
           ) -> FamilyRows:
        """Rows of films with these parameters, (films, names)."""
        films = family.films(rows)
        states = family.states(films, np.repeat(forces, voltages.shape[1], axis=1),
                               np.tile(voltages, forces.shape[1]))
        return cls(family, films, rig, forces, voltages, states)

    @property
    def sure(self) -> Mask:
        """Mask of the states that the family vouches for, (films, masses and voltages)."""
        states = self.states
        # Of states that are none comparisons are false.
        return np.asarray(states.holds & (states.error <= EXACT * np.abs(states.deflection))
                          & (states.tension > TENSE * states.stress) & states.sound)
