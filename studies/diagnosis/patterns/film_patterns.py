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
    typical = float(np.sqrt(np.mean(predicted**2))) or float(table.sigma.max())
    parts = []
    for number in np.unique(table.scan):
        rows = np.flatnonzero(table.scan == number)
        scan, point = table.scans[number], table.point[rows] - table.first_points[number]
        everywhere = np.zeros(len(scan))
        everywhere[point] = predicted[rows]
        within = _columns(scan, everywhere)[point]
        columns = np.zeros((len(table), within.shape[1]))
        columns[rows] = typical * within * len(rows) ** 0.5
        parts.append(columns)
    return np.hstack(parts)


def _columns(scan: Scan, predicted: Array) -> Array:
    """Columns of one scan as long as a typical prediction, without its zero."""
    place = scan.place / np.abs(scan.place).max()
    basis = legendre.legvander2d(place[:, 0], place[:, 1], (_DEGREE, _DEGREE))
    degree = np.add.outer(np.arange(_DEGREE + 1), np.arange(_DEGREE + 1)).ravel()
    slopes = np.column_stack([np.ones(len(place)), place])
    columns = np.hstack([basis[:, degree <= _DEGREE], scan.on_plate[:, None] * slopes,
                         predicted[:, None] * slopes / max(np.abs(predicted).max(), 1e-300)])
    within, sizes, _ = np.linalg.svd(scan.without_zero(columns.T).T, full_matrices=False)
    most = min(int(np.sum(sizes > 1e-3 * sizes[0])), max(int(_MOST * len(place)), 1))
    return np.asarray(within[:, :most])
