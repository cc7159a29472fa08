"""What a slip of the pen makes wrong: one run of readings, or single readings.

No effect of the library does that. Such columns serve to say where a misfit is, not to test
whether there is one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tympan.studies.diagnosis.inference.projection import RANK, beside, without
from tympan.studies.diagnosis.reading_table import ReadingTable

Array = NDArray[np.float64]

#: Columns of a run: polynomials in the voltage's square. As many single readings are told at most.
COLUMNS = 3

#: χ² that a single reading takes away to be told.
_CLEAR = 30.0


def run_columns(table: ReadingTable, names: Sequence[str]) -> dict[str, Array]:
    """Columns over the noise of each run of deflections, where its specimen has others beside it.

    A length each, smooth in the voltage.
    """
    squared = (table.voltage / max(float(table.voltage.max(initial=0.0)), 1.0)) ** 2
    smooth = squared[:, None] ** np.arange(COLUMNS) / table.sigma[:, None]
    labels = np.stack([part.astype(str) for part in (table.specimen, table.mass, table.run)], 1)
    runs, number = np.unique(labels[table.lengths], axis=0, return_inverse=True)
    inside = np.full(len(table), -1)
    inside[table.lengths] = number.ravel()
    alone = [np.sum(runs[:, 0] == run[0]) == 1 for run in runs]
    return {f"run {_run_words(table, names, inside == place)}":
            np.where((inside == place)[:, None], smooth, 0.0)
            for place in range(len(runs)) if not alone[place]}


def reading_columns(table: ReadingTable, names: Sequence[str], taken: Array, residual: Array
                    ) -> dict[str, Array]:
    """The single readings that take most of residuals away, beside an orthonormal basis.

    As one pattern; empty where none stands out.
    """
    chosen = list[int]()
    for _ in range(COLUMNS):
        rest = without(taken, residual)
        sizes = np.maximum(1 - np.sum(taken**2, axis=1), 0.0)
        parts = np.where(table.lengths & (sizes > RANK), rest**2 / np.maximum(sizes, RANK), 0.0)
        best = int(parts.argmax())
        if parts[best] < _CLEAR:
            break
        chosen.append(best)
        taken = np.hstack([taken, beside(taken, np.eye(len(table))[:, [best]])])
    if not chosen:
        return {}
    words = ", ".join(_reading_words(table, names, row) for row in sorted(chosen))
    return {f"reading {words}": np.eye(len(table))[:, chosen]}


def _run_words(table: ReadingTable, names: Sequence[str], rows: NDArray[np.bool_]) -> str:
    """A run by its specimen and mass, and its label where there is one."""
    first = int(np.flatnonzero(rows)[0])
    label = f" in run {table.run[first]}" if table.run[first] else ""
    return f"{names[table.specimen[first]]} under {1e3 * table.mass[first]:.4g} g{label}"


def _reading_words(table: ReadingTable, names: Sequence[str], row: int) -> str:
    return (f"{names[table.specimen[row]]} under {1e3 * table.mass[row]:.4g} g at "
            f"{1e-3 * table.voltage[row]:.3g} kV ({table.file[row]}, line {table.line[row]})")
