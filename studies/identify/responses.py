"""Responses in time as a dataset has them: what was read, and the voltage behind it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.studies.signals import Pieces, through

_ALONE = 0.1  # of a change of the voltage: neighbours smaller than this share of it make it a jump
_LEVEL = 0.02  # of the whole range: what moves less is noise of a recorded voltage


@dataclass(frozen=True, eq=False)
class ResponseRecord:
    """Displacements read [m] at times [s] of a run of a specimen (by number) and its voltage.

    ``interval`` is the time between two readings as it is most often [s], ``first`` the first of
    them [m].
    """

    specimen: int
    mass: float
    run: str
    time: Array
    displacement: Array
    drive: Pieces
    interval: float
    first: float

    @property
    def begins(self) -> float:
        """Time of the first change of the voltage [s]; the start, where it never changes."""
        points, volts = self.drive.time, self.drive.voltage
        changed = np.flatnonzero(volts != volts[0])
        return float(points[max(int(changed[0]) - 1, 0)] if len(changed) else points[0])

    def calm(self, wait: float) -> ResponseRecord:
        """Record without what was read within so long after a jump of the voltage [s]."""
        points, volts = self.drive.time, self.drive.voltage
        jumps = points[1:][(np.diff(points) == 0) & (np.diff(volts) != 0)]
        since = self.time[:, None] - jumps
        kept = ~((since >= 0) & (since < wait)).any(axis=1)
        return replace(self, time=self.time[kept], displacement=self.displacement[kept])

    def until(self, time: float) -> ResponseRecord:
        kept = self.time <= time
        points, volts = self.drive.time, self.drive.voltage
        inside = points < time
        last = float(volts[-1]) if time >= points[-1] else float(np.interp(time, points, volts))
        drive = Pieces(np.append(points[inside], min(time, points[-1])),
                       np.append(volts[inside], last))
        return replace(self, time=self.time[kept], displacement=self.displacement[kept],
                       drive=drive)


def drive_of(time: Array, voltage: Array) -> Pieces:
    """The voltage behind samples of it: straight lines between them, and jumps.

    A change between two samples is a jump, at the later one, where it is more than 2 % of the
    voltage's range and the voltage changes by less than a tenth of it between the samples before
    and between those after; so a lone step is one, and ramps and sines have none. Between jumps a
    voltage within 2 % of its range is level, at its mean.
    """
    change = np.diff(voltage)
    size = np.abs(change)
    beside = np.maximum(np.append(0.0, size[:-1]), np.append(size[1:], 0.0))
    jump = (size > _LEVEL * np.ptp(voltage)) & (beside < _ALONE * size)
    after = np.flatnonzero(jump) + 1
    level = voltage.copy()
    for part in np.split(np.arange(len(time)), after):
        if np.ptp(voltage[part]) <= _LEVEL * np.ptp(voltage):
            level[part] = voltage[part].mean()
    points, volts = np.insert(time, after, time[after]), np.insert(level, after, level[after - 1])
    return through(points, volts)


def records_of(dataset: Any) -> tuple[ResponseRecord, ...]:
    """The responses of a dataset, one for each specimen, mass and run."""
    table = dataset.transients
    if table is None:
        raise InputError("has no transient.csv: the viscous constants need responses in time",
                         key=dataset.name)
    names = [specimen.name for specimen in dataset.specimens]
    runs = pd.DataFrame(table.values).groupby(["specimen", "mass", "run"], sort=False)
    records = []
    for (name, mass, run), rows in runs:
        if len(rows) < 5:
            raise InputError("must have at least five readings",
                             key=f"transient.csv, {name}, run {run}", given=len(rows))
        ordered = rows.sort_values("t", kind="stable")
        time, voltage, read = ordered[["t", "voltage", "displacement"]].to_numpy().T
        interval = float(np.median(np.diff(time)))
        records.append(ResponseRecord(names.index(name), mass, run, time, read,
                                      drive_of(time, voltage), interval, float(read[0])))
    return tuple(records)
