"""What readings can tell before they are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tympan.geometry.errors import InputError
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.calibration import calibrated, largest_charge, with_effects
from tympan.studies.diagnosis.inference.identifiability import Detectable, Knowable, knowable
from tympan.studies.diagnosis.reading_table import Table
from tympan.studies.diagnosis.readings import Readings, readings_of
from tympan.studies.diagnosis.reduced.sampling import nominal_law
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import Setup

_ROUNDS, _GROWTH = 5, 1.5


@dataclass(frozen=True, eq=False)
class Plan:
    """What planned readings can tell, and with which noise."""

    dataset: Dataset
    readings: Readings
    table: Table
    known: Knowable

    def record(self) -> dict[str, Any]:
        """As a JSON object."""
        lengths = np.isin(self.table.kind, ("displacement", "range"))
        return {
            "dataset": self.dataset.name,
            "readings": len(self.table),
            "noise_um": 1e6 * float(np.sqrt(np.mean(self.table.sigma[lengths] ** 2))),
            "noise_from": self.readings.noise_from,
            "not_visible": sorted({str(cause) for cause in self.known.invisible}),
            "indistinguishable": [[str(cause) for cause in group] for group in self.known.classes],
            "effects": [detectable(one) for one in self.known.effects],
        }


def detectable(one: Detectable) -> dict[str, Any]:
    """A line of the table of what can be seen, as a JSON object."""
    return {"effect": str(one.cause), "parameter": one.parameter, "unit": one.unit,
            "seen_from": one.seen,
            "told_from": one.told, "rival": one.rival, "prior_width": one.prior}


def plan(dataset: Dataset, workers: int = 1,
         progress: Callable[[int, int], None] = lambda done, all_of_them: None) -> Plan:
    """What a dataset's readings can tell, whatever was or will be read: their values are not looked at.

    Raises
    ------
    InputError
        When a planned state has no equilibrium.
    """
    readings = readings_of(dataset)
    table = predicted(readings.setup, readings.table)
    nominal, found = calibrated(readings.setup, table)
    simulation = with_effects(nominal, progress, workers)
    return Plan(dataset, readings, table,
                knowable(simulation, table, found.unknowns, readings.causes))


def predicted(setup: Setup, table: Table) -> Table:
    """The table with what the nominal model says in place of readings."""
    heave = np.array([0.2 * specimen.gap for specimen in setup.specimens])
    charge = [1.3 * largest_charge(setup, table, number) + 1e4
              for number in range(len(setup.specimens))]
    for _ in range(_ROUNDS):
        laws = tuple(nominal_law(setup, specimen.name, float(w), float(q))
                     for specimen, w, q in zip(setup.specimens, heave, charge, strict=True))
        values = Simulation(setup, laws).predict((), np.zeros(2), table)
        if np.isfinite(values).all():
            return table.with_values(values)
        heave = np.minimum(_GROWTH * heave, [0.8 * specimen.gap for specimen in setup.specimens])
    row = int(np.flatnonzero(~np.isfinite(values))[0])
    state = table.states[table.state[row : row + 1]]
    raise InputError("the nominal model has no equilibrium there: plan a lower voltage or mass",
                     key="readings",
                     given=f"{setup.specimens[int(state.specimen[0])].name}, {1e3 * state.mass[0]:.4g} g, "
                           f"{1e-3 * state.voltage[0]:.4g} kV")
