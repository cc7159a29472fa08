"""Plates held by a tester: force.csv, the force that this takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import Dataset
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

#: Polynomials in the heave that a loop's width follows: it opens and closes where the way turns.
_OF_A_LOOP = 3
#: Most times that the plate turns in a run whose rows are in the order in which they were read.
_TURNS = 8


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
        states = States.of(numbers_of(setup, read.specimen), np.zeros(len(read)), read.voltage,
                           direction=_ways(read))
        return [rows(replace(states, heave=read.displacement), "force", sigma, read.force,
                     run=read.run, file=read.file.name, line=read.line,
                     given=~np.isnan(read.sigma))], []

    def shown(self, films: FilmsUnderLoads, kind: str, rows: Numbers, heave: Array) -> Array:
        shown = films.rig.gauged(films.force, films.stiffness, heave)
        return np.asarray(shown[films.table.state[rows]])

    def observables(self, table: ReadingTable) -> set[Observable]:
        return {Observable.FORCE} if "force" in table.kind else set()

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        """Smooth in the heave, of each specimen, in the heave as the voltage changes, and a loop.

        A loop is the difference on the way out and back, smooth in the heave.
        """
        size = float(np.sqrt(np.mean(predicted**2))) or float(table.sigma.max())
        along = smooth(np.abs(table.states.heave[table.state]))
        every = [(table.specimen == number)[:, None] * along
                 for number in np.unique(table.specimen)]
        charged = [squared[:, None] * along for squared in smooth(table.voltage**2)[:, 1:3].T]
        way = table.states.direction[table.state]
        return {"channel force": size * np.hstack([*every, *charged])} | (
            {"loop": size * way[:, None] * along[:, :_OF_A_LOOP]} if np.ptp(way) > 0 else {})


def _ways(read: Sheet) -> Array:
    """Way in which each plate was moved: 1 out, -1 back, 0 where it is not known.

    As it is written, else by the displacement before in the same run and file.
    """
    written = (read.direction == "out") * 1.0 - (read.direction == "back")
    if written.any():
        return np.asarray(written)
    ways = np.zeros(len(read))
    runs = np.unique([f"{name}/{run}/{voltage}" for name, run, voltage in zip(
        read.specimen, read.run, read.voltage, strict=True)], return_inverse=True)[1]
    for number in range(runs.max(initial=-1) + 1):
        rows = np.flatnonzero(runs == number)
        steps = np.sign(np.diff(read.displacement[rows]))
        # A run that turns once or a few times is one as it was made; else its rows are shuffled.
        if np.sum(np.diff(steps) != 0) <= _TURNS and len(steps):
            ways[rows] = np.r_[steps[0], steps]
    return ways if ways.min() < 0 < ways.max() else np.zeros(len(read))
