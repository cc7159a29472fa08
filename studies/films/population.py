"""Many films on a rig under their loads, each with its own numbers, load, supply and strength.

    films = Population.alike(family, rig, rows)
    loaded = films.under(mass, voltage)
    loaded.deflection, loaded.blocked_force, loaded.first_limit

Searches for designs, tolerances, sweeps and the live explorer use this module.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from tympan.base.arrays import AnyArray, Array, Mask
from tympan.base.errors import InputError
from tympan.base.fields import number
from tympan.base.toml_reader import one_of
from tympan.fem.membrane.state import FREEDOMS
from tympan.fem.results.limit_states import BREAKDOWN, TENSION
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.films.family import BLOCK, FilmFamily
from tympan.studies.films.first_limits import ENDS, kinds
from tympan.studies.films.many_films import Films
from tympan.studies.films.states import FilmEnds, FilmStates
from tympan.studies.variables import VARIABLES, Variable, variables_of

#: Relative distance of a limit from a voltage below which it counts as reached: limits are accurate
#: to some 1e-4.
_SAME = 1e-3

#: Most films whose meshes are kept: those of a band, a power of two and the nominal one, are.
_KEPT = 2 * BLOCK


@dataclass(frozen=True, eq=False)
class Population:
    """Films of a family on a rig; each varying quantity has one value per film, (films,)."""

    family: FilmFamily
    rig: Rig
    #: Parameters of the films, (films, names), in the order of the family's box.
    rows: Array
    #: Factors on the nominal mass.
    load: Array
    #: Factors on the voltage that the rig gives for a nominal one.
    amplifier: Array
    #: Factors on the film's electric strength.
    strength: Array
    #: Specimens of the films; None for one that cannot be built. They are rarely used.
    specimens: Sequence[Specimen | None] = ()

    @classmethod
    def alike(cls, family: FilmFamily, rig: Rig, rows: Array,
              specimens: Sequence[Specimen | None] = ()) -> Self:
        """Create films whose factors are all 1."""
        one = np.ones(len(rows))
        return cls(family, rig, rows, one, one, one, specimens)

    @classmethod
    def joined(cls, several: Sequence[Self]) -> Self:
        """Join populations of one family and rig, one after the other."""
        first = several[0]
        columns = {name: np.concatenate([getattr(each, name) for each in several])
                   for name in ("rows", "load", "amplifier", "strength")}
        specimens = [specimen for each in several for specimen in each.specimens]
        return cls(first.family, first.rig, **columns, specimens=specimens)

    def __len__(self) -> int:
        return len(self.rows)

    def part(self, some: Any) -> Self:
        """Select some of the films by a slice, numbers or a mask."""
        columns = {name: getattr(self, name)[some]
                   for name in ("rows", "load", "amplifier", "strength")}
        numbers = np.arange(len(self))[some].tolist()
        specimens = [self.specimens[number] for number in numbers] if self.specimens else ()
        return replace(self, **columns, specimens=specimens)

    def parts(self) -> Iterator[Self]:
        """Yield parts of all films that are computed together."""
        for start in range(0, len(self), BLOCK):
            yield self.part(slice(start, start + BLOCK))

    @cached_property
    def every(self) -> Films:
        """All films with their meshes."""
        return self.family.films(self.rows)

    @property
    def films(self) -> Films | Array:
        """Films with stored meshes if they are few, else the rows of the films."""
        return self.every if len(self) <= _KEPT else self.rows

    def forces(self, mass: Any) -> Array:
        """Compute the forces on the plates [N] of nominal masses [kg].

        ``mass``: one for all films, or one per film; the forces then have the shape (films,). With
        the shape (films, masses) the forces have this shape, too.
        """
        mass = np.asarray(mass, dtype=float)
        column = (-1, *[1] * (mass.ndim - 1))
        size = self.family.box.plate_areas(self.rows) if self.rig.plate_pressure else np.zeros(1)
        forces: Array = self.rig.force(mass * self.load.reshape(column), size.reshape(column))
        return forces

    def moving(self, mass: Any) -> Array:
        """Compute the masses that move with the plates [kg] from nominal ones, (films,)."""
        moving: Array = self.rig.moving_mass(mass * self.load)
        return moving

    def across(self, voltages: Any) -> Array:
        """Compute the voltages across the films [V] from nominal ones, (films, voltages).

        ``voltages``: one value, several for all films, or (films, voltages).
        """
        across: Array = self.amplifier[:, None] * self.rig.film_voltage(np.atleast_1d(voltages))
        return across

    def of_their_strength(self, states: FilmStates) -> FilmStates:
        """Copy states of films of the stated electric strength for these films' own strengths."""
        strength = self.strength[:, None]
        return replace(states, breakdown=states.breakdown / strength,
                       weakest_strength=states.weakest_strength * strength)

    def reached(self, states: FilmStates) -> Mask:
        """Compute the mask of states that films reach: firm, taut and below their strength."""
        broken = states.breakdown >= self.strength[:, None]
        reached: Mask = states.holds & ~states.slack & states.sound & ~broken
        return reached

    def numbers(self, mass: float, voltages: Any) -> dict[str, Array]:
        """Compute variables under a mass [kg] at nominal voltages [V], by their keys.

        Each has the shape (films, voltages). Values are nan for films that do not reach the
        voltage.
        """
        forces = self.forces(mass)
        states = self.family.states(self.films, forces[:, None], self.across(voltages), check=False)
        rest, loaded = self.rests(forces)[:, :1], self.loaded(forces)[:, None]
        there = self.reached(states) & np.isfinite(rest)
        plate = self.family.box.specimen.plate is not None
        values = variables_of(self.of_their_strength(states), plate=plate) | {
            "deflection_m": loaded * states.deflection,
            "stroke_m": loaded * (states.deflection - rest)}
        return {key: np.where(there, value, np.nan) for key, value in values.items()}

    def loaded(self, forces: Array) -> Mask:
        """Compute the mask of films with a load.

        Other films stay flat, and their deflection is rounding error.
        """
        pressure = self.family.box.pressures(self.rows, self.family.ground.pressure)
        loaded: Mask = (forces != 0) | bool(pressure.any())
        return loaded

    def rests(self, forces: Array) -> Array:
        """Solve for q without voltage under forces on the plates [N], (films, shapes)."""
        return self.family.rests(self.films, forces, np.zeros(len(self)))

    def held(self, q: Array, across: Array) -> Array:
        """Compute the forces [N] that hold plates at states q, at film voltages, (films,)."""
        return self.family.held_forces(self.films, q, across)

    def first_limits(self, mass: Any) -> tuple[Array, AnyArray]:
        """Find the nominal voltages [V] of the first limits, and their kinds, (films,).

        The mass is as for :meth:`ends`. A voltage is infinite, and its kind "", if the film reaches
        no limit up to the highest voltage of the films, or if the supply does not reach it.
        """
        forces = self.forces(_in_si(mass, "mass"))
        found = self.family.first_limits(self.films, np.broadcast_to(forces, len(self)),
                                         self.strength)
        nominal = np.asarray(self.rig.nominal_voltage(found.voltage / self.amplifier))
        return nominal, np.where(np.isinf(nominal), "", found.kind)

    def ends(self, mass: Any) -> FilmEnds:
        """Find the nominal voltages [V] at which films under a mass break down, go slack, pull in.

        The mass is a number [kg], (films,) of them, or a text with its unit. Each voltage has the
        shape (films,); it is infinite or nan as :class:`FilmEnds` says.
        """
        forces = np.broadcast_to(self.forces(_in_si(mass, "mass")), len(self))
        found = self.family.ends(self.rows, forces[:, None], self.strength)
        return FilmEnds(**{item.name: np.asarray(self.rig.nominal_voltage(
            getattr(found, item.name)[:, 0] / self.amplifier)) for item in fields(FilmEnds)})

    def under(self, mass: Any, voltage: Any, margin: float = 1.0, *, swings: bool = True
              ) -> LoadedFilms:
        """Load the films with nominal masses [kg] and voltages [V], or texts with their unit.

        Each is one value for all films, or one per film; a film without a finite voltage has no
        state. ``margin``: a third state is that at the voltage times a margin above 1. ``swings``:
        frequencies may be asked for.
        """
        every = len(self)
        mass, voltage = _in_si(mass, "mass"), np.asarray(_in_si(voltage, "voltage"), dtype=float)
        voltage = np.where(np.isfinite(voltage), voltage, np.nan)
        return LoadedFilms(self, np.broadcast_to(mass, every), np.broadcast_to(voltage, every),
                           margin, swings)


