"""The columns of a dataset's files of readings, and what must hold between them."""

from __future__ import annotations

import numpy as np

from tympan.geometry.toml_reader import FINITE, NON_NEGATIVE, POSITIVE, Rule
from tympan.studies.columns import Column, LabelColumn, NumberColumn, Sheet

_VOLTAGE: Rule = (lambda x: 0 <= x <= 1e6, "must be from 0 to 1000 kV; the film's pull has no sign")
_MASS: Rule = (lambda x: 0 <= x <= 100, "must be from 0 to 100 kg")

#: The column every file but coupon.csv has.
SPECIMEN = LabelColumn("specimen")
_LOAD: tuple[Column, ...] = (SPECIMEN, NumberColumn("mass", "g", "mass", _MASS))
_SIGMA = NumberColumn("sigma", "mm", "length", POSITIVE, required=False)

#: The columns of static.csv. ``run``: which mounting or ramp a reading belongs to; ``direction``:
#: the way the voltage got there; ``sigma``: standard deviation of the displacement;
#: ``film_voltage``: that of a probe on the film; ``tilt``: the plate's.
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
#: The columns of range.csv: largest minus smallest displacement between two voltages; ``sigma`` is
#: that of the range.
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


#: Columns of static.csv with what else may be measured besides the displacement.
_CHANNELS = ("capacitance", "film_voltage", "tilt")


def channels(static: Sheet) -> tuple[str, ...]:
    """What was measured besides the displacement."""
    return tuple(name for name in _CHANNELS if np.isfinite(static[name]).any())


def check_ranges(ranges: Sheet) -> None:
    """Refuse a range.csv with a row whose two voltages do not ascend."""
    for row in np.flatnonzero(ranges.voltage_max <= ranges.voltage_min):
        raise ranges.error(int(row), "voltage_max", "must be above voltage_min")


def check_transients(transients: Sheet) -> None:
    """Refuse a transient.csv in which a time stands twice in a run."""
    lines: dict[tuple[object, ...], int] = {}
    columns = (transients[name].tolist() for name in ("specimen", "mass", "run", "t"))
    for row, state in enumerate(zip(*columns, strict=True)):
        if state in lines:
            raise transients.error(row, "t", "must be there once in a run: it stands in line "
                                             f"{lines[state]} too")
        lines[state] = int(transients.line[row])
