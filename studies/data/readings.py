"""What a dataset's files of readings hold: their columns, and the readings in SI."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.toml_reader import FINITE, NON_NEGATIVE, POSITIVE, Rule
from tympan.studies.columns import Column, LabelColumn, NumberColumn, Sheet

Array = NDArray[np.float64]
Texts = NDArray[np.str_]
Lines = NDArray[np.int64]

_VOLTAGE: Rule = (lambda x: 0 <= x <= 1e6, "must be from 0 to 1000 kV; the film's pull has no sign")
_MASS: Rule = (lambda x: 0 <= x <= 100, "must be from 0 to 100 kg")

#: The column every file but coupon.csv has.
SPECIMEN = LabelColumn("specimen")
_LOAD: tuple[Column, ...] = (SPECIMEN, NumberColumn("mass", "g", "mass", _MASS))
_SIGMA = NumberColumn("sigma", "mm", "length", POSITIVE, required=False)

#: The columns of static.csv; ``run``: which mounting or ramp a reading belongs to.
STATIC: tuple[Column, ...] = (
    *_LOAD,
    NumberColumn("voltage", "kV", "voltage", _VOLTAGE),
    NumberColumn("displacement", "mm", "length"),
    LabelColumn("run", required=False),
    LabelColumn("repeat", required=False),
    NumberColumn("order", required=False),
    NumberColumn("elapsed", "s", "time", required=False),
    LabelColumn("direction", ("up", "down"), required=False),
    _SIGMA,
    NumberColumn("capacitance", "pF", "capacitance", POSITIVE, required=False),
    NumberColumn("film_voltage", "kV", "voltage", _VOLTAGE, required=False),
    NumberColumn("tilt", "mrad", "angle", FINITE, required=False),
)
#: The columns of range.csv; ``sigma`` is that of the range.
RANGE: tuple[Column, ...] = (
    *_LOAD,
    NumberColumn("voltage_min", "kV", "voltage", _VOLTAGE),
    NumberColumn("voltage_max", "kV", "voltage", _VOLTAGE),
    NumberColumn("range", "mm", "length", NON_NEGATIVE),
    _SIGMA,
)
#: The columns of transient.csv.
TRANSIENT: tuple[Column, ...] = (
    *_LOAD,
    LabelColumn("run"),
    NumberColumn("t", "s", "time"),
    NumberColumn("voltage", "kV", "voltage", _VOLTAGE),
    NumberColumn("displacement", "mm", "length"),
)


@dataclass(frozen=True, eq=False)
class StaticReadings:
    """Readings at rest, one entry per row of static.csv, SI; nan or "" where a file does not say.

    ``sigma`` is the standard deviation of a reading of the displacement [m], ``film_voltage`` that
    of a probe on the film [V], ``tilt`` the plate's [rad]; ``direction`` is "up" or "down", the way
    the voltage got there.
    """

    specimen: Texts
    mass: Array
    voltage: Array
    displacement: Array
    run: Texts
    repeat: Texts
    order: Array
    elapsed: Array
    direction: Texts
    sigma: Array
    capacitance: Array
    film_voltage: Array
    tilt: Array
    line: Lines

    def __len__(self) -> int:
        return len(self.line)

    @property
    def channels(self) -> tuple[str, ...]:
        """What was measured besides the displacement."""
        further = ("capacitance", "film_voltage", "tilt")
        return tuple(name for name in further if np.isfinite(getattr(self, name)).any())


@dataclass(frozen=True, eq=False)
class Ranges:
    """Ranges of motion, one entry per row of range.csv, SI.

    Largest minus smallest displacement between two voltages.

    ``sigma`` is the standard deviation of a range [m], nan where the file does not say.
    """

    specimen: Texts
    mass: Array
    voltage_min: Array
    voltage_max: Array
    range: Array
    sigma: Array
    line: Lines

    def __len__(self) -> int:
        return len(self.line)


@dataclass(frozen=True, eq=False)
class Transients:
    """Readings in time, one entry per row of transient.csv, SI, in the file's order."""

    specimen: Texts
    mass: Array
    run: Texts
    time: Array
    voltage: Array
    displacement: Array
    line: Lines

    def __len__(self) -> int:
        return len(self.line)


def static_from_sheet(sheet: Sheet) -> StaticReadings:
    """The readings of a static.csv."""
    return StaticReadings(**_columns(sheet, STATIC), line=sheet.line)


def ranges_from_sheet(sheet: Sheet) -> Ranges:
    """The readings of a range.csv; the two voltages of a row must ascend."""
    for row in np.flatnonzero(sheet["voltage_max"] <= sheet["voltage_min"]):
        raise sheet.error(int(row), "voltage_max", "must be above voltage_min")
    return Ranges(**_columns(sheet, RANGE), line=sheet.line)


def transients_from_sheet(sheet: Sheet) -> Transients:
    """The readings of a transient.csv; a time stands once in a run."""
    columns = _columns(sheet, TRANSIENT)
    seen: dict[tuple[object, ...], int] = {}
    for row, key in enumerate(zip(*(columns[name].tolist()
                                    for name in ("specimen", "mass", "run", "t")), strict=True)):
        if key in seen:
            raise sheet.error(row, "t",
                              "must be there once in a run: it stands in line "
                              f"{sheet.line[seen[key]]} too")
        seen[key] = row
    return Transients(time=columns.pop("t"), **columns, line=sheet.line)


def _columns(sheet: Sheet, names: Iterable[Column]) -> dict[str, Any]:
    return {column.name: sheet[column.name] for column in names}
