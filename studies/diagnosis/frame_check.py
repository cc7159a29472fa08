"""Check of scans for another frame or unit than is said, before that gets a cause."""

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

#: What makes places as they are from those written, and displacements; the likeliest slips first.
FRAMES: dict[str, tuple[tuple[tuple[float, float], tuple[float, float]], float]] = {
    "x_mirrored": (((-1, 0), (0, 1)), 1), "y_mirrored": (((1, 0), (0, -1)), 1),
    "half_turn": (((-1, 0), (0, -1)), 1), "swapped": (((0, 1), (1, 0)), 1),
    "left_turn": (((0, -1), (1, 0)), 1), "right_turn": (((0, 1), (-1, 0)), 1),
    "turned_over": (((0, -1), (-1, 0)), 1), "larger": (((10, 0), (0, 10)), 1),
    "inches": (((25.4, 0), (0, 25.4)), 1), "against": (((1, 0), (0, 1)), -1),
    "ten_times": (((1, 0), (0, 1)), 10), "tenth": (((1, 0), (0, 1)), 0.1),
}

#: By what factor less than the frame that is said another one must leave.
_LESS = 4.0
#: How much less it must leave, in χ² scaled to what it leaves itself: e to the minus 30 by noise
#: alone.
_CLEAR = 60.0

#: What two frames leave that fit alike, relative to what they leave.
_ALIKE = 1.01


def check_frame(simulation: Simulation, table: ReadingTable, centre: str) -> None:
    """An :class:`InputError` where scans fit much better in another frame or unit.

    By the nominal model fitted to all that is no scan; ``centre`` is what places are counted from.
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
    """χ² of scans, infinite where there is no equilibrium."""
    residual = table.noise.whitened(table.value - simulation.predict((), unknowns, table))
    return float(np.nan_to_num(residual @ residual, nan=np.inf))


def _rewritten(table: ReadingTable, turn: Array, factor: float) -> ReadingTable:
    scans = tuple(replace(scan, place=scan.place @ turn.T) for scan in table.scans)
    return replace(table, scans=scans, value=factor * table.value)
