"""Experiments that could be made, and the readings that each rival predicts for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import permutations

import numpy as np
from scipy.optimize import lsq_linear

from tympan.base.arrays import Array, Mask
from tympan.studies.data.effort import Effort
from tympan.studies.diagnosis.fits.fit import Fit
from tympan.studies.diagnosis.history import staircase
from tympan.studies.diagnosis.hypothesis import FACTORS
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced.film_memory import FilmMemory
from tympan.studies.diagnosis.reduced.films_at_rest import FilmsAtRest
from tympan.studies.diagnosis.reduced.prediction import Prediction
from tympan.studies.diagnosis.reduced.sampling import coarse
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import Setup
from tympan.studies.estimation.noise import Noise
from tympan.studies.files import words_beside

#: Instructions for experiments in words.
WORDS = words_beside(__file__)

_HOUR = 3600.0
_FORCE = 1e-3

#: Margin of new readings below the voltage at which any rival pulls in, as a share.
_MARGIN = 0.05


@dataclass(frozen=True, eq=False)
class Readout:
    """Readings that were made, and the nominal model's fit to them."""

    simulation: Simulation
    table: ReadingTable
    nominal: Fit

    @cached_property
    def states(self) -> States:
        """The states whose displacement was read, each once."""
        states = self.table.compact().states
        states = states[np.isnan(states.deflection)]
        keys = np.stack([states.specimen, states.mass, states.voltage, states.elapsed,
                         states.direction], 1)
        return states[np.sort(np.unique(np.nan_to_num(keys), axis=0, return_index=True)[1])]

    @cached_property
    def ramps(self) -> Array:
        """Specimen and mass of each ramp, shape (ramps, 2)."""
        return np.unique(np.stack([self.states.specimen.astype(float), self.states.mass], 1),
                         axis=0)

    @property
    def plates(self) -> bool:
        """Whether all films have a plate, which can carry masses, be held or tapped."""
        return all(specimen.plate is not None for specimen in self.simulation.setup.specimens)

    @cached_property
    def noise(self) -> float:
        """Typical noise of the displacements that were read [m], nan without any."""
        sigma = self.table.sigma[self.table.lengths]
        return float(np.median(sigma)) if len(sigma) else np.nan

    def displacements(self, states: States) -> ReadingTable:
        """Build displacements to be read, with the typical noise of those that were."""
        return rows(states, "displacement", self.noise)

    def new_run(self, specimen: Array, mass: Array, voltage: Array) -> ReadingTable:
        """Build displacements of a new run in this order, at the pace of the readings so far."""
        states = self.states
        pace = float(np.ptp(np.nan_to_num(states.elapsed))) / max(len(states) - 1, 1)
        direction = np.full(len(specimen), float(np.any(states.voltage_direction != 0)))
        return self.displacements(States.of(specimen.astype(np.int64), mass, voltage,
                                            pace * np.arange(float(len(specimen))), direction))

    def shown(self, table: ReadingTable) -> Array:
        """Predict readings with the nominal model."""
        return self.simulation.predict((), self.nominal.unknowns, table)

    def within_reach(self, table: ReadingTable) -> Mask:
        """Mark rows in states that the force laws cover, by the nominal model."""
        stiffness, permittivity = np.exp(self.nominal.unknowns[FACTORS])
        deflection, voltage_squared = np.array([
            [law.grid.deflection, law.grid.voltage_squared]
            for law in self.simulation.laws])[table.states.specimen].T
        reached = FilmsAtRest(self.simulation, (), self.nominal.unknowns, table.states).deflection
        seen = permittivity / stiffness * table.states.voltage**2
        inside = (reached <= deflection) & (seen <= voltage_squared)
        return np.asarray(inside[table.state])


@dataclass(frozen=True, eq=False)
class Outlook:
    """Readings to be made as each rival predicts them, and their ``noise``.

    ``values`` (readings,) and ``jacobians`` (readings, unknowns) of each rival; ``what`` to do, and
    the ``work`` it takes [s].
    """

    values: Sequence[Array]
    jacobians: Sequence[Array]
    noise: Noise
    what: str
    work: float

    def losses(self, fits: Sequence[Fit]) -> Array:
        """Compute expected Δχ², (true rival, other rival), with the other refitted to all."""
        losses = np.zeros((len(fits), len(fits)))
        for true, other in permutations(range(len(fits)), 2):
            losses[true, other] = _loss(
                fits[other], self.noise.whitened(self.values[true] - self.values[other]),
                self.noise.whitened(self.jacobians[other]))
        return losses


