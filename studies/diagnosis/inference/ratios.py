"""Ratios of strokes between specimens and between masses, as read and as simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.reading_table import ReadingTable

Array = NDArray[np.float64]

#: A stroke as read and as simulated, and the standard deviation of the one read [m].
Stroke = tuple[float, float, float]


@dataclass(frozen=True)
class Ratio:
    """A stroke over another one; ``noise`` is the standard deviation of the one read."""

    kind: str
    what: str
    read: float
    simulated: float
    noise: float

    @property
    def off(self) -> float:
        """How far the simulation is off, in standard deviations of the noise."""
        return (self.simulated - self.read) / self.noise


def ratios(table: ReadingTable, predicted: Array, names: Sequence[str]) -> tuple[Ratio, ...]:
    """Ratios to the first specimen under the same mass, and to the specimen's smallest mass.

    A stroke is a range, or the mean reading at the largest voltage less that at the smallest one.
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
    return (*between, *loads)


def _ratio(kind: str, what: str, stroke: Stroke, base: Stroke) -> Ratio:
    (read, simulated, sigma), (base_read, base_simulated, base_sigma) = stroke, base
    ratio = read / base_read
    noise = abs(ratio) * float(np.hypot(sigma / read, base_sigma / base_read))
    return Ratio(kind, what, ratio, simulated / base_simulated, noise)


def _strokes(table: ReadingTable, predicted: Array) -> dict[tuple[int, float], Stroke]:
    """Strokes by specimen and mass, those too small to divide by left out."""
    strokes = {}
    for number, mass in {(int(s), float(m)) for s, m in zip(table.specimen, table.mass,
                                                            strict=True)}:
        ramp = (table.specimen == number) & (table.mass == mass)
        stroke = _range(table, predicted, ramp) or _swing(table, predicted, ramp)
        if stroke is not None and stroke[0] > 5 * stroke[2] and stroke[1] > 0:
            strokes[number, mass] = stroke
    return strokes


def _range(table: ReadingTable, predicted: Array, ramp: NDArray[np.bool_]) -> Stroke | None:
    rows = ramp & (table.kind == "range")
    if not rows.any():
        return None
    return (float(table.value[rows].mean()), float(predicted[rows].mean()),
            _mean_sigma(table.sigma[rows]))


def _swing(table: ReadingTable, predicted: Array, ramp: NDArray[np.bool_]) -> Stroke | None:
    rows = ramp & (table.kind == "displacement")
    voltage = table.voltage
    if not rows.any() or np.ptp(voltage[rows]) == 0:
        return None
    top, rest = (rows & (voltage == end) for end in (voltage[rows].max(), voltage[rows].min()))
    read, simulated = (float(values[top].mean() - values[rest].mean())
                       for values in (table.value, predicted))
    sigma = float(np.hypot(_mean_sigma(table.sigma[top]), _mean_sigma(table.sigma[rest])))
    return read, simulated, sigma


def _mean_sigma(sigma: Array) -> float:
    """Standard deviation of a mean."""
    return float(np.sqrt(np.sum(sigma**2)) / len(sigma))
