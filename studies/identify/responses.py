"""Responses in time from a dataset: the readings, and their voltage."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.studies.signals import Pieces, through

#: Largest change of the voltage beside a jump, over the jump.
_ALONE = 0.1
#: Smallest change of the voltage, over its range: smaller changes are noise of a recorded voltage.
_LEVEL = 0.02


@dataclass(frozen=True, eq=False)
class ResponseRecord:
    """Displacements read [m] at times [s] of a run of a specimen (by number), and its voltage.

    ``interval`` is the median time between two readings [s], ``first`` the first reading [m].
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
        """Leave out the readings within a time [s] after each jump of the voltage."""
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
    """Find the voltage behind its samples: straight lines between them, and jumps.

    A change between two samples is a jump, at the later sample, under two conditions. It is more
    than 2 % of the voltage's range, and the voltage changes by less than a tenth of it between the
    samples before and between those after. So a lone step is a jump, and ramps and sines have no
    jumps. Between jumps a voltage within 2 % of its range is level, at its mean.
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
    """Read the responses of a dataset, one for each specimen, mass and run."""
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