@dataclass(frozen=True)
class Experiment:
    """Readings that could be made.

    ``what``: a description, which may contain the largest {mass} and {voltage} of the rows, the
    {time} of the first one, their {specimen} and how long they are held ({dwell}); ``rows``: builds
    them, with their noise and without values, or returns None where the experiment makes no sense.
    ``sets_up``: work besides readings, a field of :class:`~tympan.studies.data.effort.Effort`;
    ``equips``: adds to the readout what it lacks.
    """

    what: str
    rows: Callable[[Readout], ReadingTable | None]
    sets_up: str = ""
    equips: Callable[[Readout, ReadingTable], Readout] | None = None

    def words(self, table: ReadingTable, setup: Setup) -> str:
        """Describe what to do, for those of the rows that remain."""
        return self.what.format(mass=f"{1e3 * table.mass.max():.4g} g",
                                voltage=f"{table.voltage.max() / 1e3:.3g} kV",
                                specimen=setup.specimens[int(table.specimen[0])].name,
                                dwell=f"{_longest(table.states):.3g} s",
                                time=f"{np.nan_to_num(table.states.elapsed).min() / _HOUR:.2g} h")

    def outlook(self, readout: Readout, fits: Sequence[Fit], effort: Effort) -> Outlook | None:
        """Predict the readings of the rows that are possible, by each rival."""
        possible = self.possible(readout, fits)
        if possible is None:
            return None
        readout, table = possible
        predictions = [Prediction(readout.simulation, fit.hypothesis, fit.unknowns, table)
                       for fit in fits]
        return Outlook([prediction.values for prediction in predictions],
                       [prediction.jacobian for prediction in predictions], table.noise,
                       self.words(table, readout.simulation.setup),
                       self.work(readout, table, effort))

    def possible(self, readout: Readout, fits: Sequence[Fit]
                 ) -> tuple[Readout, ReadingTable] | None:
        """Select rows that the laws reach, with an equilibrium by every rival; None without any."""
        table = self.rows(readout)
        if table is None:
            return None
        if self.equips is not None:
            readout = self.equips(readout, table)
        usable = readout.within_reach(table) & np.isfinite(table.sigma)
        voltage = (1 + _MARGIN) * table.states.voltage
        beyond = replace(table, states=replace(table.states, voltage=voltage))
        for fit in fits:
            usable &= np.isfinite(readout.simulation.predict(fit.hypothesis, fit.unknowns, beyond))
        return (readout, table[usable]) if usable.any() else None

    def work(self, readout: Readout, table: ReadingTable, effort: Effort) -> float:
        """Estimate the work for those of the rows that remain [s]."""
        states = table.compact().states
        runs = np.unique(np.stack([states.specimen, states.mass, states.run], 1), axis=0)
        pause = float(np.nan_to_num(states.elapsed).min()
                      - np.nan_to_num(readout.states.elapsed).max())
        return (len(table) * effort.reading + len(runs) * effort.load
                + len(np.unique(states.specimen)) * effort.specimen
                + (getattr(effort, self.sets_up) if self.sets_up else 0.0)
                + (max(pause, 0.0) + _held(states)) * effort.waiting)


def _longest(states: States) -> float:
    """Find the longest time that states are held before a reading [s]; 0 where not known."""
    ends = states.passages.after[1]
    return float(ends[np.isfinite(ends)].max(initial=0.0))


def _held(states: States) -> float:
    """Sum the durations of the runs in which states are held [s]."""
    runs = {(float(mass), history): float(history.signal.end)
            for history, places in states.passages.histories
            for mass in states.mass[states.in_time[places]]}
    return sum(runs.values())


def _repeated(readout: Readout) -> ReadingTable:
    return readout.displacements(readout.states)


def _between(readout: Readout) -> ReadingTable | None:
    halves = []
    for specimen, mass in readout.ramps:
        ramp = (readout.states.specimen == specimen) & (readout.states.mass == mass)
        voltage = np.unique(readout.states.voltage[ramp])
        halves += [(specimen, mass, half) for half in (voltage[1:] + voltage[:-1]) / 2]
    return readout.new_run(*np.array(halves).T) if halves else None


def _other_mass(readout: Readout, factor: float) -> ReadingTable | None:
    """Build readings of all specimens under ``factor`` times the largest mass, same voltages."""
    if not readout.plates:
        return None
    specimen, voltage = np.unique(np.stack([readout.states.specimen.astype(float),
                                            readout.states.voltage], 1), axis=0).T
    mass = np.full(len(specimen), factor * readout.states.mass.max())
    return readout.new_run(specimen, mass, voltage)


def _higher_voltages(readout: Readout, factor: float, count: int = 5) -> ReadingTable | None:
    """Continue every ramp to ``factor`` times the largest voltage in ``count`` steps."""
    top = float(readout.states.voltage.max())
    if top <= 0:
        return None
    voltage = top * (1 + (factor - 1) * np.arange(1, count + 1) / count)
    specimen, mass = np.repeat(readout.ramps, count, axis=0).T
    return readout.new_run(specimen, mass, np.tile(voltage, len(readout.ramps)))


