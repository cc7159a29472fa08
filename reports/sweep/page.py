"""The page of a sweep, finished or in progress: one self-contained HTML file."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tympan.base.errors import InputError
from tympan.reports.sweep.films import draw_films
from tympan.reports.sweep.maps import HEIGHT, WIDTH, colours, sweep_maps
from tympan.reports.sweep.view import SweepView
from tympan.reports.template import embedded_picture, template
from tympan.studies.files import write_text
from tympan.studies.sweep.asked import QUESTIONS
from tympan.studies.sweep.run import SweepResult, Watch
from tympan.studies.sweep.task import WAITING

#: Most rows of the page's table; more make browsers slow, and are in sweep.csv.
_MOST_ROWS = 2000

#: Least time between two pages of a running sweep [s]: nobody looks more often.
_EVERY = 10.0
#: Largest share of the time spent on the page, so that the sweep does not wait for it.
_SHARE = 0.02

#: Words on the page for a case's status.
STATUSES = {"equilibrium": "equilibria", "no_equilibrium": "beyond pull-in",
            "not_converged": "not converged", WAITING: "not solved yet"}

_NAMED = 6  #: most specimens named for one reason


@dataclass(frozen=True)
class FailedCases:
    """Failures of one reason: "case" or a quantity, their number, and some of the specimens."""

    what: str
    reason: str
    count: int
    specimens: str


def build_sweep_page(result: SweepResult, folder: Path) -> list[Path]:
    """Draw the films of a finished sweep and write folder/sweep.html; return that file."""
    return [_write(result, folder, draw_films(result, folder) if result.figures else [])]


def keep_page(folder: Path) -> Watch:
    """Make the writer of the page of a running sweep; if it cannot write, it tries again later."""
    due = 0.0

    def watch(so_far: Callable[[], SweepResult]) -> None:
        nonlocal due
        began = time.monotonic()
        if began < due:
            return
        with suppress(InputError):
            _write(so_far(), folder, [])
        ended = time.monotonic()
        due = ended + max(_EVERY, (ended - began) / _SHARE)

    return watch


def _write(result: SweepResult, folder: Path, films: list[Path]) -> Path:
    file = folder / "sweep.html"
    write_text(file, render_sweep(result, [embedded_picture(film) for film in films]))
    return file


def render_sweep(result: SweepResult, films: list[str]) -> str:
    """Write the page as text; ``films`` are pictures as data URIs."""
    view = SweepView(result)
    headings, rows = _rows(view)
    return template("reports/sweep/sweep.html", px=lambda at: f"{at:.1f}").render(
        names=STATUSES,
        result=result, view=view, maps=sweep_maps(view), colours=colours(), films=films,
        width=WIDTH, height=HEIGHT, headings=headings, rows=rows[:_MOST_ROWS],
        left_out=len(rows[_MOST_ROWS:]), failures=list(_failures(view)),
        waiting=result.statuses.get(WAITING, 0), when=time.strftime("%Y-%m-%d %H:%M:%S"))


#: Text of a cell, and the value it is sorted by.
Cell = tuple[str, float | str]


def _rows(view: SweepView) -> tuple[list[str], list[list[Cell]]]:
    """Make headings and rows of the page's table: a specimen under a mass, at the voltage shown.

    Rows beyond a limit come last.
    """
    keys = [key for key in view.keys if key.name != "voltage" or "voltage" not in view.loads]
    columns = [*keys, *view.columns]
    first = view.at_shown("voltage")
    reached = (view.table["status"] == "equilibrium").reset_coords(drop=True)
    voltages = view.table.sizes["voltage"] if "voltage" in view.loads else 1
    many = voltages > 1
    headings = ["specimen", *(column.heading for column in columns), *(["voltages reached"] * many),
                "beyond"]
    counts = reached.sum("voltage").values.ravel().tolist() if many else [0] * len(first)
    rows = []
    for (_, row), count in zip(first.iterrows(), counts, strict=True):
        cells = [_cell(row["specimen"])]
        cells += [_cell(row[column.name], column.size) for column in columns]
        if many:
            cells.append((f"{count} of {voltages}", count))
        rows.append([*cells, _cell(row["beyond"])])
    return headings, sorted(rows, key=lambda row: row[-1][0] != "")


def _cell(value: Any, size: float = 1.0) -> Cell:
    """Write a word, or a number in units of this size [SI]; a number that is missing is empty."""
    if not isinstance(value, float):
        return value, value
    return (f"{value / size:.4g}", value) if np.isfinite(value) else ("", "")


def _failures(view: SweepView) -> Iterator[FailedCases]:
    """Collect cases without result, with reasons; cases beyond pull-in are no failures."""
    rows = view.rows
    yield from _alike("case", rows[rows["status"].isin(["failed", "not_converged"])], "warnings")
    for name, quantity in QUESTIONS.known.items():
        reason = f"{name}_warnings"
        if reason not in rows:
            continue
        loads = [load for load in view.loads if load not in quantity.loads]
        rows_of = view.at_shown(*loads)
        missing = rows_of[[column for column in quantity.names(1) if column in rows]].isna()
        solved = ~rows_of["status"].isin([WAITING, "failed"])
        if "voltage" in quantity.loads:
            solved &= rows_of["status"] == "equilibrium"
        if quantity.change:
            solved &= rows_of["voltage"] != 0
        yield from _alike(name, rows_of[missing.all(axis=1) & solved], reason)


def _alike(what: str, rows: pd.DataFrame, column: str) -> Iterator[FailedCases]:
    for reason, those in rows.groupby(column, sort=False):
        names = list(dict.fromkeys(those["label"]))
        more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
        yield FailedCases(what, str(reason), len(those), ", ".join(names[:_NAMED]) + more)
