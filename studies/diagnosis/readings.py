"""A dataset's readings as a table to predict, with their noise."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.base.errors import InputError
from tympan.studies.data.checks import slips_of_sign, slips_of_unit
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.noise import coarse_step, ramp_scatter, repeat_noise
from tympan.studies.diagnosis.evidence.kind import (
    ASSUMED,
    FEWEST,
    PlateEvidence,
    PreparedReadings,
)
from tympan.studies.diagnosis.evidence.registry import PLATES
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.effects import Setup
from tympan.studies.estimation.noise import SCATTER, Noise, Shared, Source

#: Number of readings above which those of nearly the same state are averaged. It limits the cost.
MANY = 2000

_BINS = 200


def prepared_readings(dataset: Dataset) -> PreparedReadings:
    """Prepare the readings of plates under loads, of every kind in a dataset.

    Raise an :class:`InputError` when they are too few to conclude anything, nothing loads the film,
    or a column is in a wrong unit.
    """
    used = {name for sheet in dataset.sheets for name in sheet.specimen.tolist()}
    setup = Setup(tuple(specimen for specimen in dataset.specimens if specimen.name in used),
                  dataset.rig, dataset.formula)
    _refuse(dataset)
    parts, remarks = _read([kind for kind in PLATES if not kind.noisy], dataset, setup)
    noisy, seen = _read([kind for kind in PLATES if kind.noisy], dataset, setup)
    counted = parts if dataset.forces is None else [*parts, *noisy]
    if sum(map(len, counted)) < FEWEST:
        raise InputError(f"less than {FEWEST} can be used", key="readings",
                         given="; ".join(remarks) or sum(map(len, dataset.sheets)))
    if not parts:
        return PreparedReadings(setup, reduce(ReadingTable.joined, noisy), tuple(PLATES),
                                (*remarks, *seen))
    table = _with_noise(reduce(ReadingTable.joined, parts), dataset)
    if dataset.static is not None and (moved := dataset.run_zeros) is not None:
        read = np.flatnonzero((table.kind == "displacement") & np.isin(table.run, moved.runs)
                              & (table.file == dataset.static.file.name))
        zeros = Shared.of(read, moved.columns(table.run[read]))
        table = table.with_noise(table.noise.plus(zeros))
    if step := coarse_step(dataset):
        table = _rounded(table, step)
    table, fewer = _not_too_many(table)
    table = reduce(ReadingTable.joined, noisy, table)
    return PreparedReadings(setup, table, tuple(PLATES), (*remarks, *fewer, *seen))


def _read(kinds: list[PlateEvidence], dataset: Dataset, setup: Setup
          ) -> tuple[list[ReadingTable], list[str]]:
    """Read the rows of some kinds; say what was done to the readings."""
    read = [kind.read(dataset, setup) for kind in kinds]
    return ([table for tables, _ in read for table in tables],
            [remark for _, remarks in read for remark in remarks])


def _refuse(dataset: Dataset) -> None:
    """Raise an :class:`InputError` for readings by which nothing can be concluded."""
    count = sum(map(len, dataset.sheets))
    if count < FEWEST:
        raise InputError(f"needs at least {FEWEST} readings in static.csv and range.csv: stiffness "
                         "and permittivity alone take two of them", key="readings", given=count)
    there = [kind for kind in PLATES if not dataset.tables.keys().isdisjoint(kind.files)]
    if not any(kind.alone for kind in there):
        raise InputError(f"must have static.csv or range.csv beside {there[0].files[0]}: by that "
                         "alone a mass cannot be separated from a stiffness", key=dataset.name)
    rig = dataset.rig
    if not (rig.force(dataset.masses, 1.0).any() or rig.gas_pressure or rig.biases
            or dataset.forces is not None):
        words = "a film that nothing loads stays flat under any voltage"
        if all(specimen.plate is None for specimen in dataset.specimens):
            raise InputError(f"must not be 0: {words}", file="dataset.toml",
                             key="rig.gas_pressure", given="0 Pa")
        raise InputError(f"must be above 0 in some reading: {words}", key="mass",
                         given="0 g everywhere")
    for slip in (*slips_of_unit(dataset), *slips_of_sign(dataset)):
        raise InputError(slip, key=dataset.name)


def _with_noise(table: ReadingTable, dataset: Dataset) -> ReadingTable:
    """Add the noise of all rows.

    Raise an :class:`InputError` where planned readings have no stated noise.
    """
    planned = bool(np.isnan(table.value).any())
    unknown = np.isnan(table.sigma)
    if not unknown.any():
        repeated = dataset.noise is None and not planned and repeat_noise(dataset) is not None
        return table.with_noise(_of(table, table.sigma, "from repeats" if repeated else "stated"))
    if planned:
        raise InputError("is needed to plan: the standard deviation of one reading", key="noise",
                         given=None)
    size = ASSUMED * float(np.sqrt(np.mean(table.value[unknown] ** 2)))
    if (scatter := ramp_scatter(dataset)) is not None:
        size = min(size, scatter.size)
    enough = len(table) > 4 * FEWEST
    return table.with_noise(_of(table, np.where(unknown, size, table.sigma),
                                SCATTER if enough else "assumed"))


def _of(table: ReadingTable, sigma: Array, source: Source) -> Noise:
    """Build noise with these standard deviations, and with a table's common errors."""
    return Noise.of(sigma, source).plus(*table.noise.terms)


