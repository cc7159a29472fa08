"""Readings over the film, from a laser line or image correlation, as rows of the table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import Dataset
from tympan.studies.diagnosis.reading_table import (
    COMPONENTS,
    ReadingTable,
    Scan,
    States,
    evenly,
    rows,
)
from tympan.studies.estimation.noise import Noise

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

#: What a scan as a whole may be off by, as a standard deviation [m]: nobody sets the zero of a
#: line to that of the displacement sensor.
ZERO = 1e-3

#: Places of a scan that are read, at most; those between say little more.
MOST = 250

#: Noise that nobody states and no repeat shows, as a share of the largest reading of a scan.
_ASSUMED = 0.01


def film_rows(dataset: Dataset) -> tuple[ReadingTable, list[str]] | None:
    """Rows of field.csv, one for each component read at a place, and what was done to them.

    None without such a file. States have the numbers of the dataset's specimens.
    """
    sheet = dataset.fields
    if sheet is None:
        return None
    sigma, remarks = _sigma(dataset, sheet), []
    tables = []
    for scan in _scans(sheet):
        kept = evenly(scan, MOST)
        if len(kept) < len(scan):
            remarks.append(f"field.csv line {sheet.line[scan[0]]} and on: {len(kept)} of "
                           f"{len(scan)} places of the scan are used")
        tables.append(_rows(dataset, sheet, kept, sigma))
    return reduce(ReadingTable.joined, tables), remarks


def _scans(sheet: Sheet) -> Iterator[Numbers]:
    """The rows of each scan: of one specimen, mass and voltage, in one repeat, read alike."""
    alike = [sheet[name].tolist() for name in ("specimen", "mass", "voltage", "repeat")]
    alike += [np.isfinite(sheet[name]).tolist() for name in ("u", "v")]
    scans: dict[tuple[object, ...], list[int]] = {}
    for row, key in enumerate(zip(*alike, strict=True)):
        scans.setdefault(key, []).append(row)
    yield from map(np.array, scans.values())


def _rows(dataset: Dataset, sheet: Sheet, scan: Numbers, sigma: Array) -> ReadingTable:
    """The rows of one scan."""
    number = [specimen.name for specimen in dataset.specimens].index(str(sheet.specimen[scan[0]]))
    place = np.stack([sheet.x[scan], sheet.y[scan]], axis=1)
    plate = dataset.specimens[number].needed_plate()
    centred = dataset.field_frame == "plate"
    on_plate = (plate.outline if centred else plate).level(*place.T) <= 0
    kinds = [(kind, column) for kind, column in zip(COMPONENTS, ("u", "v", "displacement"),
                                                    strict=True)
             if np.isfinite(sheet[column][scan[0]])]
    read = Scan(place, len(kinds) > 1, on_plate, centred)
    state = States.of([number], sheet.mass[scan[:1]], sheet.voltage[scan[:1]])
    states = state[np.zeros(len(scan), dtype=np.int64)]
    noise = Noise(sigma[scan]).with_zero(ZERO)
    parts = [rows(states, kind, 0.0, sheet[column][scan], file="field.csv", line=sheet.line[scan])
             .with_noise(noise) for kind, column in kinds]
    table = reduce(ReadingTable.joined, parts)
    return replace(table, states=state, state=np.zeros(len(table), dtype=np.int64), scans=(read,),
                   point=np.tile(np.arange(len(scan)), len(parts)))


def _sigma(dataset: Dataset, sheet: Sheet) -> Array:
    """Standard deviation of each reading [m]: its own, of repeats, the dataset's, or assumed."""
    scans = list(_scans(sheet))
    level = np.empty(len(sheet))
    assumed = np.empty(len(sheet))
    for scan in scans:
        values = sheet.displacement[scan]
        level[scan] = values - values.mean()
        assumed[scan] = _ASSUMED * max(float(np.abs(values).max()), 1e-6)
    keys = zip(*(sheet[name].tolist() for name in ("specimen", "mass", "voltage", "x", "y")),
               strict=True)
    group: dict[tuple[object, ...], int] = {}
    place = np.array([group.setdefault(key, len(group)) for key in keys])
    repeated = Noise.pooled(level, place)
    rest = assumed if dataset.noise is None else np.full(len(sheet), dataset.noise)
    if repeated is not None and repeated.size > 0:
        rest = np.full(len(sheet), repeated.size)
    return np.where(np.isnan(sheet.sigma), rest, sheet.sigma)
