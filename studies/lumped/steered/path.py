"""Paths of a plate: wanted deflection and tilts at the samples of a controller."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.units import LEAST_STEP
from tympan.studies.columns import Column, read_sheet
from tympan.studies.trace import sample_count
from tympan.tables.meanings import TIMES

#: Fewest samples of a turn: with fewer, a voltage that holds for a sample turns the plate by more
#: than 45°.
_FEWEST = 8


@dataclass(frozen=True, eq=False)
class SteeredPath:
    """Wanted places at ``time`` [s]: deflection [m], tilt_x and tilt_y [rad], (samples + 1, 3).

    The last one is wanted at the end of the last sample. ``first``: number of the first sample
    that is judged; ``period``: samples of a turn of a circle, None for another path.
    """

    time: Array
    wanted: Array
    first: int = 0
    period: int | None = None

    @property
    def now(self) -> Array:
        """Places wanted at the samples."""
        return self.wanted[:-1]

    @property
    def late(self) -> slice:
        """Samples that are judged."""
        return slice(self.first, None)

    def spread(self, most: int) -> Array:
        """Choose at most so many of the judged places, evenly; of a circle those of a turn."""
        places = self.now[self.late]
        if self.period is not None:
            places = places[:self.period]
        return places[np.unique(np.arange(most) * len(places) // most)]


def circle_path(centre: Array, radius: float, frequency: float, turns: float, interval: float
                ) -> SteeredPath:
    """Make a circle about a centre, of some turns after one in which it grows."""
    first = round(1 / frequency / interval)
    count = round((1 + turns) / frequency / interval)
    if first < _FEWEST:
        raise InputError(f"must be sampled {_FEWEST} times a turn at least: choose a shorter "
                         "--interval", key="--frequency", given=f"{frequency:g} Hz")
    time = interval * np.arange(count + 1, dtype=float)
    grown = np.clip(time * frequency, 0.0, 1.0)
    wanted = circle(centre, radius * grown**2 * (3 - 2 * grown), time * frequency)
    return SteeredPath(time, wanted, first, first)


def circle(centre: Array, radius: Any, turns: Array) -> Array:
    """Make the places of a circle about a centre, (turns, 3); it begins along x."""
    along = 2 * np.pi * np.asarray(turns)
    return np.stack([centre[0] + 0 * along, centre[1] + radius * np.cos(along),
                     centre[2] + radius * np.sin(along)], axis=-1)


def read_path(file: Path, middle: Array, interval: float) -> SteeredPath:
    """Read a CSV file with t_s and one or more of deflection_mm, tilt_x_mrad and tilt_y_mrad.

    Straight lines join its rows. A place without a column stays at that of ``middle``. An unusable
    value is an InputError that names line and column.
    """
    named = tuple(zip(("deflection", "tilt_x", "tilt_y"), ("mm", "mrad", "mrad"), strict=True))
    sheet = read_sheet(file, (Column("t", "s", also=(TIMES,)),
                              *(Column(name, unit, required=False) for name, unit in named)))
    time, places = sheet["t"], []
    for row in np.flatnonzero(np.diff(time) < LEAST_STEP):
        raise sheet.error(int(row) + 1, "t", "must be after the line before, by 1 ns at least: "
                                             f"that is at {time[row]:g} s")
    if len(time) < 2:
        raise InputError("must have at least two rows", file=file)
    sampled = interval * np.arange(sample_count(float(time[-1] - time[0]), interval))
    for (name, _), usual in zip(named, middle.tolist(), strict=True):
        known = np.isfinite(sheet[name])
        if known.any() and not known.all():
            raise sheet.error(int(np.argmin(known)), name, "must not be blank where other rows "
                                                           "have a value")
        places.append(np.interp(sampled, time - time[0], sheet[name]) if known.any()
                      else np.full(len(sampled), usual))
    wanted = np.stack(places, axis=-1)
    if not np.ptp(wanted, axis=0).any():
        raise InputError("must have one column at least of deflection_mm, tilt_x_mrad, "
                         "tilt_y_mrad, with values that change", file=file)
    return SteeredPath(np.append(sampled, sampled[-1] + interval),
                       np.vstack([wanted, wanted[-1:]]))
