"""Smooth columns over the film, by which misfits of its shape are told from noise."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from tympan.studies.diagnosis.reading_table import ReadingTable, Scan

Array = NDArray[np.float64]

#: Degree of the polynomials in the place. Set by trial.
_DEGREE = 5
#: Share of a scan's readings that columns may take: the others must tell the noise.
_MOST = 0.34


def film_patterns(table: ReadingTable, predicted: Array) -> Array:
    """Columns of all the scans of a table that has nothing else, shape (rows, columns).

    Of each scan polynomials in the place, of their own on the plate, and what is ``predicted`` [m]
    times the place: films that are off have a kink at the plate's edge, too.
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
        most = min(int(np.sum(sizes > 1e-3 * sizes[0])), max(int(_MOST * len(rows)), 1))
        size = typical * len(rows) ** 0.5 / table.sigma[rows, None]
        within = np.zeros((len(table), most))
        within[rows] = noise.coloured(size * columns[:, :most])
        parts.append(within)
    return np.hstack(parts)


def _columns(scan: Scan, point: NDArray[np.int64], predicted: Array) -> Array:
    """Columns of some places of one scan."""
    place = scan.place[point] / np.abs(scan.place).max()
    basis = legendre.legvander2d(place[:, 0], place[:, 1], (_DEGREE, _DEGREE))
    degree = np.add.outer(np.arange(_DEGREE + 1), np.arange(_DEGREE + 1)).ravel()
    slopes = np.column_stack([np.ones(len(place)), place])
    return np.hstack([basis[:, degree <= _DEGREE], scan.on_plate[point, None] * slopes,
                      predicted[:, None] * slopes / max(np.abs(predicted).max(), 1e-300)])
