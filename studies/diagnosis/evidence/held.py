"""Plates held by a tester: force.csv, the force that this takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.evidence.kind import CHANNEL, Films, PlateEvidence, numbers_of
from tympan.studies.diagnosis.patterns.reading_patterns import smooth
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.effects import Setup
from tympan.studies.effects.effect import Quantity

Array = NDArray[np.float64]


class Held(PlateEvidence):
    """Forces that hold plates at heaves [N], positive along the deflection."""

    files = ("force.csv",)
    kinds = ("force",)
    noisy = True
    alone = True

    def read(self, dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
        read = dataset.forces
        if read is None:
            return [], []
        sigma = np.where(np.isnan(read.sigma), CHANNEL * np.abs(read.force).max(), read.sigma)
        states = States.of(numbers_of(setup, read.specimen), np.zeros(len(read)), read.voltage)
        return [rows(replace(states, heave=read.displacement), "force", sigma, read.force,
                     run=read.run, file=read.file.name, line=read.line,
                     given=~np.isnan(read.sigma))], []

    def shown(self, films: Films, kind: str, rows: NDArray[np.int64], heave: Array) -> Array:
        shown = films.rig.gauged(films.force, films.stiffness, heave)
        return np.asarray(shown[films.table.state[rows]])

    def tells(self, table: ReadingTable) -> set[Quantity]:
        return {Quantity.FORCE} if "force" in table.kind else set()

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        """Smooth in the heave, of each specimen, and in the heave as the voltage changes."""
        size = float(np.sqrt(np.mean(predicted**2))) or float(table.sigma.max())
        along = smooth(np.abs(table.states.heave[table.state]))
        every = [(table.specimen == number)[:, None] * along
                 for number in np.unique(table.specimen)]
        charged = [squared[:, None] * along for squared in smooth(table.voltage**2)[:, 1:3].T]
        return {"channel force": size * np.hstack([*every, *charged])}