def _in_si(value: Any, dimension: str) -> Any:
    """Convert a text with its unit; numbers stay as they are."""
    return number(value, dimension, dimension) if isinstance(value, str) else value


@dataclass(frozen=True, eq=False)
class LoadedFilms:
    """Films of a population under their loads, as :class:`~tympan.studies.wanted.Loaded`."""

    films: Population
    #: Nominal mass on each plate [kg].
    mass: Array
    #: Nominal voltage of each film [V].
    voltage: Array
    #: Factor on the voltage up to which a film must not lose tension.
    margin: float = 1.0
    #: Whether frequencies are computed.
    swings: bool = True

    @cached_property
    def loads(self) -> Array:
        """Forces on the plates [N], (films,)."""
        return self.films.forces(self.mass)

    @cached_property
    def across(self) -> Array:
        """Voltages across the films [V], (films, states).

        The states are: without voltage, at the voltage, and, with a margin above 1, at margin times
        the voltage.
        """
        levels = [0.0, 1.0, self.margin] if self.margin > 1 else [0.0, 1.0]
        return self.films.across(np.outer(self.voltage, levels))

    @cached_property
    def _stated(self) -> FilmStates:
        """States at these voltages, films of the stated electric strength."""
        masses = None
        if self.swings:  # above its voltage no frequency is computed
            asked = np.arange(self.across.shape[1]) < 2
            masses = np.where(asked, self.films.moving(self.mass)[:, None], np.nan)
        return self.films.family.states(self.films.films, self.loads[:, None], self.across,
                                        check=False, masses=masses, loose=True)

    @cached_property
    def states(self) -> FilmStates:
        """States at these voltages."""
        return self.films.of_their_strength(self._stated)

    def shown(self, variable: Variable | str) -> Array:
        """Compute a variable of the states, or the one of a key, (films, states).

        Raises
        ------
        InputError
            For a key that no state shows.
        """
        one = VARIABLES.get(variable) if isinstance(variable, str) else variable
        if one is None or one.of is None:
            able = {key: each for key, each in VARIABLES.items() if each.of is not None}
            raise InputError(one_of(str(variable), able), key="shown", given=str(variable))
        return np.asarray(one.of(self.states))

    @property
    def reached(self) -> Mask:
        """Mask of films that reach their voltage, (films,)."""
        return self.films.reached(self._stated)[:, 1] & self._stated.holds[:, 0]

    @property
    def tilts(self) -> bool:
        """Whether guide and symmetry let plates tilt."""
        allowed = {FREEDOMS[number] for number in self.films.family.ground.model.plate_freedoms}
        return not allowed.isdisjoint(("rx", "ry"))

    @property
    def specimens(self) -> Sequence[Specimen | None]:
        return self.films.specimens

    @property
    def deflection(self) -> Array:
        return np.asarray(self._moved * self.states.deflection)

    @cached_property
    def _moved(self) -> Mask:
        """Mask of films that a load moves: others stay flat but for rounding, (films, 1)."""
        return self.films.loaded(self.loads)[:, None]

    @property
    def stroke(self) -> Array:
        return np.asarray(self.deflection[:, 1] - self.deflection[:, 0])

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
    def breakdown(self) -> Array:
        return self.states.breakdown

    @cached_property
    def blocked_force(self) -> Array:
        return self.loads - self.films.held(self.states.q[:, 0], self.across[:, 1])

    @property
    def frequency(self) -> Array:
        return np.asarray(self.states.frequency[:, :2].min(1))

    @cached_property
    def limit(self) -> Array:
        _, taut = self.films.family.limits(self.films.rows, self.loads[:, None])
        return taut[:, 0] / self.across[:, 1]

    @cached_property
    def first_limit(self) -> Array:
        return self.films.first_limits(self.mass)[0]

    @property
    def sound(self) -> Mask:
        """Mask of films that have all states and are firm and lawful up to their voltage."""
        return np.asarray(self.states.holds.all(1) & self.states.sound[:, :2].all(1))

    def part(self, some: Any) -> LoadedFilms:
        """Select some of the films by a slice, numbers or a mask."""
        return replace(self, films=self.films.part(some), mass=self.mass[some],
                       voltage=self.voltage[some])

    def parts(self) -> Iterator[LoadedFilms]:
        """Yield parts of all films that are computed together."""
        for start in range(0, len(self.films), BLOCK):
            yield self.part(slice(start, start + BLOCK))

    def failures(self, some: Mask) -> Array:
        """Find the kind of the first limit of each of ``some`` films up to its voltage.

        ``some`` is a mask. The kinds are :func:`~tympan.studies.films.first_limits.kinds`, shape
        (some,). A loss of tension or pull-in counts up to the margin, any other limit up to the
        voltage. The kind is "" if no limit is reached.
        """
        part = self.part(np.flatnonzero(some))
        films = part.films
        met = np.full(len(films), "", dtype=object)
        if not len(met):
            return met
        ways = [(part.across[:, 1], kinds())]
        if self.margin > 1:
            ways.append((part.across[:, 2], ENDS))
        for highest, wanted in ways:
            found = films.family.first_limits(films.films, part.loads, films.strength,
                                              wanted=wanted)
            beyond = np.isnan(found.voltage) | (found.voltage <= highest * (1 + _SAME))
            met = np.where((met == "") & beyond, found.kind, met)
        return part._by_states(met)

    def _by_states(self, met: Array) -> Array:
        """Find the kinds from the films' states where no limit is known."""
        some = np.flatnonzero(met == "")
        if not len(some):
            return met
        films = self.part(some)
        with np.errstate(invalid="ignore"):
            slack, broken = films.tension.min(1) <= 0, films.breakdown[:, 1] >= 1
        met = met.copy()
        met[some] = np.where(slack, TENSION.kind, np.where(broken, BREAKDOWN.kind, ""))
        return met


@dataclass(frozen=True, eq=False)
class FilmGrid:
    """Films of a population under every mass and every voltage, masses first.

    ``masses`` [kg] and nominal ``voltages`` [V] of each film have the shapes (films, masses) and
    (films, voltages). States have the shape (films, masses × voltages).
    """

    films: Population
    masses: Array
    voltages: Array

    @cached_property
    def forces(self) -> Array:
        """Forces on the plates [N], (films, masses)."""
        return self.films.forces(self.masses)

    @cached_property
    def across(self) -> Array:
        """Voltages across the films [V], (films, voltages)."""
        return self.films.across(self.voltages)

    @cached_property
    def states(self) -> FilmStates:
        """States with the errors of their deflections."""
        forces = np.repeat(self.forces, self.voltages.shape[1], axis=1)
        across = np.tile(self.across, self.masses.shape[1])
        return self.films.family.states(self.films.films, forces, across)
