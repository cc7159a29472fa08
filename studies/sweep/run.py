"""A sweep from plan to table: what is finished is taken, the rest is solved and kept as it comes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tympan.studies import files as store
from tympan.studies.parallel import Found
from tympan.studies.sweep.checkpoint import Shelf
from tympan.studies.sweep.plan import Sweep
from tympan.studies.sweep.table import FILES, write_tables
from tympan.studies.sweep.task import Row, Task, solver

#: Solves tasks in any order.
Solve = Callable[[Sequence[Task]], Iterator[Found]]

#: Called with the number of cases that are ready and of those that were so from the start.
Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Summary:
    """What a run of a sweep did: cases by status, how many were solved now and how many were there already."""

    statuses: dict[str, int]
    solved: int
    kept: int

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        return {"cases": sum(self.statuses.values()), "statuses": self.statuses,
                "solved": self.solved,
                "kept": self.kept}


def run(sweep: Sweep, folder: Path, solve: Solve,
        progress: Progress = lambda done, kept: None) -> Summary:
    """Solve what is not finished in a folder yet, and write its tables.

    Leaves ``sweep.nc``, ``sweep.parquet``, ``sweep.csv``, ``sweep.json`` and ``tasks/``, with
    fields also ``fields/``. It may be ended at any moment, and run again: no finished task is
    solved twice.

    Raises
    ------
    InputError
        When the folder cannot be written, is full, or another sweep uses it; what was finished is
        kept.
    """
    shelf = Shelf(folder)
    with shelf.alone():
        tasks = {entry.task.id: entry.task for entry in sweep.entries if entry.task is not None}
        found: dict[str, list[Row]] = {}
        for number, task in tasks.items():
            if (rows := shelf.get(task)) is not None:
                found[number] = rows
        kept = done = sum(map(len, found.values()))
        progress(done, kept)
        missing = [task for number, task in tasks.items() if number not in found]
        if missing:
            store.remove(folder,
                         *FILES)  # what is there belongs to another plan, or to an older solver
        for task, result in solve(missing):
            if isinstance(result, str):
                found[task.id] = task.failed(result)  # not kept: another run may have more luck
            else:
                shelf.put(task, result)
                found[task.id] = result.rows
            done += len(found[task.id])
            progress(done, kept)
        rows_of = [found[entry.task.id] if entry.task is not None else None
                   for entry in sweep.entries]
        statuses = write_tables(folder, sweep, rows_of)
        summary = Summary(dict(Counter(statuses)), done - kept, kept)
        store.write_json(folder / "sweep.json",
                         {"solver": solver(), "source": sweep.source, **summary.json()})
    return summary
