"""The page of a sweep, finished or on its way: one self-contained HTML file."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

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

#: Rows of the page's table; more would make browsers slow, and are in sweep.csv.
_MOST_ROWS = 2000

#: While a sweep runs its page is written at most so often [s]: nobody looks more often.
_EVERY = 10.0
#: And in at most this share of the time, so that the sweep does not wait for it.
_SHARE = 0.02

#: What the page calls a case's status.
STATUSES = {"equilibrium": "equilibria", "no_equilibrium": "beyond pull-in",
            "not_converged": "not converged", WAITING: "not solved yet"}

_NAMED = 6  #: specimens named of those with one reason


@dataclass(frozen=True)
class FailedCases:
    """Failures of one reason: "case" or what was asked, how often, and some of the specimens."""

    what: str
    reason: str
    count: int
    specimens: str


def build_sweep_page(result: SweepResult, folder: Path) -> list[Path]:
    """Draw the films of a finished sweep and write folder/sweep.html; answers that file."""
    return [_write(result, folder, draw_films(result, folder) if result.figures else [])]


def keep_page(folder: Path) -> Watch:
    """Writer of the page of a sweep while it runs; where it cannot be written it waits."""
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
    """The page as text; ``films`` are pictures as data URIs."""
    view = SweepView(result)
    headings, rows = _rows(view)
    return template("reports/sweep/sweep.html", px=lambda at: f"{at:.1f}").render(
        names=STATUSES,
        result=result, view=view, maps=sweep_maps(view), colours=colours(), films=films,
        width=WIDTH, height=HEIGHT, headings=headings, rows=rows[:_MOST_ROWS],
        left_out=len(rows[_MOST_ROWS:]), failures=list(_failures(view)),
        waiting=result.statuses.get(WAITING, 0), when=time.strftime("%Y-%m-%d %H:%M:%S"))


#: What is shown in a cell and what it is sorted by.
Cell = tuple[str, float | str]


def _rows(view: SweepView) -> tuple[list[str], list[list[Cell]]]:
    """Headings and rows of the page's table: a specimen under a mass, at the voltage shown.

    Those beyond a limit come last.
    """
    keys = [key for key in view.keys if key.name != "voltage" or "voltage" not in view.loads]
    columns = [*keys, *view.columns]
    first = view.at_shown("voltage")
    reached = (view.table["status"] == "equilibrium").reset_coords(drop=True)
    many = "voltage" in view.loads and view.table.sizes["voltage"] > 1
    headings = ["specimen", *(column.heading for column in columns), *(["voltages reached"] * many),
                "beyond"]
    counts = (reached.sum("voltage").values.ravel().tolist() if many else [0] * len(first))
    rows = []
    for (_, row), count in zip(first.iterrows(), counts, strict=True):
        cells: list[Cell] = [(row["specimen"], row["specimen"])]
        for column in columns:
            value = row[column.name]
            cells.append((f"{value / column.size:.4g}" if isinstance(value, float)
                          and np.isfinite(value) else "" if isinstance(value, float) else value,
                          value if not isinstance(value, float) or np.isfinite(value) else ""))
        rows.append([*cells, *([(f"{count} of {view.table.sizes['voltage']}", count)] * many),
                     (row["beyond"], row["beyond"])])
    return headings, sorted(rows, key=lambda row: row[-1][0] != "")


def _failures(view: SweepView) -> Iterator[FailedCases]:
    """Cases without result, and why; beyond pull-in there is none for good reason."""
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
