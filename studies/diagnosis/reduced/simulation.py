"""Hypotheses, and what a rig's sensors would show under them, by the films' force laws.

Unknowns of a hypothesis are the logarithms of a factor on all films' stiffness and of one on their
permittivity, then the sizes of its effects' parameters in its order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tympan.fem.rig import Rig
from tympan.geometry.outlines import area
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.force_law import ForceLaw, ForceSurface
from tympan.studies.effects import EFFECTS, Effect, EffectParameter, Setup, Use

Array = NDArray[np.float64]

#: Newton iterations for heaves, and the change at which they end, relative to the law's largest
#: heave.
_ITERATIONS, _SMALL = 25, 1e-9

#: The logarithm of the largest factor on stiffness or permittivity.
_FACTOR = np.log(20.0)

#: How far beyond its largest heave and U² a force law is trusted, as shares.
_BEYOND = 0.15

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
    """A setup with the force laws of its films."""

    setup: Setup
    laws: tuple[ForceLaw, ...]

    def uses(self, hypothesis: Hypothesis, unknowns: Array) -> tuple[Use, ...]:
        """The effects with their values."""
        return tuple(
            (cause.name, tuple(parameter.value(size) for parameter, size in zip(
                cause.effect.parameters, unknowns[sizes_of(hypothesis, cause)].tolist(),
                strict=True)), cause.which)
            for cause in hypothesis)

    def predict(self, hypothesis: Hypothesis, unknowns: Array, table: ReadingTable) -> Array:
        """What each row of a table shows."""
        return Prediction(self, hypothesis, unknowns, table).values

    @cached_property
    def rig_effects(self) -> frozenset[str]:
        """Effects that edit the rig; none of those on one specimen does."""
        bare = Setup((), self.setup.rig)
        return frozenset(name for name, effect in EFFECTS.items() if not effect.on_one and bare
                         != effect.at(bare, [item.deviation for item in effect.parameters]))


class Prediction:
    """What a simulation shows at some unknowns; heaves are sought from ``start`` where it has any.

    Rows of states in which the force laws reach no equilibrium show nan.
    """

    def __init__(self, simulation: Simulation, hypothesis: Hypothesis, unknowns: Array,
                 table: ReadingTable, start: Array | None = None) -> None:
        self.simulation, self.hypothesis, self.unknowns = simulation, hypothesis, unknowns
        self.table, self.start, states = table, start, table.states
        self.stiffness = float(np.exp(unknowns[STIFFNESS]))
        self.permittivity = float(np.exp(unknowns[PERMITTIVITY]))
        self.rig = _rig(simulation, hypothesis, unknowns)
        surfaces = [_surface_of(simulation, number, hypothesis, unknowns, self.stiffness)
                    for number in range(len(simulation.laws))]
        # A probe shows what the supply gives, without the film's lag.
        self.supplied = np.asarray(self.rig.film_voltage(states.voltage))
        seen = np.asarray(self.rig.film_voltage(states.voltage, states.direction))
        self.voltage_squared = self.permittivity / self.stiffness * seen**2
        # Of each specimen, its states, its film, and their forces as polynomials of the heave.
        self.films = [(rows, surface, surface.by_heave(self.voltage_squared[rows]))
                      for rows, surface in zip(states.of_specimen, surfaces, strict=False)
                      if len(rows)]
        areas = np.array([area(specimen.plate.outline) if self.rig.plate_pressure else 0.0
                          for specimen in simulation.setup.specimens])
        self.load: Array = self.rig.force(states.mass, areas[states.specimen])
        self.reach = np.array([law.grid.heave for law in simulation.laws])[states.specimen]
        top = np.array([law.grid.voltage_squared for law in simulation.laws])[states.specimen]
        self.beyond = self.voltage_squared > (1 + _BEYOND) * top

    @cached_property
    def heave(self) -> Array:
        """Heave of each state [m], nan where the force laws reach no equilibrium."""
        free, reach, heave = np.isnan(self.table.states.heave), self.reach, self._first_guess()
        if self.start is not None:
            heave = np.where(np.isfinite(self.start), self.start, heave)
        heave = np.where(free, heave, self.table.states.heave)
        for _ in range(_ITERATIONS):
            force, stiffness = self.balance(heave)
            with np.errstate(all="ignore"):
                step = np.where(free, -force / stiffness, 0.0)
            heave = np.clip(heave + np.clip(step, -0.3 * reach, 0.3 * reach), -0.2 * reach,
                            (1 + _BEYOND) * reach)
            if np.all(np.abs(step) < _SMALL * reach):
                break
        force, stiffness = self.balance(heave)
        with np.errstate(all="ignore"):
            gone = free & ((stiffness <= 0) | ~(np.abs(force / stiffness) < 1e-6 * reach)
                           | (heave >= (1 + _BEYOND) * reach))
        return np.where(gone | self.beyond, np.nan, heave)

    @cached_property
    def values(self) -> Array:
        """What each row shows."""
        return self.shown(self.heave)

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives of the rows by the unknowns, shape (rows, unknowns).

        By the implicit function theorem: differences are taken of the balance of forces at fixed
        heaves only.
        """
        heave, table = self.heave, self.table
        force, stiffness = self.balance(heave)
        tiny = 1e-6 * np.mean(self.reach)
        # Right for rows of one state; a range is of two.
        by_heave = (self.shown(heave + tiny) - self.shown(heave - tiny)) / (2 * tiny)
        free, ranges = np.isnan(table.states.heave), table.since >= 0
        columns, most = [], bounds_of(self.simulation, self.hypothesis)[1]
        deviations = [parameter.deviation for parameter in parameters_of(self.hypothesis)]
        for number, step in enumerate(1e-6 * np.array([1.0, 1.0, *deviations])):
            step = -step if self.unknowns[number] + step > most[number] else step
            moved = self.unknowns.copy()
            moved[number] += step
            there = Prediction(self.simulation, self.hypothesis, moved, table)
            shift = np.where(free, -(there.balance(heave)[0] - force) / stiffness, 0.0)
            change = by_heave * shift[table.state]
            change[ranges] = (1 + self.rig.sensor_gain) * (
                shift[table.state[ranges]] - shift[table.since[ranges]])
            columns.append((there.shown(heave) - self.values + change) / step)
        return np.stack(columns, axis=1)

    def balance(self, heave: Array) -> tuple[Array, Array]:
        """Force that is missing [N], and the stiffness of film and rig [N/m]."""
        force, rate = np.empty((2, len(heave)))
        for rows, surface, by_heave in self.films:
            force[rows], rate[rows] = surface.force(heave[rows], by_heave)
        force = self.stiffness * force + self.rig.spring * heave
        rate = self.stiffness * rate + self.rig.spring
        if self.rig.biases:
            more = np.array([[bias.derivatives(at)[1:] for at in heave.tolist()]
                             for bias in self.rig.biases]).sum(0)
            force, rate = force + more[:, 0], rate + more[:, 1]
        return force - self.load, rate

    def _first_guess(self) -> Array:
        """Heaves by the stiffness of the flat film."""
        rest = np.full(len(self.reach), 0.02) * self.reach
        force, rate = self.balance(rest)
        with np.errstate(all="ignore"):
            guess = rest - np.where(rate > 0, force / rate, 0.0)
        return np.asarray(np.clip(np.where(np.isfinite(guess), guess, rest), 0.0, self.reach))

    def shown(self, heave: Array) -> Array:
        """What the rows show when the states have these heaves [m]."""
        table, rig, shown = self.table, self.rig, np.empty(len(self.table))
        for kind, rows in table.rows_of.items():
            at = table.state[rows]
            if kind == "displacement":
                shown[rows] = rig.reading(heave[at], table.states.elapsed[at])
            elif kind == "range":
                shown[rows] = rig.reading(heave[at]) - rig.reading(heave[table.since[rows]])
            elif kind == "capacitance":
                of_states = np.empty(len(heave))
                for group, surface, _ in self.films:
                    of_states[group] = surface.capacitance(heave[group],
                                                           self.voltage_squared[group])
                shown[rows] = self.permittivity * of_states[at]
            elif kind == "film_voltage":
                shown[rows] = self.supplied[at]
            else:
                shown[rows] = (self.balance(heave)[0] + self.load)[at]
        return shown


