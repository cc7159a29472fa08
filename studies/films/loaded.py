"""Films of a family under their loads, as what is wanted of films is asked of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.fem.results.limit_states import BREAKDOWN, TENSION
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.films.family import FamilyStates, FilmFamily
from tympan.studies.films.first_limits import ENDS, kinds

#: How near to a voltage a limit is met at it, relative: limits are found to some 1e-4.
_SAME = 1e-3


@dataclass(frozen=True, eq=False)
class FamilyFilms:
    """Films of a family under their loads, as :class:`~tympan.studies.wanted.Loaded`.

    ``rows`` of parameters (films, names); ``loads`` [N], ``masses`` that move [kg], None where no
    frequencies are asked for, and nominal ``voltage`` [V], (films,). ``margin``: times their
    voltage that films must bear without loss of tension; ``amplifier`` and ``strength``: factors on
    the voltage that the rig makes of the nominal one, and on the electric strength, (films,).
    """

    family: FilmFamily
    rows: Array
    loads: Array
    masses: Array | None
    voltage: Array
    rig: Rig = field(default_factory=Rig)
    margin: float = 1.0
    amplifier: Array | float = 1.0
    strength: Array | float = 1.0
    specimens: Sequence[Specimen | None] = ()

    @cached_property
    def across(self) -> Array:
        """Voltages without, with and, where more is to be borne, beyond that, (films, states)."""
        levels = [0.0, 1.0, self.margin] if self.margin > 1 else [0.0, 1.0]
        nominal = np.outer(self.voltage, levels)
        return np.asarray(self.rig.film_voltage(nominal) * np.reshape(self.amplifier, (-1, 1)))

    @cached_property
    def states(self) -> FamilyStates:
        """The states of each film."""
        masses = None
        if self.masses is not None:  # beyond its voltage no frequency is asked for
            masses = np.where(np.arange(self.across.shape[1]) < 2, self.masses[:, None], np.nan)
        return self.family.states(self.rows, self.loads[:, None], self.across, check=False,
                                  masses=masses, loose=True)

    @property
    def deflection(self) -> Array:
        return self.states.deflection

    @property
    def capacitance(self) -> Array:
        return self.states.capacitance

    @property
    def force(self) -> Array:
        return self.states.force

    @property
    def stress(self) -> Array:
        return self.states.stress

    @property
    def tension(self) -> Array:
        return self.states.tension

    @property
    def electric(self) -> Array:
        return self.states.electric

    @property
    def breakdown(self) -> Array:
        return np.asarray(self.states.breakdown / np.reshape(self.strength, (-1, 1)))

    @cached_property
    def blocked_force(self) -> Array:
        held = self.family.held_forces(self.rows, self.states.q[:, 0], self.across[:, 1])
        return np.asarray(self.loads - held)

    @property
    def frequency(self) -> Array:
        return np.asarray(self.states.frequency[:, :2].min(1))

    @cached_property
    def limit(self) -> Array:
        _, taut = self.family.limits(self.rows, self.loads[:, None])
        return np.asarray(taut[:, 0] / self.across[:, 1])

    @cached_property
    def first_limit(self) -> Array:
        strength = np.broadcast_to(self.strength, self.loads.shape)
        found = self.family.first_limits(self.rows, self.loads, strength).voltage
        return np.asarray(self.rig.nominal_voltage(found / self.amplifier))

    @property
    def sound(self) -> Mask:
        """Mask of films with their states, firm and within their law up to their voltage."""
        return np.asarray(self.states.holds.all(1) & self.states.sound[:, :2].all(1))

    def part(self, some: Any) -> FamilyFilms:
        """Some of the films."""
        count = len(self.rows)

        def of(value: Any) -> Any:
            return value[some] if np.ndim(value) else value

        specimens = self.specimens
        if specimens:
            specimens = [specimens[number] for number in np.arange(count)[some].tolist()]
        return FamilyFilms(self.family, self.rows[some], self.loads[some],
                           None if self.masses is None else self.masses[some], self.voltage[some],
                           self.rig, self.margin, of(self.amplifier), of(self.strength), specimens)

    def failures(self, some: Mask) -> Array:
        """Kind of the first limit of each of ``some`` films, a mask, on the way to its voltage.

        They are :func:`~tympan.studies.films.first_limits.kinds`, (some,): a loss of tension or
        pull-in also up to the margin, all others up to the voltage; "" where nothing is met there.
        """
        films = self.part(np.flatnonzero(some))
        met = np.full(len(films.rows), "", dtype=object)
        if not len(met):
            return met
        strength = np.broadcast_to(films.strength, films.loads.shape)
        ways = [(films.across[:, 1], kinds())]
        if self.margin > 1:
            ways.append((films.across[:, 2], ENDS))
        for highest, wanted in ways:
            found = self.family.first_limits(films.rows, films.loads, strength, wanted=wanted)
            beyond = np.isnan(found.voltage) | (found.voltage <= highest * (1 + _SAME))
            met = np.where((met == "") & beyond, found.kind, met)
        return films._by_states(met)

    def _by_states(self, met: Array) -> Array:
        """First limits of films, by their states where no limit is known."""
        some = np.flatnonzero(met == "")
        if not len(some):
            return met
        films = self.part(some)
        with np.errstate(invalid="ignore"):
            slack, broken = films.tension.min(1) <= 0, films.breakdown[:, 1] >= 1
        met = met.copy()
        met[some] = np.where(slack, TENSION.kind, np.where(broken, BREAKDOWN.kind, ""))
        return met
