"""Ratios of strokes between specimens and between masses, as read and as simulated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.reading_table import ReadingTable

Array = NDArray[np.float64]


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


@dataclass(frozen=True)
class _Stroke:
    read: float
    simulated: float
    sigma: float


def ratios(table: ReadingTable, predicted: Array, names: Sequence[str]) -> tuple[Ratio, ...]:
    """Ratios to the first specimen under the same mass, and to the specimen's smallest mass.

    A stroke is a range, or the mean reading at the largest voltage less that at the smallest one.
    """
    strokes = _strokes(table, predicted)
    masses = sorted({mass for _, mass in strokes})
    first = min((number for number, _ in strokes), default=0)
    return tuple(_shapes(strokes, masses, first, names)) + tuple(_masses(strokes, masses, names))


def _shapes(strokes: dict[tuple[int, float], _Stroke], masses: list[float], first: int,
            names: Sequence[str]
            ) -> Iterator[Ratio]:
    for mass in masses:
        base = strokes.get((first, mass))
        for (number, own), stroke in sorted(strokes.items()):
            if base is not None and own == mass and number != first:
                yield _ratio("shape", f"{names[number]} over {names[first]} at {1e3 * mass:.4g} g",
                             stroke, base)


def _masses(strokes: dict[tuple[int, float], _Stroke], masses: list[float],
            names: Sequence[str]) -> Iterator[Ratio]:
    for (number, mass), stroke in sorted(strokes.items()):
        base = strokes.get((number, masses[0]))
        if base is not None and mass != masses[0]:
            yield _ratio("mass",
                         f"{1e3 * mass:.4g} g over {1e3 * masses[0]:.4g} g, {names[number]}",
                         stroke, base)


def _ratio(kind: str, what: str, one: _Stroke, base: _Stroke) -> Ratio:
    read = one.read / base.read
    noise = abs(read) * float(np.hypot(one.sigma / one.read, base.sigma / base.read))
    return Ratio(kind, what, read, one.simulated / base.simulated, noise)


def _strokes(table: ReadingTable, predicted: Array) -> dict[tuple[int, float], _Stroke]:
    """Strokes by specimen and mass, those too small to divide by left out."""
    found = {}
    for number, mass in {(int(s), float(m)) for s, m in zip(table.specimen, table.mass,
                                                            strict=True)}:
        own = (table.specimen == number) & (table.mass == mass)
        stroke = _range(table, predicted, own) or _swing(table, predicted, own)
        if stroke is not None and stroke.read > 5 * stroke.sigma and stroke.simulated > 0:
            found[number, mass] = stroke
    return found


def _range(table: ReadingTable, predicted: Array, own: NDArray[np.bool_]) -> _Stroke | None:
    rows = own & (table.kind == "range")
    if not rows.any():
        return None
    return _Stroke(float(table.value[rows].mean()), float(predicted[rows].mean()),
                   _mean_sigma(table.sigma[rows]))


def _swing(table: ReadingTable, predicted: Array, own: NDArray[np.bool_]) -> _Stroke | None:
    rows = own & (table.kind == "displacement")
    voltage = table.voltage
    if not rows.any() or np.ptp(voltage[rows]) == 0:
        return None
    top, rest = (rows & (voltage == end) for end in (voltage[rows].max(), voltage[rows].min()))
    sigma = float(np.hypot(_mean_sigma(table.sigma[top]), _mean_sigma(table.sigma[rest])))
    read, simulated = (float(values[top].mean() - values[rest].mean())
                       for values in (table.value, predicted))
    return _Stroke(read, simulated, sigma)


def _mean_sigma(sigma: Array) -> float:
    """Standard deviation of a mean."""
    return float(np.sqrt(np.sum(sigma**2)) / len(sigma))
