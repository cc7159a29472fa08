"""A dataset's readings as a table to predict, with their noise."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.studies.columns import Sheet
from tympan.studies.data.checks import (
    at_sensor_end,
    bad_readings,
    clock_runs_back,
    slips_of_sign,
    slips_of_unit,
)
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.noise import coarse_step, range_sigma, reading_sigma, repeat_noise
from tympan.studies.diagnosis.evidence.actuators import ACTUATORS
from tympan.studies.diagnosis.evidence.kind import ASSUMED, FEWEST, PreparedReadings
from tympan.studies.diagnosis.evidence.scans import SCANS, film_rows
from tympan.studies.diagnosis.history import staircase
from tympan.studies.diagnosis.reading_table import Kind, ReadingTable, States, rows
from tympan.studies.diagnosis.transients.block_means import transient_rows
from tympan.studies.effects import Setup
from tympan.studies.estimation.noise import SCATTER, Noise

Array = NDArray[np.float64]

#: Noise of other channels, which no file states, as a share of the largest. No source.
CHANNEL = 0.01
#: Least noise of a tilt [rad]. No source.
TILT = 1e-4

#: Readings above which those of nearly the same state are averaged. A bound of the cost.
MANY = 2000

_BINS = 200


def prepared_readings(dataset: Dataset) -> PreparedReadings:
    """The static readings, ranges, frequencies, transients and scans of films of a dataset.

    An :class:`InputError` when they are too few to conclude anything, nothing loads the film, or a
    column is off by a unit.
    """
    sheets = _sheets(dataset)
    used = {name for sheet in sheets for name in sheet.specimen.tolist()}
    setup = Setup(tuple(specimen for specimen in dataset.specimens if specimen.name in used),
                  dataset.rig)
    _refuse(dataset, sheets)
    parts, remarks = _parts(dataset, setup)
    if sum(map(len, parts)) < FEWEST:
        raise InputError(f"less than {FEWEST} can be used", key="readings",
                         given="; ".join(remarks) or sum(map(len, sheets)))
    table = _with_noise(reduce(ReadingTable.joined, parts), dataset)
    if step := coarse_step(dataset):
        table = _rounded(table, step)
    table, fewer = _not_too_many(table)
    scans, seen = film_rows(replace(dataset, specimens=setup.specimens)) or (None, [])
    if scans is not None:
        table = table.joined(scans)
    return PreparedReadings(setup, table, (ACTUATORS, SCANS), (*remarks, *fewer, *seen))


def _sheets(dataset: Dataset) -> list[Sheet]:
    """The files whose readings are judged."""
    return [sheet for sheet in (dataset.static, dataset.ranges, dataset.frequencies,
                                dataset.transients, dataset.fields) if sheet is not None]


def _refuse(dataset: Dataset, sheets: list[Sheet]) -> None:
    """An :class:`InputError` of readings by which nothing can be concluded."""
    count = sum(map(len, sheets))
    if count < FEWEST:
        raise InputError(f"needs at least {FEWEST} readings in static.csv and range.csv: stiffness "
                         "and permittivity alone take two of them", key="readings", given=count)
    if dataset.static is None and dataset.ranges is None and dataset.transients is None:
        other = "field.csv" if dataset.frequencies is None else "frequency.csv"
        raise InputError(f"must have static.csv or range.csv beside {other}: by that alone no mass "
                         "is told from a stiffness", key=dataset.name)
    masses, rig = np.concatenate([sheet.mass for sheet in sheets]), dataset.rig
    if not (rig.force(masses, 1.0).any() or rig.gas_pressure or rig.biases):
        raise InputError("must be above 0 in some reading: a film that nothing loads stays flat "
                         "under any voltage", key="mass", given="0 g everywhere")
    for slip in (*slips_of_unit(dataset), *slips_of_sign(dataset)):
        raise InputError(slip, key=dataset.name)


def _parts(dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
    """The rows of each file but of scans, and what was done to the readings."""
    numbers = {specimen.name: number for number, specimen in enumerate(setup.specimens)}
    parts: list[ReadingTable] = []
    remarks: list[str] = []
    if dataset.static is not None:
        parts += _static(dataset.static, numbers, reading_sigma(dataset))
        remarks += bad_readings(dataset.static)
    if dataset.ranges is not None:
        parts.append(_ranges(dataset.ranges, numbers, range_sigma(dataset)))
    if dataset.frequencies is not None:
        parts.append(_frequencies(dataset.frequencies, numbers))
    if dataset.transients is not None:
        tables, said = transient_rows(dataset.transients, numbers, dataset.noise, dataset.rig)
        parts += tables
        remarks += said
    return parts, remarks


def _with_noise(table: ReadingTable, dataset: Dataset) -> ReadingTable:
    """With the noise of all rows.

    An :class:`InputError` where readings are still to be made and nobody states their noise.
    """
    planned = bool(np.isnan(table.value).any())
    unknown = np.isnan(table.sigma)
    if not unknown.any():
        repeated = dataset.noise is None and not planned and repeat_noise(dataset) is not None
        return table.with_noise(Noise.of(table.sigma, "from repeats" if repeated else "stated"))
    if planned:
        raise InputError("is needed to plan: the standard deviation of one reading", key="noise",
                         given=None)
    size = ASSUMED * np.sqrt(np.mean(table.value[unknown] ** 2))
    enough = len(table) > 4 * FEWEST
    return table.with_noise(Noise.of(np.where(unknown, size, table.sigma),
                                     SCATTER if enough else "assumed"))


def _not_too_many(table: ReadingTable) -> tuple[ReadingTable, list[str]]:
    """With readings at rest averaged where they are more than :data:`MANY`; a remark on that."""
    resting = ~np.isin(table.state, table.states.passages.rows)
    if resting.sum() <= MANY:
        return table, []
    few = averaged(table[resting].compact())
    remark = f"{resting.sum()} readings were averaged to {len(few)} of nearly the same state"
    return _beside_passages(few, table, resting), [remark]


def _rounded(table: ReadingTable, step: float) -> ReadingTable:
    """With readings of one state, which a display rounds alike, as one, half a step its noise."""
    resting = ~np.isin(table.state, table.states.passages.rows)
    few = averaged(table[resting].compact())
    rounding = np.where(few.kind == "displacement", step / 2, 0.0)
    few = few.with_noise(Noise(np.hypot(few.sigma, rounding), source=few.noise.source))
    return _beside_passages(few, table, resting)


def _beside_passages(few: ReadingTable, table: ReadingTable, resting: NDArray[np.bool_]
                     ) -> ReadingTable:
    """What was made of the rows at rest, with the others of the table as they are."""
    return few if resting.all() else few.joined(table[~resting].compact())


def _static(readings: Sheet, numbers: dict[str, int], sigma: Array) -> list[ReadingTable]:
    direction = (readings.direction == "up") * 1.0 - (readings.direction == "down")
    elapsed = np.nan_to_num(readings.elapsed) * (clock_runs_back(readings) is None)
    states = States.of([numbers[name] for name in readings.specimen.tolist()], readings.mass,
                       readings.voltage, elapsed, direction,
                       np.unique(readings.run, return_inverse=True)[1])
    ordered = np.isfinite(readings.order).all()
    turn = np.argsort(readings.order, kind="stable") if ordered else np.arange(len(readings))
    states = _held(states, readings.dwell, turn)
    origin = readings.order, readings.run, readings.file.name, readings.line
    seen = ~at_sensor_end(readings)
    tables = [rows(states, "displacement", sigma, readings.displacement, *origin)[seen]]
    kinds: tuple[Kind, ...] = ("capacitance", "film_voltage", "tilt")
    for kind in kinds:
        values = readings[kind]
        if (seen := np.isfinite(values)).any():
            noise = CHANNEL * float(np.abs(values).max(where=seen, initial=0.0))
            if kind == "tilt":
                noise = max(noise, TILT)
                # Whichever way; but noise about 0 keeps its sign, or it would look like a tilt.
                values = np.where(np.abs(values) > 3 * noise, np.abs(values), values)
            tables.append(rows(states, kind, noise, values, *origin)[seen])
    if ordered:
        tables = [table.reached(turn) for table in tables]
    return tables


def _held(states: States, dwell: Array, turn: NDArray[np.int64]) -> States:
    """With what each state's run went through before it, where all say how long they were held."""
    passage = states.passage.copy()
    for run in states[turn].of_run:
        reached = turn[run]
        if np.isfinite(dwell[reached]).all():
            passage[reached] = staircase(states.voltage[reached], dwell[reached])
    return replace(states, passage=passage)


