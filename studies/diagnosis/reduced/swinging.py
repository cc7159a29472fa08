"""What swings with the plates beside them: films, electrodes and air, as masses on the plates.

The films follow as the flat ones do without voltage (:mod:`tympan.fem.vibration.heave`): where the
plate is some ten times as heavy as its film, deflection and voltage change frequencies by 1e-6
through it. The electrodes' weight acts on the plate by the same motion, to first order.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tympan.fem.vibration.heave import FollowingFilm, following
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.reduced.axes import HeldFilm
from tympan.studies.effects import EFFECTS, Effect, Setup

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SwingingMasses:
    """What of each specimen's film follows its plate."""

    films: tuple[FollowingFilm, ...]

    @classmethod
    def of(cls, setup: Setup, settings: Settings) -> SwingingMasses:
        """By one linear solution of each flat film."""
        models = [build_model(specimen, settings, setup.rig.loading)
                  for specimen in setup.specimens]
        return cls(tuple(following(model, model.mounted()) for model in models))

    def moving(self, setup: Setup, number: NDArray[np.int64], mass: Array) -> Array:
        """What swings with plates [kg] of given masses on specimens' numbers, each (n,)."""
        moving = np.empty(len(mass))
        for index, (film, specimen) in enumerate(zip(self.films, setup.specimens, strict=True)):
            moving[number == index] = film.mass(mass[number == index], _per_area(specimen),
                                              specimen.electrode.mass, setup.rig.air)
        return moving

    def weight(self, setup: Setup) -> Array:
        """What the plates carry of the electrodes' weight [N], shape (specimens,)."""
        return np.array([film.lifted * specimen.electrode.mass * setup.rig.gravity
                         for film, specimen in zip(self.films, setup.specimens, strict=True)])


def _per_area(specimen: Specimen) -> float:
    film = specimen.membrane
    return film.density * film.thickness / film.area_prestretch


def mass_effects(setup: Setup) -> frozenset[str]:
    """Effects that edit specimens, but no film with its plate held."""
    return frozenset(name for name, effect in EFFECTS.items()
                     if any(_only_masses(setup, effect, which) for which in effect.choices(setup)))


def _only_masses(setup: Setup, effect: Effect, which: str | None) -> bool:
    sizes = [parameter.deviation for parameter in effect.parameters]
    with suppress(InputError):
        edited = effect.at(setup, sizes, which)
        return edited.specimens != setup.specimens and all(
            HeldFilm.of(edited, specimen.name) == HeldFilm.of(setup, specimen.name)
            for specimen in setup.specimens)
    return False
