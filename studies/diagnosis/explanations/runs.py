"""A single run or load that deviates in a way that no effect of the library describes.

Its columns serve to locate a misfit, not to test whether there is one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.studies.diagnosis.explanations.kind import Explanation, Written
from tympan.studies.diagnosis.inference.pattern_shares import pattern_columns, shares_of, stands_out
from tympan.studies.diagnosis.inference.projection import taken_by
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.patterns.reading_patterns import check_of_pattern
from tympan.studies.diagnosis.reading_table import ReadingTable

#: Number of columns of a run: polynomials in the voltage's square.
COLUMNS = 3

#: Fewest masses among which one can deviate: of two, either may be wrong.
_MASSES = 3


def odd_run(judged: Judgement, written: Written | None = None) -> Explanation | None:
    """Name the run or load that explains more of the misfit than any pattern."""
    taken = taken_by(judged.nominal.free_jacobian)
    odd = _odd_columns(judged, taken)
    shares = shares_of(judged, taken, pattern_columns(judged) | odd)
    best = max(shares, key=lambda name: shares[name], default="")
    if best not in odd:
        return None
    return Explanation(judged.test.words(best), check_of_pattern(best))


def _odd_columns(judged: Judgement, taken: Array) -> dict[str, Array]:
    """Build columns of the run and of the load that deviate more than the others, if one does."""
    table, odd = judged.table, dict[str, Array]()
    names = [specimen.name for specimen in judged.simulation.setup.specimens]
    for columns in (run_columns(table, names), load_columns(table)):
        shares = shares_of(judged, taken, columns)
        best = max(shares, key=lambda name: shares[name], default=None)
        if best is not None and stands_out(best, shares, shares):
            odd[best] = columns[best]
    return odd


def run_columns(table: ReadingTable, names: Sequence[str]) -> dict[str, Array]:
    """Build columns over the noise for each run of deflections whose specimen has other runs.

    Each column is a length that is smooth in the voltage.
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
    """Build columns over the noise of all deflections under each mass, for three masses or more."""
    masses = np.unique(table.mass[table.lengths])
    return {f"load {1e3 * mass:.4g} g": np.where(
        ((table.mass == mass) & table.lengths)[:, None], _smooth(table), 0.0)
        for mass in (masses.tolist() if len(masses) >= _MASSES else ())}


def _smooth(table: ReadingTable) -> Array:
    """Evaluate polynomials in the voltage's square, over the noise."""
    squared = (table.voltage / max(float(table.voltage.max(initial=0.0)), 1.0)) ** 2
    return np.asarray(squared[:, None] ** np.arange(COLUMNS) / table.sigma[:, None])


def _run_words(table: ReadingTable, names: Sequence[str], rows: Mask) -> str:
    """Describe a run by its specimen and mass, and its label where there is one."""
    first = int(np.flatnonzero(rows)[0])
    label = f" in run {table.run[first]}" if table.run[first] else ""
    return f"{names[table.specimen[first]]} under {1e3 * table.mass[first]:.4g} g{label}"
