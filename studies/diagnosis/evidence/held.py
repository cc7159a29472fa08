"""Displacement-controlled plates: force.csv, the force that holds the plate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.segment_columns import shares_of
from tympan.studies.diagnosis.evidence.kind import (
    CHANNEL,
    FilmsUnderLoads,
    PlateEvidence,
    numbers_of,
)
from tympan.studies.diagnosis.patterns.reading_patterns import smooth
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.effects import Setup
from tympan.studies.effects.effect import Observable

#: Number of polynomials in the deflection for a loop's width: it is 0 where the motion turns.
_OF_A_LOOP = 3
#: Most turns of the plate in a run whose rows count as being in the order of reading.
_TURNS = 8


class Held(PlateEvidence):
    """Forces that hold plates at deflections [N], positive along the deflection."""

    files = ("force.csv",)
    kinds = ("force",)
    noisy = True
    alone = True

    def read(self, dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
        read = dataset.forces
        if read is None:
            return [], []
        sigma = np.where(np.isnan(read.sigma), CHANNEL * np.abs(read.force).max(), read.sigma)
        states = States.of(numbers_of(setup, read.specimen), np.zeros(len(read)), read.voltage,
                           direction=_ways(read), shares=shares_of(read, setup.specimens))
        return [rows(replace(states, deflection=read.displacement), "force", sigma, read.force,
                     run=read.run, file=read.file.name, line=read.line,
                     given=~np.isnan(read.sigma))], []

    def shown(self, films: FilmsUnderLoads, kind: str, rows: Numbers, deflection: Array) -> Array:
        shown = films.rig.gauged(films.force, films.stiffness, deflection)
        return np.asarray(shown[films.table.state[rows]])

    def observables(self, table: ReadingTable) -> set[Observable]:
        return {Observable.FORCE} if "force" in table.kind else set()

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        """Build columns smooth in the deflection: by specimen, with the voltage, and of a loop.

        A loop is the difference between the ways out and back, smooth in the deflection.
        """
        size = float(np.sqrt(np.mean(predicted**2))) or float(table.sigma.max())
        along = smooth(np.abs(table.states.deflection[table.state]))
        every = [(table.specimen == number)[:, None] * along
                 for number in np.unique(table.specimen)]
        charged = [squared[:, None] * along for squared in smooth(table.voltage**2)[:, 1:3].T]
        way = table.states.direction[table.state]
        return {"channel force": size * np.hstack([*every, *charged])} | (
            {"loop": size * way[:, None] * along[:, :_OF_A_LOOP]} if np.ptp(way) > 0 else {})


def _ways(read: Sheet) -> Array:
    """Find the way in which each plate was moved: 1 out, -1 back, 0 where it is not known.

    It is read from the file, else found from the displacement before in the same run and file.
    """
    written = (read.direction == "out") * 1.0 - (read.direction == "back")
    if written.any():
        return np.asarray(written)
    ways = np.zeros(len(read))
    runs = np.unique([f"{name}/{run}/{voltage}/{drive}" for name, run, voltage, drive in zip(
        read.specimen, read.run, read.voltage, read.drive, strict=True)], return_inverse=True)[1]
    for number in range(runs.max(initial=-1) + 1):
        rows = np.flatnonzero(runs == number)
        steps = np.sign(np.diff(read.displacement[rows]))
        # Rows that turn a few times are in the order of reading; else they are shuffled.
        if np.sum(np.diff(steps) != 0) <= _TURNS and len(steps):
            ways[rows] = np.r_[steps[0], steps]
    return ways if ways.min() < 0 < ways.max() else np.zeros(len(read))
