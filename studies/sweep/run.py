"""A sweep from plan to table: finished cases are read, the others solved and stored."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from operator import methodcaller
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tympan.base.errors import InputError
from tympan.base.process.folder import discard_temporaries
from tympan.base.progress import PartsDone
from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.studies.files import (
    from_json,
    read_json,
    remove,
    write_atomically,
    write_json,
    write_text,
)
from tympan.studies.parallel import NoValue
from tympan.studies.sweep.best import Best, best
from tympan.studies.sweep.plan import Sweep, voltage_of
from tympan.studies.sweep.reduced import Batch, batches
from tympan.studies.sweep.table import beyond_limits, dataset, frame, read_table, write_tables
from tympan.studies.sweep.task import (
    BY_ELEMENTS,
    EXACT_ROW,
    FAILED,
    PackedResult,
    SweepTask,
    TaskResult,
    solver,
    without_result,
)

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

#: Function that runs a function of batches of tasks, by id, in any order.
Pool = Callable[[Callable[[Batch], dict[str, TaskResult]], Mapping[str, Batch]],
                Generator[tuple[str, dict[str, TaskResult] | NoValue], None, None]]


#: Called after each task with a function that gives the result so far.
Watch = Callable[[Callable[[], "SweepResult"]], None]

#: Most reasons for cases without result that are printed: a screen has room for these.
_REASONS = 3

#: Files of a finished sweep besides its tasks, and its page.
FILES = ("sweep.nc", "sweep.parquet", "sweep.csv", "sweep.json", "sweep.html")


@dataclass(frozen=True)
class SweepResult:
    """Result of a sweep: cases by status, and the numbers of solved and of reused cases.

    ``table`` has all cases, as laid out by :func:`tympan.studies.sweep.table.dataset`. ``source``
    is SWEEP.toml, ``solver`` the version that solved it. ``figures``: the first case of each
    specimen was kept for a picture. ``at_V``: the nominal voltage of maps and of the best case,
    None for the highest.
    """

    statuses: dict[str, int]
    solved: int
    kept: int
    solver: str
    source: str
    figures: bool
    table: xr.Dataset = field(repr=False, compare=False)
    at_V: float | None = None

    @property
    def rows(self) -> pd.DataFrame:
        """A row for each case."""
        return frame(self.table)

    def best(self, of: str = "stroke", voltage: float | str | None = None,
             under: str | Sequence[str] = (), count: int = 5) -> Best:
        """Find the cases with the largest result: :func:`tympan.studies.sweep.best.best`.

        Examples: ``result.best()``, ``result.best("stroke", voltage="5 kV", under="max_true_stress
        < 131 kPa, breakdown_margin > 1.5")``.
        """
        at = self.at_V if voltage is None else voltage
        return best(self.table, of, at, under, count)

    @property
    def warnings(self) -> list[str]:
        """Sentences with the number of films (specimens under a mass) beyond each limit."""
        found = []
        for limit, cases in beyond_limits(self.table).items():
            where = ""
            if "voltage" in cases.dims:
                volts = voltage_of(cases["voltage"].values.tolist(), self.at_V)
                cases, where = cases.sel(voltage=volts), f" at {volts / 1e3:g} kV"
            if cases.any():
                found.append(f"{cases.sum().item()} of {cases.size} films beyond "
                             f"{LIMIT_STATES[limit].label}{where}, though they "
                             "have an equilibrium by the equations")
        return found + self._exact

    @property
    def _exact(self) -> list[str]:
        """Sentences on why rows come from finite elements, though many specimens are alike."""
        if "why" not in self.table:  # of an older version
            return []
        known = self.table["why"].where(self.table["by"] == BY_ELEMENTS, "")  # not by a formula
        reasons = Counter(filter(None, known.values.ravel().tolist()))
        rows = self.table["by"].size
        return [f"{count} of {rows} rows come from finite elements: {reason}"
                for reason, count in reasons.most_common(_REASONS)]

    @property
    def failures(self) -> list[str]:
        """Sentences with the number of cases without result by reason, the most frequent first."""
        status = self.table["status"].values.ravel().tolist()
        reasons = Counter(reason for kind, reason in zip(
            status, self.table["warnings"].values.ravel().tolist(), strict=True)
            if kind in (FAILED, "not_converged"))
        found = [f"{count} case{'s' * (count > 1)} without result: {reason}"
                 for reason, count in reasons.most_common(_REASONS)]
        left = sum(reasons.values()) - sum(count for _, count in reasons.most_common(_REASONS))
        return found + [f"{left} more cases without result: the page has all reasons"] * (left > 0)

    @property
    def by(self) -> dict[str, int]:
        """Numbers of rows from a reduced film and from finite elements, by these words."""
        return dict(Counter(filter(None, self.table["by"].values.ravel().tolist())))

    def json(self) -> dict[str, Any]:
        """Convert the result to a JSON object, without the table."""
        return {"cases": sum(self.statuses.values()), "statuses": self.statuses, "by": self.by,
                "solved": self.solved, "kept": self.kept,
                "warnings": [*self.warnings, *self.failures]}

    def save(self, folder: Path) -> None:
        """Write ``sweep.nc``, ``sweep.parquet``, ``sweep.csv`` and last ``sweep.json``."""
        write_tables(folder, self.table)
        write_json(folder / "sweep.json",
                   {"solver": self.solver, "source": self.source, "figures": self.figures,
                    "at_V": self.at_V,
                    **self.json()})

    @classmethod
    def load(cls, folder: Path) -> SweepResult:
        """Load a saved sweep."""
        file = folder / "sweep.json"
        record = from_json(dict[str, Any], read_json(file), file)
        kinds: dict[str, Any] = {"statuses": dict[str, int], "solved": int, "kept": int,
                                 "solver": str, "source": str, "figures": bool}
        values = {key: from_json(kind, record.get(key), file, key) for key, kind in kinds.items()}
        at = record.get("at_V")
        return cls(**values, table=read_table(folder / "sweep.nc"),
                   at_V=None if at is None else from_json(float, at, file, "at_V"))


@dataclass(frozen=True)
class Checkpoint:
    """Finished tasks in the folder of a sweep.

    A task's file is ``tasks/xx/ID.json``, xx the id's first digits. Its first line is the SHA-256
    of the rest, which has the id, the time it took and the rows. Files are written under another
    name and renamed.
    """

    folder: Path

    def put(self, task: SweepTask, result: TaskResult) -> None:
        """Store a result; its fields come first, so that a task with a file has them all."""
        for case_id, content in result.fields.items():
            write_atomically(fields_file(self.folder, case_id),
                             methodcaller("write_bytes", content), hashed=True)
        body = json.dumps({"task": task.id, "wall_s": result.wall_s,
                           "fields": sorted(result.fields), "rows": result.rows,
                           "answers": result.answers}, ensure_ascii=False)
        write_text(self._file(task), f"{_digest(body)}\n{body}\n", hashed=True)

    def get(self, task: SweepTask) -> TaskResult | None:
        """Read a finished task; None if it is missing, damaged or lacks fields."""
        try:
            digest, body = self._file(task).read_text(encoding="utf-8").rstrip("\n").split("\n", 1)
        except FileNotFoundError:
            return None
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}",
                             file=self._file(task)) from None
        except ValueError:  # also bytes that are no text
            return None
        if digest != _digest(body):
            return None
        try:
            content = json.loads(body)
            # Rows of older versions lack these columns.
            rows = [EXACT_ROW | row for row in content["rows"]]
            result = TaskResult(rows, content.get("answers", {}), content["wall_s"])
            whole = (content["task"] == task.id and result.answers_all(task)
                     and all(fields_file(self.folder, case_id).exists()
                             for case_id in content["fields"]))
        except (ValueError, LookupError, TypeError, AttributeError):  # another version's rows
            return None
        return result if whole else None

    def cases(self, sweep: Sweep) -> int:
        """Count the cases of a sweep that are stored."""
        return sum(len(task.ids) for task in tasks_of(sweep).values() if self._file(task).exists())

    def _file(self, task: SweepTask) -> Path:
        return self.folder / "tasks" / task.id[:2] / f"{task.id}.json"


def fields_file(folder: Path, case_id: str) -> Path:
    """Name the file with the fields of a case in the folder of a sweep."""
    return folder / "fields" / f"{case_id}.vtu"


def tasks_of(sweep: Sweep) -> dict[str, SweepTask]:
    """Collect the tasks of a sweep by their ids."""
    return {entry.task.id: entry.task for entry in sweep.entries if entry.task is not None}


def run_sweep(sweep: Sweep, folder: Path, pool: Pool,
              progress: PartsDone = lambda done, kept: None,
              watch: Watch = lambda so_far: None) -> SweepResult:
    """Solve the unfinished tasks of a folder, and write its tables.

    It leaves the files of :meth:`SweepResult.save` and ``tasks/``, with fields also ``fields/``. It
    may be stopped at any moment, even by a full disk, and run again: no finished task is solved
    twice.
    """
    checkpoint = Checkpoint(folder)
    discard_temporaries(folder)
    discard_temporaries(folder / "tasks")
    tasks = tasks_of(sweep)
    results: dict[str, PackedResult] = {}
    for task_id, task in tasks.items():
        if (finished := checkpoint.get(task)) is not None:
            results[task_id] = finished.packed()
    kept = done = sum(result.cases for result in results.values())
    progress(done, kept)
    missing = {task_id: task for task_id, task in tasks.items() if task_id not in results}
    if missing:  # the files present belong to another plan, or to an older solver
        remove(folder, *FILES)

    def so_far() -> SweepResult:
        return _result(sweep, results, done - kept, kept)

    together = batches(missing)
    with closing(pool(methodcaller("run"), together)) as answers:
        for first, answer in answers:
            for task in together[first].tasks:
                if isinstance(answer, NoValue):  # not stored: another run may succeed
                    result = without_result(task.ids, task.ask, task.loads, answer.reason)
                else:
                    result = answer[task.id]
                    checkpoint.put(task, result)
                results[task.id] = result.packed()
                done += len(task.ids)
            progress(done, kept)
            watch(so_far)
    whole = so_far()
    whole.save(folder)
    return whole


def unsolved(sweep: Sweep) -> SweepResult:
    """Make a sweep's result before anything is solved, with all its columns."""
    return _result(sweep, {}, 0, 0)


def _result(sweep: Sweep, results: Mapping[str, PackedResult], solved: int, kept: int
            ) -> SweepResult:
    table = dataset(sweep, results)
    statuses = dict(Counter(table["status"].values.ravel().tolist()))
    return SweepResult(statuses, solved, kept, solver(), sweep.source, sweep.figures, table,
                       sweep.at)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
