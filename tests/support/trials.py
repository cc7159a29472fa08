"""Datasets made by the reduced model: three shapes, two masses, up to 6.5 kV, one minute a reading.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.studies.diagnosis.hypothesis import Cause, Hypothesis
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import EFFECTS
from tympan.studies.effects.effect import Observable

MASSES = (17.9e-3, 22.45e-3)

#: Effects of film, electrode, load, supply and sensor, among which verdicts are found where it does
#: not matter whether there are more: a tenth of the work.
FEW = ("strain_stiffening", "electrode_margin", "unaccounted_mass", "parallel_spring",
       "amplifier_gain", "voltage_sag", "sensor_zero", "drift")


def every_cause(simulation: Simulation) -> list[Cause]:
    """All but those that only a way up and down, a frequency, a line or a tester shows."""
    return [Cause(name, which) for name, effect in EFFECTS.items()
            if not {Observable.DIRECTION, Observable.FREQUENCY, Observable.SHAPE, Observable.FORCE
                    } & set(effect.shows_in)
            for which in effect.choices(simulation.setup)]


def few_causes(simulation: Simulation, more: tuple[str, ...] = ()) -> list[Cause]:
    """Causes of the effects :data:`FEW` and of some others."""
    return [cause for cause in every_cause(simulation) if cause.name in (*FEW, *more)]


def without_effects(simulation: Simulation) -> Simulation:
    """The same films, for causes that change none: larger laws are then solved without effects."""
    return replace(simulation, laws=tuple(
        replace(law, axes=(), samples={(): law.samples[()]}) for law in simulation.laws))


def design(sigma: float, voltages: int = 15, masses: tuple[float, ...] = MASSES) -> ReadingTable:
    """Displacements of every shape under every mass at every voltage, in this order."""
    grid = np.meshgrid(np.arange(3.0), masses, np.linspace(0, 6.5e3, voltages), indexing="ij")
    specimen, mass, voltage = (axis.ravel() for axis in grid)
    elapsed = 60.0 * np.arange(len(mass))
    return rows(States.of(specimen.astype(np.int64), mass, voltage, elapsed), "displacement", sigma)


def read(simulation: Simulation, table: ReadingTable, hypothesis: Hypothesis, sizes: list[float],
         seed: int) -> ReadingTable:
    """The table with noisy readings of films 5 % stiffer and 3 % less permittive than nominal."""
    values = simulation.predict(hypothesis, np.array([0.05, -0.03, *sizes]), table)
    return table.with_values(values + table.sigma
                             * np.random.default_rng(seed).standard_normal(len(table)))


def size_of(cause: Cause, deviations: float) -> float:
    """The size of its first parameter, in standard deviations of the prior, within its limits."""
    parameter = cause.effect.parameters[0]
    return float(np.clip(deviations * parameter.deviation, *parameter.limits))
