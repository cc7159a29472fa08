"""The menu of next experiments: what could be read besides what has been, and how well."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.inference.fit import Fit
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced.hypothesis import FACTORS
from tympan.studies.diagnosis.reduced.simulation import Simulation

Array = NDArray[np.float64]

#: What to do and what it tells, in words.
WORDS: dict[str, str] = tomllib.loads(
    Path(__file__).with_name("words.toml").read_text(encoding="utf-8"))

_HOUR = 3600.0
_FORCE = 1e-3


@dataclass(frozen=True, eq=False)
class Readout:
    """What was read, and the nominal model's fit to it."""

    simulation: Simulation
    table: ReadingTable
    nominal: Fit

    @cached_property
    def states(self) -> States:
        """The states whose displacement was read, each once."""
        used = np.unique(np.r_[self.table.state, self.table.since[self.table.since >= 0]])
        states = self.table.states[used]
        states = states[np.isnan(states.heave)]
        keys = np.stack([states.specimen, states.mass, states.voltage, states.elapsed,
                         states.direction], 1)
        return states[np.sort(np.unique(np.nan_to_num(keys), axis=0, return_index=True)[1])]

    @cached_property
    def ramps(self) -> Array:
        """Specimen and mass of each ramp, shape (ramps, 2)."""
        return np.unique(np.stack([self.states.specimen.astype(float), self.states.mass], 1),
                         axis=0)

    @cached_property
    def sigma(self) -> float:
        """Typical noise of a displacement [m]."""
        sigma = self.table.sigma[self.table.lengths]
        return float(np.median(sigma)) if len(sigma) else float("nan")

    def shown(self, table: ReadingTable) -> Array:
        """What the nominal model expects."""
        return self.simulation.predict((), self.nominal.unknowns, table)

    def within_reach(self, table: ReadingTable) -> NDArray[np.bool_]:
        """Rows in states that the force laws cover, by the nominal model."""
        stiffness, permittivity = np.exp(self.nominal.unknowns[FACTORS])
        grids = [law.grid for law in self.simulation.laws]
        heave, voltage_squared = np.array([[grid.heave, grid.voltage_squared]
                                           for grid in grids])[table.states.specimen].T
        reached = self.simulation.heaves((), self.nominal.unknowns, table.states)
        seen = permittivity / stiffness * table.states.voltage**2
        inside = (reached <= heave) & (seen <= voltage_squared)
        return np.asarray(inside[table.state])


@dataclass(frozen=True)
class Experiment:
    """Readings that could be made.

    ``what`` are the words for it, which may hold the largest {mass} and {voltage} of the rows and
    the {time} of the first; ``rows`` makes them, with their noise and no values yet, or None where
    the experiment makes no sense.
    """

    what: str
    rows: Callable[[Readout], ReadingTable | None]

    def words(self, table: ReadingTable) -> str:
        """What to do, for those of the rows that remain."""
        return self.what.format(mass=f"{1e3 * table.mass.max():.4g} g",
                                voltage=f"{table.voltage.max() / 1e3:.3g} kV",
                                time=f"{np.nan_to_num(table.states.elapsed).min() / _HOUR:.2g} h")


def repeated(readout: Readout) -> ReadingTable:
    """All readings once more."""
    return rows(readout.states, "displacement", readout.sigma)


def between(readout: Readout) -> ReadingTable | None:
    """Readings at voltages halfway between those there are."""
    halves = []
    for specimen, mass in readout.ramps:
        ramp = (readout.states.specimen == specimen) & (readout.states.mass == mass)
        voltage = np.unique(readout.states.voltage[ramp])
        halves += [(specimen, mass, half) for half in (voltage[1:] + voltage[:-1]) / 2]
    if not halves:
        return None
    return rows(_new_run(readout, *np.array(halves).T), "displacement", readout.sigma)


