"""Hypotheses, and what a rig's sensors would show under them, by the films' force laws.

Unknowns of a hypothesis are the logarithms of a factor on all films' stiffness and of one on their
permittivity, then the sizes of its effects' parameters in its order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.laws.stiffened import scaled
from tympan.geometry.outlines import area
from tympan.geometry.specimen import Film
from tympan.studies.diagnosis.reading_table import COMPONENTS, ReadingTable
from tympan.studies.diagnosis.reduced.axes import Axis
from tympan.studies.diagnosis.reduced.film_memory import FilmMemory
from tympan.studies.diagnosis.reduced.film_shape import Lattice
from tympan.studies.diagnosis.reduced.force_law import (
    BEYOND,
    ForceLaw,
    ForceSurface,
    continued,
    in_powers,
)
from tympan.studies.diagnosis.reduced.in_time import behind, charged, decay
from tympan.studies.diagnosis.reduced.resting_place import play, resting_place
from tympan.studies.diagnosis.reduced.seen_film import Sight, shown_by_scans
from tympan.studies.diagnosis.reduced.strips import StripPrediction, StripTests, strip_setup
from tympan.studies.diagnosis.reduced.swinging import Sag, SwingingMasses, mass_effects
from tympan.studies.effects import EFFECTS, Effect, EffectParameter, Setup, Use, extended

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Numbers = NDArray[np.int64]

#: The logarithm of the largest factor on stiffness or permittivity.
_FACTOR = np.log(20.0)

#: How far below no heave a force law is trusted, as a share of the largest.
_BELOW = 0.2

#: The stiffness that missing force is over, at least, as a share of the flat film's; the least of
#: that [N/m]; the heave that a film certainly has at its limit, as a share of a linear film's.
_SOFT, _LEAST, _LINEAR = 0.1, 1e-6, 1.0

#: How near derivatives by U² are taken, as a share of the largest.
_TINY = 1e-4

#: What every hypothesis has: the two factors; and the sizes of its effects.
STIFFNESS, PERMITTIVITY = 0, 1
FACTORS, SIZES = slice(0, 2), slice(2, None)


@dataclass(frozen=True)
class Cause:
    """An effect by name, and the specimen it happens to, if it is on one."""

    name: str
    which: str | None = None

    @property
    def effect(self) -> Effect:
        """The effect of the registry."""
        return EFFECTS[self.name]

    def __str__(self) -> str:
        return self.name if self.which is None else f"{self.name} of {self.which}"


#: Effects that are there together; none for the nominal model.
Hypothesis = tuple[Cause, ...]


def parameters_of(hypothesis: Hypothesis) -> list[EffectParameter]:
    """The parameters of its effects in the order of their sizes."""
    return [parameter for cause in hypothesis for parameter in cause.effect.parameters]


def unknown_count(hypothesis: Hypothesis) -> int:
    """How many unknowns it has."""
    return FACTORS.stop + len(parameters_of(hypothesis))


def sizes_of(hypothesis: Hypothesis, cause: Cause) -> slice:
    """Where among the unknowns the sizes of one of its causes stand."""
    first = unknown_count(hypothesis[: hypothesis.index(cause)])
    return slice(first, first + len(cause.effect.parameters))


def hypotheses_of(causes: Sequence[Cause]) -> tuple[Hypothesis, ...]:
    """Each cause alone, then every two together; not two specimens' share of the same effect."""
    singles: list[Hypothesis] = [(cause,) for cause in causes]
    pairs: list[Hypothesis] = [(first, second) for k, first in enumerate(causes)
                               for second in causes[k + 1 :] if first.name != second.name]
    return (*singles, *pairs)