def _backwards(readout: Readout) -> ReadingTable | None:
    """Reverse the run right after it, where times or ways of the readings are known."""
    states = readout.states
    if not (np.ptp(states.elapsed) > 0 or np.any(states.voltage_direction != 0)):
        return None
    return readout.displacements(replace(
        states, elapsed=2 * states.elapsed.max() - states.elapsed, direction=-states.direction))


def _later(readout: Readout, runs: float = 4.0) -> ReadingTable | None:
    """Repeat all readings after a pause of ``runs`` runs, at least 1 h, where times are known."""
    states = readout.states
    length = float(np.ptp(states.elapsed))
    if not length > 0:
        return None
    pause = max(runs * length, _HOUR)
    return readout.displacements(replace(states, elapsed=states.elapsed + length + pause))


def _capacitance(readout: Readout, share: float = 0.01) -> ReadingTable:
    table = rows(readout.states, "capacitance", 1.0)
    return table.with_sigma(share * np.abs(readout.shown(table)))


def _film_voltage(readout: Readout, share: float = 0.01) -> ReadingTable | None:
    states = readout.states[readout.states.voltage > 0]
    return rows(states, "film_voltage", share * states.voltage) if len(states) else None


def _blocked_force(readout: Readout, share: float = 0.01) -> ReadingTable | None:
    if not readout.plates:
        return None
    states = readout.states
    unloaded = readout.displacements(replace(states, voltage=np.zeros(len(states))))
    rest = FilmsAtRest(readout.simulation, (), readout.nominal.unknowns, unloaded.states)
    table = rows(replace(states, deflection=rest.deflection), "force", 1.0)
    return table.with_sigma(np.maximum(share * np.abs(readout.shown(table)), _FORCE))


def _taps(readout: Readout, share: float = 0.01) -> ReadingTable | None:
    if readout.simulation.masses is None or not readout.plates:
        return None
    table = rows(readout.states, "frequency", 1.0)
    return table.with_sigma(share * np.abs(readout.shown(table)))


def _longer_dwell(readout: Readout, factor: float = 10.0) -> ReadingTable | None:
    """Build the ramp of the heaviest mass, each state held ``factor`` times as long as any was."""
    dwell = _longest(readout.states)
    if not dwell > 0 or readout.simulation.setup.formula is not None:  # a formula has no memory
        return None
    specimen, mass = readout.ramps[np.argmax(readout.ramps[:, 1])]
    ramp = (readout.states.specimen == specimen) & (readout.states.mass == mass)
    voltage = np.unique(readout.states.voltage[ramp])
    table = readout.new_run(*np.array([(specimen, mass, level) for level in voltage]).T)
    passages = staircase(voltage, np.full(len(voltage), factor * dwell))
    return replace(table, states=replace(table.states, passage=passages))


def _remembering(readout: Readout, table: ReadingTable) -> Readout:
    """Add the film memory over the rows' runs to a readout."""
    films = readout.simulation
    memory = FilmMemory.of(films.setup, table, coarse(films.setup.formula),
                           *np.exp(readout.nominal.unknowns[FACTORS]).tolist())
    return replace(readout, simulation=replace(films, memory=memory))


#: Experiments that the force laws can predict.
MENU = (
    Experiment(WORDS["repeated"], _repeated),
    Experiment(WORDS["between"], _between),
    Experiment(WORDS["backwards"], _backwards),
    Experiment(WORDS["later"], _later),
    *(Experiment(WORDS["hang"], partial(_other_mass, factor=factor)) for factor in (0.5, 1.5, 2.0)),
    *(Experiment(WORDS["raise"], partial(_higher_voltages, factor=factor))
      for factor in (1.15, 1.4)),
    Experiment(WORDS["capacitance"], _capacitance, "capacitance"),
    Experiment(WORDS["film_voltage"], _film_voltage, "probe"),
    Experiment(WORDS["blocked_force"], _blocked_force, "force"),
    Experiment(WORDS["taps"], _taps, "tap"),
    Experiment(WORDS["dwell"], _longer_dwell, equips=_remembering),
)


def _loss(fit: Fit, difference: Array, jacobian: Array) -> float:
    """Compute the increase of twice the cost when a fit moves to match rows off its predictions.

    Predictions are taken as linear and the cost of the old rows as a parabola; unknowns stay within
    their bounds.
    """
    scale = fit.deviations
    root = np.linalg.cholesky(fit.precision)
    matrix = np.concatenate([root.T, jacobian]) * scale
    target = np.concatenate([-np.linalg.solve(root, fit.slope), difference])
    low, high = (fit.bounds - fit.unknowns) / scale
    step = np.linalg.lstsq(matrix, target, rcond=None)[0]
    if np.any((step < low) | (step > high)):
        step = lsq_linear(matrix, target, (np.minimum(low, -1e-9), np.maximum(high, 1e-9)),
                          method="bvls").x
    loss = float(np.sum((matrix @ step - target) ** 2) - np.sum(target[: len(step)] ** 2))
    return max(loss, 0.0)
