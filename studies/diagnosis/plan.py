"""What readings can tell before they are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tympan.geometry.errors import InputError
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import calibrated, largest_voltage_squared, with_effects
from tympan.studies.diagnosis.inference.identifiability import (
    EffectIdentifiability,
    effect_identifiability,
)
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.readings import PreparedReadings, prepared_readings
from tympan.studies.diagnosis.reduced.sampling import nominal_law
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import Setup

_ROUNDS, _GROWTH = 5, 1.5


@dataclass(frozen=True, eq=False)
class ReadingPlan:
    """What planned readings can tell, and with which noise."""

    dataset: Dataset
    readings: PreparedReadings
    table: ReadingTable
    identifiability: EffectIdentifiability

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        lengths = np.isin(self.table.kind, ("displacement", "range"))
        return {
            "dataset": self.dataset.name,
            "readings": len(self.table),
            "noise_um": 1e6 * float(np.sqrt(np.mean(self.table.sigma[lengths] ** 2))),
            "noise_from": self.readings.noise_from,
            "not_visible": sorted({str(cause) for cause in self.identifiability.invisible}),
            "indistinguishable": [[str(cause) for cause in group]
                                  for group in self.identifiability.classes],
            "effects": [effect.json() for effect in self.identifiability.effects],
        }


def plan_readings(dataset: Dataset, workers: int = 1,
         progress: Callable[[int, int], None] = lambda done, all_of_them: None) -> ReadingPlan:
    """What a dataset's readings can tell, whatever was or will be read.

    Their values are not looked at.

    Raises
    ------
    InputError
        When a planned state has no equilibrium.
    """
    readings = prepared_readings(dataset)
    table = predicted(readings.setup, readings.table)
    nominal, found = calibrated(readings.setup, table)
    simulation = with_effects(nominal, progress, workers)
    return ReadingPlan(dataset, readings, table,
                effect_identifiability(simulation, table, found.unknowns, readings.causes))


def predicted(setup: Setup, table: ReadingTable) -> ReadingTable:
    """The table with what the nominal model says in place of readings."""
    heave = np.array([0.2 * specimen.gap for specimen in setup.specimens])
    voltage_squared = [1.3 * largest_voltage_squared(setup, table, number) + 1e4
              for number in range(len(setup.specimens))]
    for _ in range(_ROUNDS):
        laws = tuple(nominal_law(setup, specimen.name, float(w), float(q))
                     for specimen, w, q in zip(setup.specimens, heave, voltage_squared,
                                               strict=True))
        values = Simulation(setup, laws).predict((), np.zeros(2), table)
        if np.isfinite(values).all():
            return table.with_values(values)
        heave = np.minimum(_GROWTH * heave, [0.8 * specimen.gap for specimen in setup.specimens])
    row = int(np.flatnonzero(~np.isfinite(values))[0])
    state = table.states[table.state[row : row + 1]]
    raise InputError("the nominal model has no equilibrium there: plan a lower voltage or mass",
                     key="readings",
                     given=f"{setup.specimens[int(state.specimen[0])].name}, "
                           f"{1e3 * state.mass[0]:.4g} g, "
                           f"{1e-3 * state.voltage[0]:.4g} kV")
