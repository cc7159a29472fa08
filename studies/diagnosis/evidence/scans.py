"""Scans as evidence: displacements over the film, from laser line or digital image correlation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import reduce

import numpy as np
from numpy.polynomial import legendre

from tympan.base.arrays import Array, Numbers
from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import Dataset
from tympan.studies.data.ramps import groups
from tympan.studies.diagnosis.evidence.kind import FilmsUnderLoads, PlateEvidence, numbers_of
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.patterns.reading_patterns import among
from tympan.studies.diagnosis.reading_table import (
    ReadingTable,
    Scan,
    States,
    evenly_chosen,
    rows,
)
from tympan.studies.effects import Setup
from tympan.studies.effects.effect import Observable
from tympan.studies.estimation.noise import Noise, Shared

#: Kinds of rows: the components of displacements at places, deflections last.
COMPONENTS = ("film_x", "film_y", "film")

#: Standard deviation of the zero of a scan [m]: nobody aligns the zero of a laser line with that of
#: the displacement sensor.
ZERO = 1e-3

#: Most places of a scan that are used; those between add little.
MOST = 250

#: Noise that is neither stated nor seen in repeats, as a share of a scan's largest reading.
_ASSUMED = 0.01

#: Degree of the polynomials in the place. Set by trial.
_DEGREE = 5
#: Largest share of a scan's readings that columns may take: the others must determine the noise.
_COLUMNS = 0.34


class Scans(PlateEvidence):
    """Displacements at places of films, under loaded plates."""

    files = ("field.csv",)
    kinds = COMPONENTS
    noisy = True

    def read(self, dataset: Dataset, setup: Setup) -> tuple[list[ReadingTable], list[str]]:
        """Read the rows, one for each component at a place."""
        sheet = dataset.fields
        if sheet is None:
            return [], []
        sigma, remarks = _sigma(dataset, sheet), []
        tables = []
        for scan in _scans(sheet):
            kept = evenly_chosen(scan, MOST)
            if len(kept) < len(scan):
                remarks.append(f"field.csv line {sheet.line[scan[0]]} and on: {len(kept)} of "
                               f"{len(scan)} places of the scan are used")
            tables.append(_rows(dataset, setup, sheet, kept, sigma))
        return tables, remarks

    def shown(self, films: FilmsUnderLoads, kind: str, rows: Numbers, deflection: Array) -> Array:
        table, shown = films.table, np.empty(len(rows))
        for number in np.unique(table.scan[rows]):
            mine = table.scan[rows] == number
            values = films.scanned(int(number), int(table.state[rows[mine][0]]), deflection)
            point = table.point[rows[mine]] - table.first_points[number]
            shown[mine] = values[COMPONENTS.index(kind), point]
        return shown

    def patterns(self, table: ReadingTable, names: Sequence[str], predicted: Array
                 ) -> dict[str, Array]:
        return {f"channel {kind}": among(table.kind == kind,
                                         film_patterns(table[rows], predicted[rows]))
                for kind, rows in table.rows_of.items()}

    def observables(self, table: ReadingTable) -> set[Observable]:
        return {Observable.SHAPE} if table.scans else set()

    def feels(self, cause: Cause, setup: Setup, table: ReadingTable) -> bool:
        scanned = np.unique(table.specimen[table.scan >= 0])
        names = {setup.specimens[number].name for number in scanned}
        return Observable.SHAPE not in cause.effect.shows_in or cause.specimen in (None, *names)


def film_patterns(table: ReadingTable, predicted: Array) -> Array:
    """Build the pattern columns of all scans of a table with nothing else, shape (rows, columns).

    Each scan has polynomials in the place, separate ones on the plate, and the ``predicted`` values
    [m] times the place: deviating films also have a kink at the plate's edge.
    """
    predicted = table.noise.apart(predicted)
    typical = float(np.sqrt(np.mean(predicted**2))) or float(table.sigma.max())
    parts = []
    for number in np.unique(table.scan):
        rows = np.flatnonzero(table.scan == number)
        scan, noise = table.scans[number], table.noise[rows]
        point = table.point[rows] - table.first_points[number]
        columns, sizes, _ = np.linalg.svd(noise.apart(_columns(scan, point, predicted[rows])),
                                          full_matrices=False)
        most = min(int(np.sum(sizes > 1e-3 * sizes[0])), max(int(_COLUMNS * len(rows)), 1))
        size = typical * len(rows) ** 0.5 / table.sigma[rows, None]
        within = np.zeros((len(table), most))
        within[rows] = noise.coloured(size * columns[:, :most])
        parts.append(within)
    return np.hstack(parts)


def _scans(sheet: Sheet) -> Iterator[Numbers]:
    """Yield the rows of each scan: one specimen, mass, voltage, repeat and method."""
    scan = groups(*(sheet[name] for name in ("specimen", "mass", "voltage", "repeat")),
                  *(np.isfinite(sheet[name]) for name in ("u", "v")))
    yield from (np.flatnonzero(scan == number) for number in range(1 + scan.max(initial=-1)))


def _rows(dataset: Dataset, setup: Setup, sheet: Sheet, scan: Numbers, sigma: Array
          ) -> ReadingTable:
    """Build the rows of one scan."""
    number, = numbers_of(setup, sheet.specimen[scan[:1]])
    place = np.stack([sheet.x[scan], sheet.y[scan]], axis=1)
    plate = setup.specimens[number].needed_plate()
    centred = dataset.field_frame == "plate"
    on_plate = (plate.outline if centred else plate).level(*place.T) <= 0
    kinds = [(kind, column) for kind, column in zip(COMPONENTS, ("u", "v", "displacement"),
                                                    strict=True)
             if np.isfinite(sheet[column][scan[0]])]
    read = Scan(place, len(kinds) > 1, on_plate, centred)
    state = States.of([number], sheet.mass[scan[:1]], sheet.voltage[scan[:1]])
    states = state[np.zeros(len(scan), dtype=np.int64)]
    zero = Shared.zero(len(scan), ZERO)
    noise = Noise(sigma[scan], (zero,), given=~np.isnan(sheet.sigma[scan]))
    parts = [rows(states, kind, 0.0, sheet[column][scan], file="field.csv", line=sheet.line[scan])
             .with_noise(noise) for kind, column in kinds]
    table = reduce(ReadingTable.joined, parts)
    return replace(table, states=state, state=np.zeros(len(table), dtype=np.int64), scans=(read,),
                   point=np.tile(np.arange(len(scan)), len(parts)))


def _sigma(dataset: Dataset, sheet: Sheet) -> Array:
    """Find each reading's standard deviation [m]: stated, from repeats, or assumed."""
    scans = list(_scans(sheet))
    level = np.empty(len(sheet))
    assumed = np.empty(len(sheet))
    for scan in scans:
        values = sheet.displacement[scan]
        level[scan] = values - values.mean()
        assumed[scan] = _ASSUMED * max(float(np.abs(values).max()), 1e-6)
    places = groups(*(sheet[name] for name in ("specimen", "mass", "voltage", "x", "y")))
    repeated = Noise.pooled(level, places)
    rest = assumed if dataset.noise is None else np.full(len(sheet), dataset.noise)
    if repeated is not None and repeated.size > 0:
        rest = np.full(len(sheet), repeated.size)
    return np.where(np.isnan(sheet.sigma), rest, sheet.sigma)


def _columns(scan: Scan, point: Numbers, predicted: Array) -> Array:
    """Build the columns of some places of one scan."""
    place = scan.place[point] / np.abs(scan.place).max()
    basis = legendre.legvander2d(place[:, 0], place[:, 1], (_DEGREE, _DEGREE))
    degree = np.add.outer(np.arange(_DEGREE + 1), np.arange(_DEGREE + 1)).ravel()
    slopes = np.column_stack([np.ones(len(place)), place])
    return np.hstack([basis[:, degree <= _DEGREE], scan.on_plate[point, None] * slopes,
                      predicted[:, None] * slopes / max(np.abs(predicted).max(), 1e-300)])