def _rig(simulation: Simulation, hypothesis: Hypothesis, unknowns: Array) -> Rig:
    setup = Setup((), simulation.setup.rig)
    for cause in sorted(hypothesis, key=lambda cause: list(EFFECTS).index(cause.name)):
        if cause.name in simulation.rig_effects:
            setup = cause.effect.at(setup, unknowns[sizes_of(hypothesis, cause)].tolist())
    return setup.rig


def _surface_of(simulation: Simulation, number: int, hypothesis: Hypothesis, unknowns: Array,
                stiffness: float) -> ForceSurface:
    """The film of a specimen with the effects that change it."""
    law, name = simulation.laws[number], simulation.setup.specimens[number].name
    coordinates = np.zeros(len(law.axes))
    for cause in hypothesis:
        sizes = unknowns[sizes_of(hypothesis, cause)].tolist()
        if cause.which in (None, name):
            for place, axis in enumerate(law.axes):
                if axis.effect == cause.name:
                    coordinates[place] = axis.coordinate(sizes[axis.index], stiffness)
    return law.at(coordinates)


def bounds_of(simulation: Simulation, hypothesis: Hypothesis) -> Array:
    """Smallest and largest unknowns, shape (2, p), by priors and the force laws' reach."""
    low, high = [-_FACTOR] * FACTORS.stop, [_FACTOR] * FACTORS.stop
    for cause in hypothesis:
        for index, parameter in enumerate(cause.effect.parameters):
            axes = [axis for law in simulation.laws for axis in law.axes
                    if (axis.effect, axis.index) == (cause.name, index)]
            least, most = parameter.limits
            least = max([least, *(-axis.span for axis in axes)])
            most = min([most, *(axis.span for axis in axes)])
            # On no specimen does the sign of such a parameter change anything.
            folded = parameter.sign == "even" and all(axis.folded for axis in axes)
            low.append(max(least, 0.0) if folded else least)
            high.append(most)
    return np.array([low, high])
