"""Scans written in another frame or unit than stated.

They are sought before any effect is calculated: in a wrong frame, a film's shape shows nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.diagnosis.evidence.kind import ReadingModel
from tympan.studies.diagnosis.explanations.kind import Explanation
from tympan.studies.diagnosis.fits.fitting import nominal_fit
from tympan.studies.diagnosis.inference.weighing import FRAME, unlikely
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.sentences import WORDS

#: Transforms from written places and displacements to true ones; likeliest errors first.
FRAMES: dict[str, tuple[tuple[tuple[float, float], tuple[float, float]], float]] = {
    "x_mirrored": (((-1, 0), (0, 1)), 1), "y_mirrored": (((1, 0), (0, -1)), 1),
    "half_turn": (((-1, 0), (0, -1)), 1), "swapped": (((0, 1), (1, 0)), 1),
    "left_turn": (((0, -1), (1, 0)), 1), "right_turn": (((0, 1), (-1, 0)), 1),
    "turned_over": (((0, -1), (-1, 0)), 1), "larger": (((10, 0), (0, 10)), 1),
    "inches": (((25.4, 0), (0, 25.4)), 1), "against": (((1, 0), (0, 1)), -1),
    "ten_times": (((1, 0), (0, 1)), 10), "tenth": (((1, 0), (0, 1)), 0.1),
}

#: Factor by which another frame must leave less misfit than the stated frame. Effects that have not
#: been considered yet may change a misfit by less.
_LESS = 4.0

#: Ratio of the misfits of two frames that counts as equal.
_ALIKE = 1.01


def other_frame(simulation: ReadingModel, table: ReadingTable, centre: str) -> Explanation | None:
    """Find another frame or unit in which scans fit much better.

    The nominal model is fitted to all readings but scans; ``centre`` is the origin of the places.
    """
    rows = table.rows_of.get("film")
    if rows is None:
        return None
    scanned, unknowns = table[rows].compact(), nominal_fit(
        simulation, table[table.point < 0].compact()).unknowns
    as_stated = _misfit(simulation, scanned, unknowns)
    misfits = {name: _misfit(simulation, _rewritten(scanned, np.array(turn), factor), unknowns)
               for name, (turn, factor) in FRAMES.items()}
    least = min(misfits.values())
    # No frame leaves noise alone: what the best one leaves counts as noise.
    noise = max(1.0, least / len(rows))
    gain = unlikely(as_stated / noise, len(rows)) - unlikely(least / noise, len(rows))
    if as_stated <= _LESS * least or gain <= FRAME:
        return None
    name = next(name for name, misfit in misfits.items() if misfit <= _ALIKE * least)
    chance = f"below 1e-{min(int(gain / 2 / np.log(10)), 99)}"
    return Explanation(WORDS["other_frame"].format(what=WORDS[f"frame_{name}"], chance=chance),
                       WORDS["do_frame"].format(centre=centre))


def _misfit(simulation: ReadingModel, table: ReadingTable, unknowns: Array) -> float:
    """Compute χ² of scans, infinite where there is no equilibrium."""
    residual = table.noise.whitened(table.value - simulation.predict((), unknowns, table))
    return float(np.nan_to_num(residual @ residual, nan=np.inf))


def _rewritten(table: ReadingTable, turn: Array, factor: float) -> ReadingTable:
    """Turn the places of scans, and multiply their displacements by a factor."""
    scans = tuple(replace(scan, place=scan.place @ turn.T) for scan in table.scans)
    return replace(table, scans=scans, value=factor * table.value)
