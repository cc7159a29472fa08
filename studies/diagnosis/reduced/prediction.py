"""What a rig's sensors show of films at rest, swinging and after jumps of their voltages."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.hypothesis import Hypothesis, parameters_of
from tympan.studies.diagnosis.reading_table import COMPONENTS, ReadingTable
from tympan.studies.diagnosis.reduced.film_shape import Lattice
from tympan.studies.diagnosis.reduced.films_at_rest import FilmsAtRest
from tympan.studies.diagnosis.reduced.force_law import ForceSurface
from tympan.studies.diagnosis.reduced.in_time import behind, decay
from tympan.studies.diagnosis.reduced.reduced_films import ReducedFilms, bounds_of
from tympan.studies.diagnosis.reduced.scans import shown_by_scans
from tympan.studies.diagnosis.reduced.swinging import Sag

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int64]

#: Of a film by its heaves [m] and U² [V²].
Quantity = Callable[[ForceSurface, Array, Array], Array]

#: The least that swings with a plate [kg].
_LIGHTEST = 1e-6

#: How near derivatives are taken: by unknowns as a share of their usual size, by heaves of theirs.
_STEP = 1e-6


class Prediction:
    """What films show at some unknowns, in the rows of a table."""

    def __init__(self, films: ReducedFilms, hypothesis: Hypothesis, unknowns: Array,
                 table: ReadingTable, like: Prediction | None = None) -> None:
        """``like``: the same films under nearly the same voltages."""
        self.films, self.hypothesis, self.unknowns = films, hypothesis, unknowns
        self.table = table
        self.rest: FilmsAtRest = FilmsAtRest(films, hypothesis, unknowns, table.states,
                                             None if like is None else like.rest)
        self.rig = self.rest.rig

    @property
    def possible(self) -> Mask:
        """States of stable equilibrium within the force laws' reach."""
        return self.rest.possible

    @property
    def short(self) -> Mask:
        """States that are none, but might be by force laws that reach further in heave or U²."""
        return self.rest.short

    @property
    def heave(self) -> Array:
        """Heave of each state [m], nan where it is not possible."""
        return self.rest.heave

    @property
    def impossible_rows(self) -> Mask:
        """Rows that are of a state that is not possible."""
        state, since = self.table.state, self.table.since
        return ~self.possible[state] | ((since >= 0) & ~self.possible[since])

    @property
    def complete(self) -> bool:
        """Whether all states that are read are possible."""
        return not self.impossible_rows.any()

    def beyond(self, before: Prediction) -> bool:
        """Whether a search must not go here: never, for extended heaves lead back."""
        return False

    @cached_property
    def extended(self) -> Array:
        """What each row shows at the extended heaves."""
        return self.shown(self.rest.extended_heave)

    @cached_property
    def values(self) -> Array:
        """What each row shows."""
        return self.shown(self.heave)

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives of the extended rows by the unknowns, shape (rows, unknowns)."""
        columns, most = [], bounds_of(self.films, self.hypothesis)[1]
        deviations = [parameter.deviation for parameter in parameters_of(self.hypothesis)]
        for number, step in enumerate(_STEP * np.array([1.0, 1.0, *deviations])):
            step = -step if self.unknowns[number] + step > most[number] else step
            moved = self.unknowns.copy()
            moved[number] += step
            there = Prediction(self.films, self.hypothesis, moved, self.table,
                               None if self.rest.changes_films(number) else self)
            columns.append(self._change(there) / step)
        return np.stack(columns, axis=1)

    def _change(self, there: Prediction) -> Array:
        """From the extended rows to those of nearby unknowns, to first order."""
        table, shift = self.table, self.rest.shift(there.rest)
        change = self._by_heave * shift[table.state]
        # What is counted from another state, or read late, is between two.
        ranges = table.since >= 0
        late = np.where(table.kind == "range", 0.0, self.behind[table.state])
        here, origin = 1 - late, np.where(table.kind == "range", -1.0, late)[ranges]
        change[ranges] = (1 + self.rig.sensor_gain) * (
            here[ranges] * shift[table.state[ranges]] + origin * shift[table.since[ranges]])
        return there.shown(self.rest.extended_heave) - self.extended + change

    @cached_property
    def _by_heave(self) -> Array:
        """Derivatives of rows of one state by its heave; ranges and transients are of two."""
        heave, tiny = self.rest.extended_heave, _STEP * np.mean(self.rest.high)
        return (self.shown(heave + tiny) - self.shown(heave - tiny)) / (2 * tiny)

    def shown(self, heave: Array) -> Array:
        """What the rows show when the states have these heaves [m]."""
        shown = np.empty(len(self.table))
        for kind, rows in self.table.rows_of.items():
            if kind in ("displacement", "range"):
                shown[rows] = self._displacement(heave, rows, kind == "range")
            elif kind in COMPONENTS:
                shown[rows] = shown_by_scans(self.table, kind, rows, self._scanned_films,
                                             *self._within(heave), self._pressure)
            else:
                shown[rows] = self._of_states(kind, heave)[self.table.state[rows]]
        return shown

    def _displacement(self, heave: Array, rows: Numbers, ranges: bool) -> Array:
        table, rig = self.table, self.rig
        at, since = table.state[rows], table.since[rows]
        if ranges:
            return np.asarray(rig.reading(heave[at]) - rig.reading(heave[since]))
        shown = np.array(rig.reading(heave[at], table.states.elapsed[at]))
        late = since >= 0
        jump = heave[at[late]] - heave[since[late]]
        shown[late] -= (1 + rig.sensor_gain) * self.behind[at[late]] * jump
        return shown

    def _of_states(self, kind: str, heave: Array) -> Array:
        """What readings of a kind show of the states, whichever is read, shape (states,)."""
        if kind == "capacitance":
            return self.rest.permittivity * self._of_films(ForceSurface.capacitance, heave)
        if kind == "tilt":
            return np.sqrt(np.maximum(self._of_films(ForceSurface.tilt_squared, heave), 0.0))
        if kind == "film_voltage":
            # A probe shows what the supply gives, without the film's lag.
            return np.asarray(self.rig.film_voltage(self.table.states.voltage))
        if kind == "force":
            return self.rest.balance(heave, 0.0)[0] + self.rest.load
        stiffness = self.rest.stiffness_at(heave)
        swing = self._swing(stiffness)
        if kind == "decay":
            return decay(self.rig, self.moving, stiffness * swing.imag, stiffness)
        return np.asarray(np.sqrt(stiffness * swing.real / self.moving) / (2 * np.pi))

    def _of_films(self, quantity: Quantity, heave: Array) -> Array:
        heave, voltage_squared = self._within(heave)
        values = np.empty(len(heave))
        for states, surface in self.rest.surfaces:
            values[states] = quantity(surface, heave[states], voltage_squared[states])
        return values

    def _within(self, heave: Array) -> tuple[Array, Array]:
        """Heaves [m] and U² [V²] of the states, no further than the laws reach."""
        rest = self.rest
        return (np.clip(heave, rest.low, rest.high), np.minimum(rest.voltage_squared, rest.top))

    @property
    def moving(self) -> Array:
        """What swings with the plate [kg], shape (states,)."""
        mass = self.table.states.mass + self.rig.unaccounted_mass + self.rig.added_mass
        if self.films.masses is not None:
            mass = self.films.masses.moving(self.rest.setup, self.table.states.specimen, mass)
        return np.maximum(mass, _LIGHTEST)

    @cached_property
    def behind(self) -> Array:
        """Share of the last jump by which each state is read late."""
        states, rig = self.table.states, self.rig
        late = rig.plate_damping or rig.sensor_lag or rig.series_resistance
        if not late or not len(states.passages.rows):
            return np.zeros(len(states))
        stiffness = self.rest.stiffness_at(self.rest.extended_heave)
        return behind(states, rig, self.moving, stiffness, self.rest.capacitance)

    def _swing(self, stiffness: Array) -> Array:
        """Complex stiffness of each state's heave over that at rest, as its plate swings."""
        memory = self.films.memory
        if memory is None:
            return np.ones(len(stiffness), complex)
        return memory.swing(self.rest.setup, self.table.states, self.rest.stiffness,
                            np.sqrt(stiffness / self.moving))

    @property
    def _pressure(self) -> Array:
        """The electrodes' weight [Pa] over the flat films' tension, shape (states,)."""
        mass = np.array([specimen.electrode.mass for specimen in self.rest.setup.specimens])
        if not mass.any():
            return np.zeros(len(self.table.states))
        weight = self.rig.gravity * mass[self.table.states.specimen]
        return np.asarray(weight / self.rest.tension)

    @cached_property
    def _scanned_films(self) -> dict[int, tuple[ForceSurface, Lattice, Sag | None]]:
        """Of every specimen, by number, its film, where that lies flat, and how it sags."""
        films, scanned = self.films, {}
        sags = films.masses.sags if films.masses and self._pressure.any() else ()
        for group, surface in self.rest.surfaces:
            number = int(self.table.states.specimen[group[0]])
            sizes = films.axis_sizes(number, self.hypothesis, self.unknowns)
            scanned[number] = (surface, films.flat_lattices[number].lattice(sizes),
                              sags[number] if sags else None)
        return scanned