def _not_too_many(table: ReadingTable) -> tuple[ReadingTable, list[str]]:
    """Average static readings if there are more than :data:`MANY`, and add a remark."""
    resting = ~np.isin(table.state, table.states.in_time)
    if resting.sum() <= MANY:
        return table, []
    few = averaged(table[resting].compact())
    remark = f"{resting.sum()} readings were averaged to {len(few)} of nearly the same state"
    return _beside_passages(few, table, resting), [remark]


def _rounded(table: ReadingTable, step: float) -> ReadingTable:
    """Merge equal readings of a state, rounded by a display; their noise is half a step."""
    resting = ~np.isin(table.state, table.states.in_time)
    few = averaged(table[resting].compact())
    rounding = np.where(few.kind == "displacement", step / 2, 0.0)
    few = few.with_noise(Noise(np.hypot(few.sigma, rounding), source=few.noise.source))
    return _beside_passages(few, table, resting)


def _beside_passages(few: ReadingTable, table: ReadingTable, resting: Mask
                     ) -> ReadingTable:
    """Replace the static rows of a table by few, and keep its other rows."""
    return few if resting.all() else few.joined(table[~resting].compact())


def averaged(table: ReadingTable) -> ReadingTable:
    """Average rows of nearly the same state into one, with its noise.

    States are nearly the same within 1/200 of the voltages and 1/20 of the times, if reached in the
    same direction, and in the same run where runs have zeros of their own.
    """
    states = table.states
    voltage = np.round(states.voltage / max(states.voltage.max(initial=0.0), 1e-9) * _BINS)
    elapsed = np.round(states.elapsed / max(states.elapsed.max(initial=0.0), 1e-9) * _BINS / 10)
    kind = np.unique(table.kind, return_inverse=True)[1]
    run = np.unique(table.run, return_inverse=True)[1].ravel() * bool(table.noise.common)
    key = np.stack([kind.ravel(), run, table.specimen, table.mass, voltage[table.state],
                    elapsed[table.state], states.way[table.state], states.pattern[table.state],
                    np.where(table.since < 0, -1, table.line)], axis=1)
    _, first, group, count = np.unique(key, axis=0, return_index=True, return_inverse=True,
                                       return_counts=True)
    group = group.ravel()

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(group, values) / count)

    noise = table.noise[first].with_own(np.sqrt(np.bincount(group, table.sigma**2)) / count)
    at = table.state[first]
    merged = replace(states[at], voltage=mean(states.voltage[table.state]),
                     elapsed=mean(states.elapsed[table.state]))
    origin = table.since[first] >= 0
    since = np.full(len(first), -1)
    since[origin] = len(first) + np.arange(int(origin.sum()))
    merged = merged.joined(states[table.since[first][origin]])
    order = np.full(len(first), np.nan)
    if np.isfinite(table.order).all():
        order = mean(table.order)
    fewer = ReadingTable(merged, table.kind[first], np.arange(len(first)), since, mean(table.value),
                         noise, order, table.run[first], table.file[first], table.line[first],
                         table.point[first], table.scans)
    return fewer.reached(np.argsort(np.r_[at, table.since[first][origin]], kind="stable"))
