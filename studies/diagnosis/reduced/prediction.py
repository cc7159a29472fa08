"""Readings of a rig's sensors, on films at rest, in vibration and after jumps of voltage."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.studies.diagnosis.evidence.registry import BY_ROWS, REST
from tympan.studies.diagnosis.hypothesis import SIZES, Hypothesis, parameters_of
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.film_shape import Lattice
from tympan.studies.diagnosis.reduced.films_at_rest import FilmsAtRest
from tympan.studies.diagnosis.reduced.force_law import ForceSurface
from tympan.studies.diagnosis.reduced.in_time import behind
from tympan.studies.diagnosis.reduced.reduced_films import ReducedFilms, bounds_of
from tympan.studies.diagnosis.reduced.scans import scanned
from tympan.studies.diagnosis.reduced.swinging import Sag

#: A number of a film by its deflections [m] and U² [V²].
OfFilms = Callable[[ForceSurface, Array, Array], Array]

#: Least mass that moves with a plate [kg].
_LIGHTEST = 1e-6

#: Step for derivatives: share of the usual size of unknowns, and of deflections.
_STEP = 1e-6


class Prediction:
    """Predicted readings of films at some unknowns, in the rows of a table."""

    def __init__(self, films: ReducedFilms, hypothesis: Hypothesis, unknowns: Array,
                 table: ReadingTable, like: Prediction | None = None) -> None:
        """Predict from unknowns; ``like`` has the same films under nearly the same voltages."""
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
        """States without equilibrium, which may have one if force laws reach further."""
        return self.rest.short

    @property
    def deflection(self) -> Array:
        """Deflection of each state [m], nan where it is not possible."""
        return self.rest.deflection

    @property
    def impossible_rows(self) -> Mask:
        """Rows that depend on a state that is not possible."""
        state, since = self.table.state, self.table.since
        return ~self.possible[state] | ((since >= 0) & ~self.possible[since])

    @property
    def complete(self) -> bool:
        """Whether all states that are read are possible."""
        return not self.impossible_rows.any()

    def beyond(self, before: Prediction) -> bool:
        """Say whether a search must not go here: never, for extended deflections lead back."""
        return False

    @cached_property
    def extended(self) -> Array:
        """Reading of each row at the extended deflections."""
        return self.shown(self.rest.extended_deflection)

    @cached_property
    def values(self) -> Array:
        """Reading of each row."""
        return self.shown(self.deflection)

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives of the extended rows by the unknowns, shape (rows, unknowns)."""
        columns, most = [], bounds_of(self.films, self.hypothesis)[1]
        deviations = [parameter.deviation for parameter in parameters_of(self.hypothesis)]
        steps = _STEP * np.array([1.0, 1.0, *deviations])
        switches = [parameter.switch for parameter in parameters_of(self.hypothesis)]
        steps[SIZES][switches] = 1.0  # a switch is on or off, nothing between
        for number, step in enumerate(steps.tolist()):
            step = -step if self.unknowns[number] + step > most[number] else step
            moved = self.unknowns.copy()
            moved[number] += step
            there = Prediction(self.films, self.hypothesis, moved, self.table,
                               None if self.rest.changes_films(number) else self)
            columns.append(self._change(there) / step)
        return np.stack(columns, axis=1)

    def _change(self, there: Prediction) -> Array:
        """Compute the change from the extended rows to those at nearby unknowns, to first order."""
        table, shift = self.table, self.rest.shift(there.rest)
        change = self._by_deflection * shift[table.state]
        # A reading counted from another state, or read late, depends on two states.
        both = table.since >= 0
        here, origin = REST.shares(self, both)
        change[both] = self.rig.sensor_slope * (
            here * shift[table.state[both]] + origin * shift[table.since[both]])
        return there.shown(self.rest.extended_deflection) - self.extended + change

    @cached_property
    def _by_deflection(self) -> Array:
        """Derivatives of rows of one state by its deflection; ranges and transients have two."""
        deflection, tiny = self.rest.extended_deflection, _STEP * np.mean(self.rest.high)
        return (self.shown(deflection + tiny) - self.shown(deflection - tiny)) / (2 * tiny)

    def shown(self, deflection: Array) -> Array:
        """Compute readings of the rows when the states have these deflections [m]."""
        shown = np.empty(len(self.table))
        for kind, rows in self.table.rows_of.items():
            shown[rows] = BY_ROWS[kind].shown(self, kind, rows, deflection)
        return shown

    def capacitance(self, deflection: Array) -> Array:
        whole = self.rest.permittivity * self._of_films(ForceSurface.capacitance, deflection)
        for number, specimen in enumerate(self.rest.setup.specimens):
            if not specimen.electrode.wired_as_named:
                states = self.table.states.specimen == number
                connected = [self.segment_capacitance(number, segment, deflection)
                             for segment in range(len(specimen.electrode.segments))]
                whole[states] = np.sum(connected, axis=0)[states]
        return whole

    def tilt(self, deflection: Array) -> Array:
        return np.sqrt(np.maximum(self._of_films(ForceSurface.tilt_squared, deflection), 0.0))

    def slope(self, axis: int, deflection: Array) -> Array:
        return self._of_films(lambda surface, *at: surface.slope(axis, *at), deflection)

    def segment_capacitance(self, specimen: int, segment: int, deflection: Array) -> Array:
        deflection, voltage_squared = self._within(deflection)
        values = np.zeros(len(deflection))
        electrode = self.rest.setup.specimens[specimen].electrode
        for states, surface in self.rest.surfaces:
            if int(self.table.states.specimen[states[0]]) == specimen:
                squared = self.rest.of_segments(states, voltage_squared[states])
                for number, lead in enumerate(electrode.leads):
                    if lead == electrode.names[segment]:
                        values[states] += surface.of_segment(number, deflection[states], squared)
        return self.rest.permittivity * values

    def force(self, deflection: Array) -> Array:
        return self.rest.balance(deflection, 0.0)[0] + self.rest.load

    def stiffness(self, deflection: Array) -> Array:
        return self.rest.stiffness_at(deflection)

    def scanned(self, number: int, state: int, deflection: Array) -> Array:
        deflection, voltage_squared = self._within(deflection)
        film = self._scanned_films[int(self.table.states.specimen[state])]
        squared = self.rest.of_segments(np.array([state]), voltage_squared[[state]])[0]
        return scanned(*film, self.table.scans[number], float(deflection[state]),
                       tuple(squared.tolist()) if squared.ndim else float(squared),
                       float(self._pressure[state]))

    def _of_films(self, quantity: OfFilms, deflection: Array) -> Array:
        deflection, voltage_squared = self._within(deflection)
        values = np.empty(len(deflection))
        for states, surface in self.rest.surfaces:
            squared = self.rest.of_segments(states, voltage_squared[states])
            values[states] = quantity(surface, deflection[states], squared)
        return values

    def _within(self, deflection: Array) -> tuple[Array, Array]:
        """Limit deflections [m] and U² [V²] of the states to the laws' reach."""
        rest = self.rest
        return (np.clip(deflection, rest.low, rest.high),
                np.minimum(rest.voltage_squared, rest.top))

    @property
    def moving(self) -> Array:
        """Mass that moves with the plate [kg], shape (states,)."""
        mass: Array = self.rig.moving_mass(self.table.states.mass)
        if self.films.masses is not None:
            mass = self.films.masses.moving(self.rest.setup, self.table.states.specimen, mass)
        return np.maximum(mass, _LIGHTEST)

    @cached_property
    def behind(self) -> Array:
        """Share of the last jump that each state has not reached."""
        states, rig = self.table.states, self.rig
        late = rig.plate_damping or rig.sensor_lag or rig.series_resistance
        if not late or not len(states.in_time):
            return np.zeros(len(states))
        stiffness = self.rest.stiffness_at(self.rest.extended_deflection)
        return behind(states, rig, self.moving, stiffness, self.rest.capacitance)

    def swing(self, stiffness: Array) -> Array:
        memory = self.films.memory
        if memory is None:
            return np.ones(len(stiffness), complex)
        return memory.swing(self.rest.setup, self.table.states, self.rest.stiffness,
                            np.sqrt(stiffness / self.moving))

    @cached_property
    def _pressure(self) -> Array:
        """Weight of the electrodes [Pa] over the flat films' tension, shape (states,)."""
        mass = np.array([specimen.electrode.mass for specimen in self.rest.setup.specimens])
        if not mass.any():
            return np.zeros(len(self.table.states))
        weight = self.rig.gravity * mass[self.table.states.specimen]
        return weight / self.rest.tension

    @cached_property
    def _scanned_films(self) -> dict[int, tuple[ForceSurface, Lattice, Sag | None]]:
        """Film, flat lattice and sag of every specimen, by number."""
        films, scanned = self.films, {}
        sags = films.masses.sags if films.masses and self._pressure.any() else ()
        for group, surface in self.rest.surfaces:
            number = int(self.table.states.specimen[group[0]])
            sizes = films.axis_sizes(number, self.hypothesis, self.unknowns)
            scanned[number] = (surface, films.flat_lattices[number].lattice(sizes),
                              sags[number] if sags else None)
        return scanned
