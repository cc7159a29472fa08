"""Ratios of strokes between specimens and between masses, measured and simulated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.result import Ratio

#: A stroke, measured and simulated, and the standard deviation of the measured one [m].
Stroke = tuple[float, float, float]


def ratios(table: ReadingTable, predicted: Array, names: Sequence[str]) -> list[Ratio]:
    """Compute ratios to the first specimen under the same mass, and to a specimen's least mass.

    A stroke is a range, or the mean reading at the largest voltage minus that at the smallest one.
    """
    strokes = _strokes(table, predicted)
    masses = sorted({mass for _, mass in strokes})
    first = min((number for number, _ in strokes), default=0)
    between = [_ratio("shape", f"{names[number]} over {names[first]} at {1e3 * mass:.4g} g",
                      strokes[number, mass], strokes[first, mass])
               for mass in masses for number, other in sorted(strokes)
               if other == mass and number != first and (first, mass) in strokes]
    loads = [_ratio("mass", f"{1e3 * mass:.4g} g over {1e3 * masses[0]:.4g} g, {names[number]}",
                    strokes[number, mass], strokes[number, masses[0]])
             for number, mass in sorted(strokes)
             if mass != masses[0] and (number, masses[0]) in strokes]
    return [*between, *loads]


def _ratio(kind: Literal["shape", "mass"], what: str, stroke: Stroke, base: Stroke) -> Ratio:
    (read, simulated, sigma), (base_read, base_simulated, base_sigma) = stroke, base
    ratio, expected = read / base_read, simulated / base_simulated
    noise = abs(ratio) * float(np.hypot(sigma / read, base_sigma / base_read))
    return Ratio(kind=kind, what=what, read=ratio, simulated=expected, noise=noise,
                 off_by_noise=(expected - ratio) / noise)


def _strokes(table: ReadingTable, predicted: Array) -> dict[tuple[int, float], Stroke]:
    """Compute strokes by specimen and mass, without those too small to divide by."""
    strokes = {}
    for number in np.unique(table.ramp):
        ramp = table.ramp == number
        ranges, rows = (ramp & (table.kind == kind) for kind in ("range", "displacement"))
        if ranges.any():
            read, simulated, sigma = _mean(table, predicted, ranges)
        elif rows.any() and np.ptp(table.voltage[rows]) > 0:
            (read, simulated, sigma), rest = (
                _mean(table, predicted, rows & (table.voltage == end))
                for end in (table.voltage[rows].max(), table.voltage[rows].min()))
            read, simulated = read - rest[0], simulated - rest[1]
            sigma = float(np.hypot(sigma, rest[2]))
        else:
            continue
        if read > 5 * sigma and simulated > 0:
            strokes[int(table.specimen[ramp][0]), float(table.mass[ramp][0])] = (
                read, simulated, sigma)
    return strokes


def _mean(table: ReadingTable, predicted: Array, rows: Mask) -> Stroke:
    """Compute means over some rows, and the standard deviation of the measured one."""
    return (float(table.value[rows].mean()), float(predicted[rows].mean()),
            float(np.sqrt(np.sum(table.sigma[rows]**2)) / rows.sum()))
