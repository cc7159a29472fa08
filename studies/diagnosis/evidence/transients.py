"""Plates in time: transient.csv as mean displacements of blocks of samples, and oscillations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import reduce

import numpy as np

from tympan.base.arrays import Array, Mask, Numbers
from tympan.fem.rig import Loads
from tympan.studies.data.checked_runs import CheckedRun
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.sampled_run import WORDS, SampledRun
from tympan.studies.diagnosis.evidence.kind import FilmsUnderLoads, PlateEvidence, numbers_of
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.transients.block_means import BlockMeans, block_means
from tympan.studies.effects import Setup
from tympan.studies.estimation.noise import Noise, Shared

#: Factor from the frequency of a mass on a spring with that deflection beyond which it is wrong.
_APART_FROM_USUAL = 4.0
#: Share of a reading's own noise from which the timing error of its jump counts: less changes no
#: verdict and takes time.
_MATTERS = 0.05


class Transients(PlateEvidence):
    """Runs in time: displacements and frequencies like any others, and decay rates [1/s]."""

    files = ("transient.csv",)
    kinds = ("decay",)
    alone = True

    def read(self, dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
        """Read the rows of every run that can be used."""
        transients = dataset.transients
        if transients is None:
            return [], []
        tables, remarks, counts = list[ReadingTable](), list[str](), [0, 0]
        parts, file = list[tuple[CheckedRun, BlockMeans]](), transients.file.name
        for run in dataset.runs:
            record, wrong = run.record, run.faults
            words = {"file": file, "name": record.name}
            if wrong.words:
                remarks.append(WORDS["left_out" if wrong.fatal else "beware"].format(
                    **words, reason=wrong.words))
            if wrong.fatal:
                continue
            few = block_means(record, dataset.noise)
            if run.shift is not None:
                # Where a clock error exceeds the noise, a block says nothing about the film.
                few = few[np.abs(few.later) * run.shift.deviation <= few.sigma]
            off = _out_of_time(few, dataset.rig)
            if off is not None:
                remarks.append(WORDS["left_out"].format(**words, reason=off))
                continue
            counts = [counts[0] + len(record.time), counts[1] + len(few.mean)]
            parts.append((run, few))
            (specimen,) = numbers_of(setup, np.array([record.specimen]))
            tables += _rows(record, few, specimen, file)
        if counts[0] > counts[1]:
            remarks.append(WORDS["thinned"].format(samples=counts[0], blocks=counts[1]))
        if not tables:
            return [], remarks
        table = reduce(ReadingTable.joined, tables)
        return [table.with_noise(_with_times_of_jumps(table.noise, table.lengths, parts))], remarks

    def shown(self, films: FilmsUnderLoads, kind: str, rows: Numbers, deflection: Array) -> Array:
        stiffness, mass = films.stiffness(deflection), films.moving
        # Branches dissipate energy through the imaginary part of the stiffness.
        loss = stiffness * films.swing(stiffness).imag
        rate = (films.rig.plate_damping + loss / np.sqrt(stiffness / mass)) / (2 * mass)
        return np.asarray(rate[films.table.state[rows]])


def _out_of_time(few: BlockMeans, loads: Loads) -> str | None:
    """Give a message if the plate oscillates at times that no mass on this film can have.

    A mass on a spring that deflects by y under its weight has 2πf = √(g/y).
    """
    if loads.gas_pressure or loads.biases or not len(few.mean):
        return None
    usual = float(np.sqrt(loads.gravity / max(abs(few.mean[0]), 1e-9))) / (2 * np.pi)
    for swing in few.swings.values():
        if not usual / _APART_FROM_USUAL < swing.frequency < usual * _APART_FROM_USUAL:
            return WORDS["out_of_time"].format(frequency=swing.frequency, usual=usual)
    return None


def _with_times_of_jumps(noise: Noise, lengths: Mask,
                         runs: Sequence[tuple[CheckedRun, BlockMeans]]) -> Noise:
    """Add a common error for the time of each jump, and one for the times of all jumps.

    They are known within a sample; a clock that starts with the voltage shifts all by the same
    amount. A run with a shifted clock is known less well, and so are all runs together: how slowly
    a film begins to move is the same in each.
    """
    columns = list[Array]()
    every = np.zeros(int(lengths.sum()))
    first = 0
    for run, few in runs:
        for place, jump in enumerate(run.record.jumps.tolist()):
            rows = first + np.flatnonzero(few.jump == place)
            unsure, column = run.record.unsure(jump), np.zeros(len(every))
            off = run.shift.deviation if run.shift else 0.0
            column[rows] = few.later[few.jump == place] * np.hypot(unsure, off)
            every[rows] = column[rows]
            columns.append(column)
        first += len(few.mean)
    shared = np.stack([every, *columns], 1)
    matters = ~(np.abs(shared) < _MATTERS * noise.sigma[lengths][:, None]).all(axis=1)
    rows = np.flatnonzero(lengths)[matters]
    return noise.plus(Shared.of(rows, shared[matters])) if len(rows) else noise


def _rows(record: SampledRun, few: BlockMeans, specimen: int, file: str) -> list[ReadingTable]:
    """Build displacements of blocks, counted from the state before the last jump; oscillations."""
    times = [0.0, *(float(record.time[first:last].mean())
                    for first, last in zip(few.first, few.last, strict=True))]
    jump, run = np.r_[-1, few.jump], record.run
    states = replace(States.of([specimen] * len(jump), np.full(len(jump), record.mass),
                               np.r_[record.voltage[0], few.voltage], np.array(times)),
                     passage=few.passages)
    # The first state has no reading: the run begins there.
    before = np.array([np.flatnonzero(jump < max(number, 0))[-1] for number in jump.tolist()])
    table = rows(states, "displacement", np.r_[1.0, few.sigma], np.r_[0.0, few.mean], run=run,
                 file=file, line=np.r_[0, record.line[few.first]])
    tables = [replace(table, since=np.where(jump >= 0, before, -1))[np.arange(1, len(jump))]]
    swings = {number: swing for number, swing in few.swings.items() if (jump == number).any()}
    last = np.array([np.flatnonzero(jump == number)[-1] for number in swings], dtype=np.int64)
    for kind in ("frequency", "decay") if swings else ():
        value, sigma = (np.array([getattr(swing, name) for swing in swings.values()])
                        for name in (kind, f"{kind}_sigma"))
        tables.append(rows(states[last], kind, sigma, value, run=run, file=file,
                           line=table.line[last]))
    return tables
