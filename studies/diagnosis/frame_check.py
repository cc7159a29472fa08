"""Check of scans for another frame or unit than stated, before it is taken for a cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.studies.diagnosis.fits.fitting import nominal_fit
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.files import words_beside

WORDS = words_beside(__file__)

#: Transforms from written places and displacements to true ones; likeliest errors first.
FRAMES: dict[str, tuple[tuple[tuple[float, float], tuple[float, float]], float]] = {
    "x_mirrored": (((-1, 0), (0, 1)), 1), "y_mirrored": (((1, 0), (0, -1)), 1),
    "half_turn": (((-1, 0), (0, -1)), 1), "swapped": (((0, 1), (1, 0)), 1),
    "left_turn": (((0, -1), (1, 0)), 1), "right_turn": (((0, 1), (-1, 0)), 1),
    "turned_over": (((0, -1), (-1, 0)), 1), "larger": (((10, 0), (0, 10)), 1),
    "inches": (((25.4, 0), (0, 25.4)), 1), "against": (((1, 0), (0, 1)), -1),
    "ten_times": (((1, 0), (0, 1)), 10), "tenth": (((1, 0), (0, 1)), 0.1),
}

#: Factor by which another frame must leave less misfit than the stated frame.
_LESS = 4.0
#: Decrease of χ² that another frame must reach, with χ² scaled to what it leaves itself: by noise
#: alone this has a probability of exp(-30).
_CLEAR = 60.0

#: Ratio of the misfits of two frames that counts as equal.
_ALIKE = 1.01


def check_frame(simulation: Simulation, table: ReadingTable, centre: str) -> None:
    """Raise an :class:`InputError` where scans fit much better in another frame or unit.

    The nominal model is fitted to all readings but scans; ``centre`` is the origin of the places.
    """
    rows = table.rows_of.get("film")
    if rows is None:
        return
    scanned, unknowns = table[rows].compact(), nominal_fit(
        simulation, table[table.point < 0].compact()).unknowns
    as_said = _misfit(simulation, scanned, unknowns)
    misfits = {name: _misfit(simulation, _rewritten(scanned, np.array(turn), factor), unknowns)
               for name, (turn, factor) in FRAMES.items()}
    least = min(misfits.values())
    spread = max(1.0, least / len(rows))
    gain = (as_said - least) / spread
    if as_said > _LESS * least and gain > _CLEAR:
        name = next(name for name, misfit in misfits.items() if misfit <= _ALIKE * least)
        chance = f"below 1e-{min(int(gain / 2 / np.log(10)), 99)}"
        raise InputError(WORDS["told"].format(what=WORDS[name], chance=chance, centre=centre),
                         key="field.csv")


def _misfit(simulation: Simulation, table: ReadingTable, unknowns: Array) -> float:
    """Compute χ² of scans, infinite where there is no equilibrium."""
    residual = table.noise.whitened(table.value - simulation.predict((), unknowns, table))
    return float(np.nan_to_num(residual @ residual, nan=np.inf))


def _rewritten(table: ReadingTable, turn: Array, factor: float) -> ReadingTable:
    scans = tuple(replace(scan, place=scan.place @ turn.T) for scan in table.scans)
    return replace(table, scans=scans, value=factor * table.value)
