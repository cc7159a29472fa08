"""Masses that move with the plates: films, electrodes and air, as masses on the plates.

The films follow as flat ones without voltage (:mod:`tympan.fem.vibration.heave`): where the plate
is some ten times as heavy as its film, deflection and voltage change frequencies by only 1e-6
through it. To first order, the electrodes' weight acts on the plate by the same motion, and makes
the film sag between plate and frame.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import held
from tympan.fem.results.places import Places
from tympan.fem.vibration.heave import FollowingFilm, following
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.diagnosis.reduced.axes import HeldFilm
from tympan.studies.diagnosis.reduced.film_shape import ALONG, AROUND, lattice_of
from tympan.studies.effects import EFFECTS, Effect, Setup

#: Mass of electrodes [kg/m²] for which the sag is solved; others are proportional.
_WEIGHED = 0.05


#: The film without plate, which follows none.
_ALONE = FollowingFilm((0.0, 0.0), ((0.0, 0.0), (0.0, 0.0)), 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Sag:
    """Sag of a flat film under a pressure on the covered part, its plate held, without voltage.

    ``by_pressure`` [m/Pa] is given at its lattice's points, shape (ALONG, AROUND).
    """

    by_pressure: Array


@dataclass(frozen=True, eq=False)
class SwingingMasses:
    """Mass of each specimen's film that follows its plate, meshed by ``settings``."""

    films: tuple[FollowingFilm, ...]
    setup: Setup
    settings: Settings

    @classmethod
    def of(cls, setup: Setup, settings: Settings) -> SwingingMasses:
        """Solve the film that follows each plate, by one linear solution of the flat film."""
        def film(specimen: Specimen) -> FollowingFilm:
            if specimen.plate is None:
                return _ALONE
            model = build_model(specimen, settings, setup.rig.loading)
            return following(model, model.mounted())

        return cls(tuple(map(film, setup.specimens)), setup, settings)

    @cached_property
    def sags(self) -> tuple[Sag, ...]:
        """Sag of each film."""
        return tuple(map(self._sag, self.setup.specimens))

    def _sag(self, specimen: Specimen) -> Sag:
        loading, heights = self.setup.rig.loading, []
        flat = lattice_of(specimen.frame, specimen.needed_plate()).flat
        for mass in (0.0, _WEIGHED):
            heavy = replace(specimen, electrode=replace(specimen.electrode, mass=mass))
            model = build_model(heavy, self.settings, loading)
            state = held(model, 0.0, 0.0).state
            heights.append(Places.of(model.discretisation, flat).displacement(model, state)[:, 2])
        lower = heights[1] - heights[0]
        return Sag(lower.reshape(ALONG, AROUND) / (_WEIGHED * loading.gravity))

    def moving(self, setup: Setup, number: Numbers, mass: Array) -> Array:
        """Add the masses [kg] that move with plates of given masses, by specimen, (n,)."""
        moving = np.empty(len(mass))
        for index, (film, specimen) in enumerate(zip(self.films, setup.specimens, strict=True)):
            moving[number == index] = film.mass(mass[number == index], _per_area(specimen),
                                              _grease(specimen), setup.rig.air)
        return moving

    def weight(self, setup: Setup) -> Array:
        """Compute the share of the electrodes' weight on the plates [N], shape (specimens,).

        For a film without plate it is its own weight and theirs, as a pressure [Pa].
        """
        return np.array([setup.rig.gravity * (
            film.lifted * _grease(specimen) if specimen.plate is not None
            else _grease(specimen) + _per_area(specimen))
            for film, specimen in zip(self.films, setup.specimens, strict=True)])

    @cached_property
    def film_weight(self) -> Array:
        """Share of their films' weight that the plates carry [N], shape (specimens,)."""
        return np.array([(film.swept - film.plate) * _per_area(specimen) * self.setup.rig.gravity
                         for film, specimen in zip(self.films, self.setup.specimens, strict=True)])

    @property
    def lifted_area(self) -> Array:
        """Area of film and plate on which gas lifts the plates [m²], shape (specimens,)."""
        return np.array([film.swept for film in self.films])


def _per_area(specimen: Specimen) -> float:
    return specimen.membrane.density * specimen.membrane.volume_per_area


def _grease(specimen: Specimen) -> float:
    """Sum the mass of all layers' electrodes per mounted area [kg/m²]."""
    return specimen.membrane.layers * specimen.electrode.mass


def outer_effects_on_specimens(setup: Setup) -> frozenset[str]:
    """List effects that change specimens, but no film with its plate held: masses, leads."""
    return frozenset(name for name, effect in EFFECTS.items()
                     if any(_changes_no_film(setup, effect, which)
                            for which in effect.choices(setup)))


def _changes_no_film(setup: Setup, effect: Effect, which: str | None) -> bool:
    sizes = [parameter.deviation for parameter in effect.parameters]
    with suppress(InputError):
        edited = effect.at(setup, sizes, which)
        return edited.specimens != setup.specimens and all(
            HeldFilm.of(edited, specimen.name) == HeldFilm.of(setup, specimen.name)
            for specimen in setup.specimens)
    return False