def _ranges(ranges: Sheet, numbers: dict[str, int], sigma: Array) -> ReadingTable:
    # From the lowest voltage to the highest one.
    specimen = np.array([numbers[name] for name in ranges.specimen.tolist()] * 2)
    mass, voltage = np.tile(ranges.mass, 2), np.r_[ranges.voltage_min, ranges.voltage_max]
    states = States.of(specimen, mass, voltage, run=np.tile(np.arange(len(ranges)), 2))
    states = _held(states, np.tile(ranges.dwell, 2), np.arange(len(states)))
    table = rows(states[len(ranges) + np.arange(len(ranges))], "range", sigma, ranges.range,
                 file=ranges.file.name, line=ranges.line)
    return replace(table, states=states, state=len(ranges) + table.state, since=table.state)


def _frequencies(read: Sheet, numbers: dict[str, int]) -> ReadingTable:
    # Damping of quality Q moves a peak by 1/(4 Q²) of its frequency.
    quality = np.nan_to_num(read.quality, nan=np.inf)
    share = np.maximum(CHANNEL, 0.25 / quality**2)
    sigma = np.where(np.isnan(read.sigma), share * read.frequency, read.sigma)
    states = States.of([numbers[name] for name in read.specimen.tolist()], read.mass, read.voltage,
                       run=np.arange(len(read)))
    return rows(states, "frequency", sigma, read.frequency, file=read.file.name, line=read.line)


def averaged(table: ReadingTable) -> ReadingTable:
    """Rows of nearly the same state as one, with the mean of what they say and its noise.

    States are nearly the same within a two-hundredth of the voltages and a twentieth of the times,
    reached the same way.
    """
    states = table.states
    voltage = np.round(states.voltage / max(states.voltage.max(initial=0.0), 1e-9) * _BINS)
    elapsed = np.round(states.elapsed / max(states.elapsed.max(initial=0.0), 1e-9) * _BINS / 10)
    kind = np.unique(table.kind, return_inverse=True)[1]
    key = np.stack([kind.ravel(), table.specimen, table.mass, voltage[table.state],
                    elapsed[table.state], states.way[table.state],
                    np.where(table.since < 0, -1, table.line)], axis=1)
    _, first, group, count = np.unique(key, axis=0, return_index=True, return_inverse=True,
                                       return_counts=True)
    group = group.ravel()

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(group, values) / count)

    noise = table.noise[first].with_sigma(np.sqrt(np.bincount(group, table.sigma**2)) / count)
    at = table.state[first]
    merged = States(states.specimen[at], states.mass[at], mean(states.voltage[table.state]),
                    mean(states.elapsed[table.state]), states.direction[at], states.heave[at],
                    states.run[at], states.passage[at])
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
