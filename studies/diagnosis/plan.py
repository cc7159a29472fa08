"""What readings can tell before they are made."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from tympan.geometry.errors import InputError
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import (
    calibrated,
    largest_voltage_squared,
    nominal_laws,
    with_effects,
)
from tympan.studies.diagnosis.inference.identifiability import (
    classes_of,
    detectable_effects,
    signatures,
)
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import Setup

_ROUNDS, _GROWTH = 5, 1.5


def plan_readings(dataset: Dataset, workers: int = 1,
                  progress: Callable[[int, int], None] = lambda done, all_of_them: None
                  ) -> dict[str, Any]:
    """What a dataset's readings can tell, whatever was or will be read, as a JSON object.

    Their values are not looked at.

    Raises
    ------
    InputError
        When a planned state has no equilibrium.
    """
    readings = prepared_readings(dataset)
    table = _predicted(readings.setup, readings.table)
    nominal, fit = calibrated(readings.setup, table)
    signs = signatures(with_effects(nominal, progress, workers), table, fit.unknowns,
                       readings.causes)
    invisible, classes = classes_of(signs)
    return {
        "dataset": dataset.name,
        "readings": len(table),
        "noise_um": 1e6 * float(np.sqrt(np.mean(table.sigma[table.lengths] ** 2))),
        "noise_from": readings.noise_from,
        "not_visible": sorted({str(cause) for cause in invisible}),
        "indistinguishable": [[str(cause) for cause in group] for group in classes],
        "effects": [effect.json() for effect in detectable_effects(signs)],
    }


def _predicted(setup: Setup, table: ReadingTable) -> ReadingTable:
    """The table with what the nominal model says in place of readings."""
    heave = np.array([0.2 * specimen.gap for specimen in setup.specimens])
    highest = np.array([0.8 * specimen.gap for specimen in setup.specimens])
    voltage_squared = np.array([1.3 * largest_voltage_squared(setup, table, number) + 1e4
                                for number in range(len(setup.specimens))])
    for _ in range(_ROUNDS):
        simulation = Simulation(setup, nominal_laws(setup, heave, voltage_squared))
        values = simulation.predict((), np.zeros(2), table)
        if np.isfinite(values).all():
            return table.with_values(values)
        heave = np.minimum(_GROWTH * heave, highest)
    row = int(np.flatnonzero(~np.isfinite(values))[0])
    raise InputError("the nominal model has no equilibrium there: plan a lower voltage or mass",
                     key="readings",
                     given=f"{setup.specimens[int(table.specimen[row])].name}, "
                           f"{1e3 * table.mass[row]:.4g} g, {1e-3 * table.voltage[row]:.4g} kV")
