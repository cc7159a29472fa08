"""A run or a load that is off by itself, which no effect of the library is.

Its columns serve to say where a misfit is, not to test whether there is one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.studies.diagnosis.explanations.kind import Explanation, Written
from tympan.studies.diagnosis.inference.pattern_shares import alone, pattern_columns, shares_of
from tympan.studies.diagnosis.inference.projection import taken_by
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.sentences import WORDS

#: Columns of a run: polynomials in the voltage's square.
COLUMNS = 3

#: Fewest masses of which one can be off: of two, either may be.
_MASSES = 3


def odd_run(judged: Judgement, written: Written | None = None) -> Explanation | None:
    """The run or load that takes more of the misfit than any pattern."""
    taken = taken_by(judged.nominal.free_jacobian)
    odd = _odd_columns(judged, taken)
    shares = shares_of(judged, taken, pattern_columns(judged) | odd)
    best = max(shares, key=lambda name: shares[name], default="")
    if best not in odd:
        return None
    kind, _, name = best.partition(" ")
    return Explanation(judged.test.words(best), WORDS[f"look_{kind}"].format(name=name))


def _odd_columns(judged: Judgement, taken: Array) -> dict[str, Array]:
    """Columns of the run and of the load that is off more than the others, if one is."""
    table, odd = judged.table, dict[str, Array]()
    names = [specimen.name for specimen in judged.simulation.setup.specimens]
    for columns in (run_columns(table, names), load_columns(table)):
        shares = shares_of(judged, taken, columns)
        best = max(shares, key=lambda name: shares[name], default=None)
        if best is not None and alone(best, shares, shares):
            odd[best] = columns[best]
    return odd


def run_columns(table: ReadingTable, names: Sequence[str]) -> dict[str, Array]:
    """Columns over the noise of each run of deflections, where its specimen has others beside it.

    Each is a length that is smooth in the voltage.
    """
    smooth = _smooth(table)
    labels = np.stack([part.astype(str) for part in (table.specimen, table.mass, table.run)], 1)
    runs, number = np.unique(labels[table.lengths], axis=0, return_inverse=True)
    inside = np.full(len(table), -1)
    inside[table.lengths] = number.ravel()
    alone = [np.sum(runs[:, 0] == run[0]) == 1 for run in runs]
    return {f"run {_run_words(table, names, inside == place)}":
            np.where((inside == place)[:, None], smooth, 0.0)
            for place in range(len(runs)) if not alone[place]}


def load_columns(table: ReadingTable) -> dict[str, Array]:
    """Columns over the noise of all deflections under each mass, of three or more."""
    masses = np.unique(table.mass[table.lengths])
    return {f"load {1e3 * mass:.4g} g": np.where(
        ((table.mass == mass) & table.lengths)[:, None], _smooth(table), 0.0)
        for mass in (masses.tolist() if len(masses) >= _MASSES else ())}


def _smooth(table: ReadingTable) -> Array:
    """Polynomials in the voltage's square over the noise."""
    squared = (table.voltage / max(float(table.voltage.max(initial=0.0)), 1.0)) ** 2
    return np.asarray(squared[:, None] ** np.arange(COLUMNS) / table.sigma[:, None])


def _run_words(table: ReadingTable, names: Sequence[str], rows: Mask) -> str:
    """A run by its specimen and mass, and its label where there is one."""
    first = int(np.flatnonzero(rows)[0])
    label = f" in run {table.run[first]}" if table.run[first] else ""
    return f"{names[table.specimen[first]]} under {1e3 * table.mass[first]:.4g} g{label}"