def other_mass(readout: Readout, factor: float) -> ReadingTable:
    """Every specimen under ``factor`` times the largest mass, at the voltages it has been at."""
    specimen, voltage = np.unique(np.stack([readout.states.specimen.astype(float),
                                            readout.states.voltage], 1), axis=0).T
    mass = np.full(len(specimen), factor * readout.states.mass.max())
    return rows(_new_run(readout, specimen, mass, voltage), "displacement", readout.sigma)


def higher_voltages(readout: Readout, factor: float, count: int = 5) -> ReadingTable | None:
    """Every ramp continued to ``factor`` times the largest voltage in so many steps."""
    top = float(readout.states.voltage.max())
    if top <= 0:
        return None
    voltage = top * (1 + (factor - 1) * np.arange(1, count + 1) / count)
    specimen, mass = np.repeat(readout.ramps, count, axis=0).T
    states = _new_run(readout, specimen, mass, np.tile(voltage, len(readout.ramps)))
    return rows(states, "displacement", readout.sigma)


def backwards(readout: Readout) -> ReadingTable | None:
    """The run in reverse right after it, where times or ways of the readings are known."""
    states = readout.states
    if not (np.ptp(states.elapsed) > 0 or np.any(states.direction != 0)):
        return None
    back = replace(states, elapsed=2 * states.elapsed.max() - states.elapsed,
                   direction=-states.direction)
    return rows(back, "displacement", readout.sigma)


def later(readout: Readout, runs: float) -> ReadingTable | None:
    """All readings again after a pause of so many runs, an hour at least, where times are known."""
    states = readout.states
    length = float(np.ptp(states.elapsed))
    if not length > 0:
        return None
    pause = max(runs * length, _HOUR)
    again = replace(states, elapsed=states.elapsed + length + pause)
    return rows(again, "displacement", readout.sigma)


def capacitance(readout: Readout, share: float) -> ReadingTable:
    """The capacitance of the film in every state, to a share."""
    table = rows(readout.states, "capacitance", 1.0)
    return table.with_sigma(share * np.abs(readout.shown(table)))


def film_voltage(readout: Readout, share: float) -> ReadingTable | None:
    """The voltage on the film in every state with any, to a share."""
    states = readout.states[readout.states.voltage > 0]
    return rows(states, "film_voltage", share * states.voltage) if len(states) else None


def blocked_force(readout: Readout, share: float) -> ReadingTable:
    """The force on plates held where the masses bring them without voltage, to a share or 1 mN."""
    states = readout.states
    unloaded = replace(states, voltage=np.zeros(len(states)))
    heave = readout.simulation.heaves((), readout.nominal.unknowns, unloaded)
    table = rows(replace(states, heave=heave), "force", 1.0)
    return table.with_sigma(np.maximum(share * np.abs(readout.shown(table)), _FORCE))


def _new_run(readout: Readout, specimen: Array, mass: Array, voltage: Array) -> States:
    """States in a run of its own, in this order, as fast as the readings so far."""
    pace = float(np.ptp(np.nan_to_num(readout.states.elapsed))) / max(len(readout.states) - 1, 1)
    direction = np.full(len(specimen), float(np.any(readout.states.direction != 0)))
    elapsed = pace * np.arange(float(len(specimen)))
    return States.of(specimen.astype(np.int64), mass, voltage, elapsed, direction)


#: What is on offer, with less effort first. Another shape is not: its film's force law would have
#: to be computed.
MENU = (
    Experiment(WORDS["repeated"], repeated),
    Experiment(WORDS["between"], between),
    Experiment(WORDS["backwards"], backwards),
    Experiment(WORDS["later"], partial(later, runs=4.0)),
    *(Experiment(WORDS["hang"], partial(other_mass, factor=factor)) for factor in (0.5, 1.5, 2.0)),
    *(Experiment(WORDS["raise"], partial(higher_voltages, factor=factor))
      for factor in (1.15, 1.4)),
    Experiment(WORDS["capacitance"], partial(capacitance, share=0.01)),
    Experiment(WORDS["film_voltage"], partial(film_voltage, share=0.01)),
    Experiment(WORDS["blocked_force"], partial(blocked_force, share=0.01)),
)