@dataclass(frozen=True, eq=False)
class Simulation:
    """A setup with the force laws of its films.

    What of them swings where that is read, and what films remember of the runs that were read. Of
    ``strips`` instead of actuators there are no force laws.
    """

    setup: Setup
    laws: tuple[ForceLaw, ...]
    masses: SwingingMasses | None = None
    memory: FilmMemory | None = None
    strips: StripTests | None = None

    def uses(self, hypothesis: Hypothesis, unknowns: Array) -> tuple[Use, ...]:
        """The effects with their values."""
        return tuple(
            (cause.name, tuple(parameter.value(size) for parameter, size in zip(
                cause.effect.parameters, unknowns[sizes_of(hypothesis, cause)].tolist(),
                strict=True)), cause.which)
            for cause in hypothesis)

    @cached_property
    def sights(self) -> tuple[Sight, ...]:
        """Where each film's lattice lies."""
        return tuple(Sight(self.setup, specimen.name, law.axes) for specimen, law in zip(
            self.setup.specimens, self.laws, strict=True))

    def predict(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Array:
        """What each row of a table shows."""
        return self.prediction(hypothesis, unknowns, table).values

    def as_read(self, table: ReadingTable, part: ReadingTable) -> tuple[Simulation, ReadingTable]:
        """A part of a table's rows with values as they were read, and what predicts those."""
        strips = self.strips
        if strips is None or strips.whitening is None:
            return self, part
        read, spread = strips.as_read(table.value), strips.spread(table.sigma)
        return (replace(self, strips=replace(strips, whitening=None)),
                part.with_values(read[part.point]).with_sigma(spread[part.point]))

    def prediction(self, hypothesis: Hypothesis, unknowns: Array,
                   table: ReadingTable) -> Prediction | StripPrediction:
        """What a table's readings show, with derivatives."""
        if self.strips is None:
            return Prediction(self, hypothesis, unknowns, table)
        sizes = [1.0, 1.0, *(item.deviation for item in parameters_of(hypothesis))]
        return StripPrediction(self.strips, lambda moved: self.extended(hypothesis, moved),
                               unknowns, table.point, bounds_of(self, hypothesis), np.array(sizes))

    def extended(self, hypothesis: Hypothesis, unknowns: Array) -> Setup:
        """The setup with stiffness, permittivity and effects."""
        stiffness, permittivity = np.exp(unknowns[FACTORS]).tolist()
        uses = self.uses(hypothesis, unknowns)
        if self.strips is not None:
            return strip_setup(self.setup, stiffness, permittivity, uses)

        def change(film: Film) -> Film:
            return replace(film, material=scaled(film.material, stiffness),
                           relative_permittivity=film.relative_permittivity * permittivity)

        return extended(self.setup.with_films(change), uses)

    @cached_property
    def capacitance(self) -> Array:
        """Of the flat nominal films [F], shape (specimens,)."""
        none = np.zeros(1)
        return np.array([float(law.at(np.zeros(len(law.axes))).capacitance(none, none)[0])
                         for law in self.laws])

    @cached_property
    def flat_stiffness(self) -> Array:
        """Of the flat nominal films without voltage [N/m], shape (specimens,)."""
        none, stiffness = np.zeros(1), []
        for law in self.laws:
            surface = law.at(np.zeros(len(law.axes)))
            stiffness.append(float(surface.force(none, surface.by_heave(none))[1][0]))
        return np.array(stiffness)

    @cached_property
    def rig_effects(self) -> frozenset[str]:
        """Effects that edit the rig; none of those on one specimen does."""
        bare = Setup((), self.setup.rig)
        return frozenset(name for name, effect in EFFECTS.items() if not effect.on_one and bare
                         != effect.at(bare, [item.deviation for item in effect.parameters]))

    @cached_property
    def outer_effects(self) -> frozenset[str]:
        """Effects that change no film with its plate held: those of the rig, and of masses."""
        return self.rig_effects | mass_effects(self.setup)


class Prediction:
    """What a simulation shows at some unknowns.

    Force laws reach a little beyond their grids; from there they are continued by lines. A state in
    which the plate nowhere comes to rest is ``extended`` in proportion to the force that is missing
    at its limit point. So a fit can come back from where it asks for too much.
    """

    def __init__(self, simulation: Simulation, hypothesis: Hypothesis, unknowns: Array,
                 table: ReadingTable, like: Prediction | None = None) -> None:
        """``like``: the same films under nearly the same voltages."""
        self.simulation, self.hypothesis, self.unknowns = simulation, hypothesis, unknowns
        self.table, states = table, table.states
        self.stiffness = float(np.exp(unknowns[STIFFNESS]))
        self.permittivity = float(np.exp(unknowns[PERMITTIVITY]))
        self.setup = _outer(simulation, hypothesis, unknowns)
        self.rig = self.setup.rig
        # A probe shows what the supply gives, without the film's lag.
        self.supplied = np.asarray(self.rig.film_voltage(states.voltage))
        seen = np.asarray(self.rig.film_voltage(states.voltage, states.direction))
        areas = np.array([area(specimen.needed_plate().outline) if self.rig.plate_pressure else 0.0
                          for specimen in simulation.setup.specimens])
        self.load: Array = self.rig.force(states.mass, areas[states.specimen])
        if simulation.masses is not None:
            self.load = self.load + simulation.masses.weight(self.setup)[states.specimen]
        self.hardening: Array | float = 1.0
        if simulation.memory is not None:
            self.hardening = simulation.memory.hardening(self.setup, states, self.load,
                                                         self.stiffness, self.permittivity)
        self.voltage_squared = (self.permittivity / self.stiffness / self.hardening
                                * charged(states, self.rig, seen**2, self.capacitance))
        grids = [law.grid for law in simulation.laws]
        self.reach = np.array([grid.heave for grid in grids])[states.specimen]
        self.odd = np.array([grid.odd for grid in grids])[states.specimen]
        self.low, self.high = -_BELOW * self.reach, (1 + BEYOND) * self.reach
        self.free = np.isnan(states.heave)
        self.top = (1 + BEYOND) * np.array(
            [grid.voltage_squared for grid in grids])[states.specimen]
        if like is not None:
            self.films: list[tuple[Numbers, ForceSurface]] = like.films
            further = self.voltage_squared - like.voltage_squared
            self.powers: Array = like.powers + like.powers_by_voltage * further
        else:
            # Of each specimen, its states and its film.
            self.films = [(rows, _surface_of(simulation, number, hypothesis, unknowns,
                                             self.stiffness))
                          for number, rows in enumerate(states.of_specimen) if len(rows)]
            self.powers = self._powers(self.voltage_squared)

    def _powers(self, voltage_squared: Array) -> Array:
        """Coefficients of the films' forces by powers of the heave's coordinate, by U² [V²].

        Shape (powers, states).
        """
        powers = np.empty((len(self.low), self.simulation.laws[0].grid.heaves))
        for rows, surface in self.films:
            powers[rows] = continued(surface, voltage_squared[rows])
        return np.asarray((powers @ in_powers(powers.shape[1])).T)

    @cached_property
    def powers_by_voltage(self) -> Array:
        """Derivatives of these coefficients by U², shape (powers, states)."""
        tiny = _TINY * self.top
        return (self._powers(self.voltage_squared + tiny)
                - self._powers(self.voltage_squared - tiny)) / (2 * tiny)

    def _changes_films(self, number: int) -> bool:
        """Whether an unknown changes more of the films' force laws than the voltage."""
        if number == STIFFNESS:
            return any(parameter.dimension == "stress" for cause in self.hypothesis
                       if cause.name not in self.simulation.outer_effects
                       for parameter in cause.effect.parameters)
        return number >= SIZES.start and not any(
            cause.name in self.simulation.outer_effects
            for cause in self.hypothesis
            if sizes_of(self.hypothesis, cause).start <= number
            < sizes_of(self.hypothesis, cause).stop)

    @cached_property
    def _came(self) -> tuple[Numbers, Array, Array, Mask]:
        """As ``came``; where plates rest that move that way, or nearest to it; whether they do."""
        states, sizes = self.table.states, [item.deviation for item in
                                            parameters_of(self.hypothesis)]
        may = _outer(self.simulation, self.hypothesis, np.array([0.0, 0.0, *sizes])).rig
        if not self.rig.friction and not may.friction:
            return np.arange(len(states)), np.zeros(len(states)), *self._resting(0.0)
        (first, above), (last, below) = self._resting(1.0), self._resting(-1.0)
        place, way = play(first, np.where(below, last, np.inf), states.of_run,
                          np.where(states.direction < 0, -1.0, 1.0))
        return (place, np.where(self.free, way, 0.0), np.where(way > 0, first, last),
                np.where(way > 0, above, below))

    @property
    def came(self) -> tuple[Numbers, Array]:
        """Of each state the one at whose heave the plate stands, and the way it came there.

        1 down, -1 up, 0 and itself where nothing rubs.
        """
        return self._came[:2]

    def _resting(self, way: float) -> tuple[Array, Mask]:
        return resting_place(partial(self.balance, way=way), self.low, self.high)

    @cached_property
    def _rest(self) -> tuple[Array, Mask]:
        """Where plates come to rest within the laws' reach in heave, or come nearest to it.

        If they move: one that rubs may stay where it was.
        """
        _, _, at, rests = self._came
        return np.where(self.free, at, self.table.states.heave), rests | ~self.free

    @cached_property
    def possible(self) -> Mask:
        """States of stable equilibrium within the force laws' reach."""
        return self._rest[1][self._came[0]] & (self.voltage_squared <= self.top)

    @cached_property
    def short(self) -> Mask:
        """States that are none, but might be by force laws that reach further in heave or U²."""
        at, rests = self._rest
        ended = ~rests & ((at <= self.low) | (at >= self.high))
        return ended[self._came[0]] | (self.voltage_squared > self.top)

    @property
    def impossible_rows(self) -> Mask:
        """Rows that are of a state that is not possible."""
        state, since = self.table.state, self.table.since
        return ~self.possible[state] | ((since >= 0) & ~self.possible[since])

    @property
    def complete(self) -> bool:
        """Whether all states that are read are possible."""
        return not self.impossible_rows.any()

    @cached_property
    def heave(self) -> Array:
        """Heave of each state [m], nan where it is not possible."""
        return np.where(self.possible, self.extended_heave, np.nan)

    @cached_property
    def extended_heave(self) -> Array:
        """Heave of each state [m]; where the plate nowhere rests, its continuation."""
        return self._moved[self._came[0]]

    @cached_property
    def _moved(self) -> Array:
        """Heave of each state if the plate moves there [m], or its continuation."""
        at, rests = self._rest
        if rests.all():
            return at
        # Where the film pulls in at less and less heave, force is missing of a heave that stays.
        flat = self._flat_stiffness
        least = -_LINEAR * self.balance(np.zeros_like(at))[0] / flat
        at = np.where(rests, at, np.where(least > 0, np.maximum(at, np.minimum(least, self.high)),
                                          np.minimum(at, np.maximum(least, self.low))))
        force, rate = self.balance(at)
        return np.where(rests, at, at - force / np.maximum(rate, _SOFT * flat))

    @property
    def moving(self) -> Array:
        """What swings with the plate [kg], shape (states,)."""
        mass = self.table.states.mass + self.rig.unaccounted_mass + self.rig.added_mass
        if self.simulation.masses is not None:
            mass = self.simulation.masses.moving(self.setup, self.table.states.specimen, mass)
        return np.maximum(mass, _LEAST)

    @property
    def capacitance(self) -> Array:
        """About that of the film of each state [F]."""
        return np.asarray(self.permittivity * self.simulation.capacitance[
            self.table.states.specimen])

    @cached_property
    def behind(self) -> Array:
        """Share of the last jump by which each state is read late."""
        states, rig = self.table.states, self.rig
        late = rig.plate_damping or rig.sensor_lag or rig.series_resistance
        if not late or not len(states.passages.rows):
            return np.zeros(len(self.low))
        stiffness = np.maximum(self.balance(self.extended_heave, 0.0)[1], _LEAST)
        return behind(states, rig, self.moving, stiffness, self.capacitance)

    def _swing(self, stiffness: Array) -> Array:
        """Complex stiffness of each state's heave over that at rest [N/m], as its plate swings."""
        memory = self.simulation.memory
        if memory is None:
            return np.ones(len(stiffness), complex)
        return memory.swing(self.setup, self.table.states, self.stiffness,
                            np.sqrt(stiffness / self.moving))

    @property
    def _flat_stiffness(self) -> Array:
        """Stiffness of the flat film without voltage, shape (states,)."""
        stiffness = np.empty(len(self.low))
        for rows, surface in self.films:
            none = np.zeros(1)
            stiffness[rows] = surface.force(none, surface.by_heave(none))[1]
        return np.maximum(self.stiffness * stiffness, _LEAST)

    @cached_property
    def extended(self) -> Array:
        """What each row shows at the extended heaves."""
        return self.shown(self.extended_heave)

    @cached_property
    def values(self) -> Array:
        """What each row shows."""
        return self.shown(self.heave)

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives of the extended rows by the unknowns, shape (rows, unknowns).

        By the implicit function theorem where a plate rests: differences are taken of the balance
        of forces at fixed heaves only.
        """
        heave, table, (place, way, *_) = self.extended_heave, self.table, self._came
        force, stiffness = self.balance(self._moved)
        stiffness = np.maximum(stiffness, _LEAST)
        tiny = 1e-6 * np.mean(self.high)
        # Right for rows of one state; ranges and transients are of two.
        by_heave = (self.shown(heave + tiny) - self.shown(heave - tiny)) / (2 * tiny)
        rests, ranges = self._rest[1][place], table.since >= 0
        # What is read late is between two states.
        late = np.where(table.kind == "range", 0.0, self.behind[table.state])
        here, origin = 1 - late, np.where(table.kind == "range", -1.0, late)[ranges]
        columns, most = [], bounds_of(self.simulation, self.hypothesis)[1]
        deviations = [parameter.deviation for parameter in parameters_of(self.hypothesis)]
        for number, step in enumerate(1e-6 * np.array([1.0, 1.0, *deviations])):
            step = -step if self.unknowns[number] + step > most[number] else step
            moved = self.unknowns.copy()
            moved[number] += step
            there = Prediction(self.simulation, self.hypothesis, moved, table,
                               None if self._changes_films(number) else self)
            missing = there.balance(self._moved, way)[0] - force
            shift = np.where(self.free, -missing / stiffness, 0.0)[place]
            if not rests.all():
                shift = np.where(rests, shift, there.extended_heave - heave)
            change = by_heave * shift[table.state]
            change[ranges] = (1 + self.rig.sensor_gain) * (
                here[ranges] * shift[table.state[ranges]] + origin * shift[table.since[ranges]])
            columns.append((there.shown(heave) - self.extended + change) / step)
        return np.stack(columns, axis=1)

    def balance(self, heave: Array, way: Array | float | None = None) -> tuple[Array, Array]:
        """Force that is missing [N], and the stiffness of film and rig [N/m].

        At heaves [m] of the states, shape (..., states), to which a plate that rubs moves down (1)
        or up (-1); left out: as it came to its own.
        """
        at = np.clip(heave, self.low, self.high)
        share = at / self.reach
        x = np.where(self.odd, 2 * share**2, 2 * share) - 1
        force, rate = np.broadcast_to(self.powers[-1], x.shape), np.zeros_like(x)
        for power in self.powers[-2::-1]:
            rate = rate * x + force
            force = force * x + power
        rate = rate * np.where(self.odd, 4 * share, 2.0) / self.reach
        if self.odd.any():
            rate = np.where(self.odd, force + at * rate, rate)
            force = np.where(self.odd, at * force, force)
        stiffness = self.stiffness * self.hardening
        force = stiffness * (force + rate * (heave - at)) + self.rig.spring * heave
        rate = stiffness * rate + self.rig.spring
        for bias in self.rig.biases:
            more = np.array([bias.derivatives(place)[1:] for place in heave.ravel().tolist()])
            force, rate = (part + more[:, order].reshape(heave.shape)
                           for order, part in enumerate((force, rate)))
        load = self.rig.rubbed(self.load, self._came[1] if way is None else way)
        return force - load, rate

    def shown(self, heave: Array) -> Array:
        """What the rows show when the states have these heaves [m]."""
        table, rig, shown = self.table, self.rig, np.empty(len(self.table))
        within = np.clip(heave, self.low, self.high)
        squared = np.minimum(self.voltage_squared, self.top)
        for kind, rows in table.rows_of.items():
            at = table.state[rows]
            if kind == "displacement":
                shown[rows] = rig.reading(heave[at], table.states.elapsed[at])
                late = rows[table.since[rows] >= 0]
                jump = heave[table.state[late]] - heave[table.since[late]]
                shown[late] -= (1 + rig.sensor_gain) * self.behind[table.state[late]] * jump
            elif kind == "range":
                shown[rows] = rig.reading(heave[at]) - rig.reading(heave[table.since[rows]])
            elif kind in ("capacitance", "tilt"):
                of_states = np.empty(len(heave))
                for group, surface in self.films:
                    seen = surface.capacitance if kind == "capacitance" else surface.tilt_squared
                    of_states[group] = seen(within[group], squared[group])
                shown[rows] = (self.permittivity * of_states if kind == "capacitance"
                               else np.sqrt(np.maximum(of_states, 0.0)))[at]
            elif kind == "film_voltage":
                shown[rows] = self.supplied[at]
            elif kind == "frequency":
                stiffness = np.maximum(self.balance(heave, 0.0)[1], _LEAST)
                stiffness = stiffness * self._swing(stiffness).real
                shown[rows] = (np.sqrt(stiffness / self.moving) / (2 * np.pi))[at]
            elif kind in COMPONENTS:
                shown[rows] = shown_by_scans(table, kind, rows, self._sights, within, squared,
                                             self._pressure)
            elif kind == "decay":
                stiffness = np.maximum(self.balance(heave, 0.0)[1], _LEAST)
                loss = stiffness * self._swing(stiffness).imag
                shown[rows] = decay(rig, self.moving, loss, stiffness)[at]
            else:
                shown[rows] = (self.balance(heave, 0.0)[0] + self.load)[at]
        return shown

    @property
    def _pressure(self) -> Array:
        """The electrodes' weight [Pa] over the flat films' tension, shape (states,).

        The tension is that over the nominal films' without voltage.
        """
        mass = np.array([specimen.electrode.mass for specimen in self.setup.specimens])
        if not mass.any():
            return np.zeros(len(self.low))
        number = self.table.states.specimen
        tension = np.maximum(self._film_stiffness / self.simulation.flat_stiffness[number], _SOFT)
        return np.asarray(self.rig.gravity * mass[number] / tension)

    @property
    def _film_stiffness(self) -> Array:
        """Of the flat films under their voltages [N/m], shape (states,)."""
        flat = np.zeros(len(self.low))
        outer = self.rig.spring + sum(bias.derivatives(0.0)[2] for bias in self.rig.biases)
        return self.balance(flat, 0.0)[1] - outer

    @cached_property
    def _sights(self) -> dict[int, tuple[ForceSurface, Lattice, Sag | None]]:
        """Of every specimen, by number, its film, where that lies flat, and how it sags."""
        states, simulation, sights = self.table.states, self.simulation, {}
        sags = simulation.masses.sags if simulation.masses and self._pressure.any() else ()
        for group, surface in self.films:
            number = int(states.specimen[group[0]])
            sizes = sizes_on(simulation, number, self.hypothesis, self.unknowns, self.stiffness)
            sights[number] = (surface, simulation.sights[number].lattice(sizes),
                              sags[number] if sags else None)
        return sights


def _outer(simulation: Simulation, hypothesis: Hypothesis, unknowns: Array) -> Setup:
    """The setup with the effects that change no film with its plate held."""
    setup = simulation.setup
    for cause in sorted(hypothesis, key=lambda cause: list(EFFECTS).index(cause.name)):
        if cause.name in simulation.outer_effects:
            sizes = unknowns[sizes_of(hypothesis, cause)].tolist()
            setup = cause.effect.at(setup, sizes, cause.which)
    return setup


def _surface_of(simulation: Simulation, number: int, hypothesis: Hypothesis, unknowns: Array,
                stiffness: float) -> ForceSurface:
    """The film of a specimen with the effects that change it."""
    return simulation.laws[number].at(sizes_on(simulation, number, hypothesis, unknowns, stiffness))


def sizes_on(simulation: Simulation, number: int, hypothesis: Hypothesis, unknowns: Array,
             stiffness: float | None = None) -> Array:
    """What unknowns do to a specimen's film: sizes of its law's axes on the nominal film."""
    law, name = simulation.laws[number], simulation.setup.specimens[number].name
    stiffness = float(np.exp(unknowns[STIFFNESS])) if stiffness is None else stiffness
    sizes = np.zeros(len(law.axes))
    for cause in hypothesis:
        values = unknowns[sizes_of(hypothesis, cause)].tolist()
        if cause.which in (None, name):
            for place, axis in enumerate(law.axes):
                if axis.effect == cause.name:
                    sizes[place] = axis.nominal_size(values[axis.index], stiffness)
    return sizes


def affected(simulation: Simulation, cause: Cause, index: int) -> list[tuple[int, int]]:
    """The films that a parameter of a cause changes: numbers of law and axis; of strips none."""
    if simulation.strips is not None:
        return []
    return [(number, place) for number, (specimen, law)
            in enumerate(zip(simulation.setup.specimens, simulation.laws, strict=True))
            if cause.which in (None, specimen.name)
            for place, axis in enumerate(law.axes)
            if (axis.effect, axis.index) == (cause.name, index)]


def bounds_of(simulation: Simulation, hypothesis: Hypothesis) -> Array:
    """Smallest and largest unknowns, shape (2, p): sizes at which the films are sampled."""
    return _bounds(simulation, hypothesis, Axis.span)


def limits_of(simulation: Simulation, hypothesis: Hypothesis) -> Array:
    """Smallest and largest unknowns, shape (2, p), that could be sampled, as far as known."""
    return _bounds(simulation, hypothesis, Axis.reach)


def _bounds(simulation: Simulation, hypothesis: Hypothesis,
            largest: Callable[[Axis, int], float]) -> Array:
    low, high = [-_FACTOR] * FACTORS.stop, [_FACTOR] * FACTORS.stop
    for cause in hypothesis:
        for index, parameter in enumerate(cause.effect.parameters):
            axes = [simulation.laws[law].axes[number]
                    for law, number in affected(simulation, cause, index)]
            least, most = parameter.limits
            least = max([least, *(-largest(axis, -1) for axis in axes)])
            most = min([most, *(largest(axis, 1) for axis in axes)])
            # On no specimen does the sign of such a parameter change anything.
            folded = parameter.sign == "even" and all(axis.folded for axis in axes)
            low.append(max(least, 0.0) if folded else least)
            high.append(most)
    return np.array([low, high])
