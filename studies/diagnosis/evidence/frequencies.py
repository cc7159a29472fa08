"""Small oscillations of plates: frequency.csv, and frequencies found in runs in time."""

from __future__ import annotations

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.segment_columns import shares_of
from tympan.studies.diagnosis.evidence.kind import (
    CHANNEL,
    FilmsUnderLoads,
    PlateEvidence,
    numbers_of,
)
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.effects import Setup
from tympan.studies.effects.effect import Observable


class Frequencies(PlateEvidence):
    """Frequencies of small oscillations of the plate [Hz]."""

    files = ("frequency.csv",)
    kinds = ("frequency",)

    def read(self, dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
        read = dataset.frequencies
        if read is None:
            return [], []
        # Damping with quality factor Q moves a peak by 1/(4 Q²) of its frequency.
        quality = np.nan_to_num(read.quality, nan=np.inf)
        share = np.maximum(CHANNEL, 0.25 / quality**2)
        sigma = np.where(np.isnan(read.sigma), share * read.frequency, read.sigma)
        states = States.of(numbers_of(setup, read.specimen), read.mass, read.voltage,
                           run=np.arange(len(read)), shares=shares_of(read, setup.specimens))
        return [rows(states, "frequency", sigma, read.frequency, file=read.file.name,
                     line=read.line, given=~np.isnan(read.sigma))], []

    def shown(self, films: FilmsUnderLoads, kind: str, rows: Numbers, deflection: Array) -> Array:
        stiffness = films.stiffness(deflection)
        squared = stiffness * films.swing(stiffness).real / films.moving
        return np.asarray(np.sqrt(squared) / (2 * np.pi))[films.table.state[rows]]

    def observables(self, table: ReadingTable) -> set[Observable]:
        return {Observable.FREQUENCY} if "frequency" in table.kind else set()
