"""The report of a study: one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tympan.fem.membrane.loading import BIASES
from tympan.fem.rig import Rig
from tympan.geometry.fields import fields_of
from tympan.geometry.units import DIMENSIONS
from tympan.reports.study import curves, figure4
from tympan.reports.study import text as words
from tympan.reports.study.view import StudyView, view_study
from tympan.reports.template import embedded_picture, template
from tympan.studies.alpha.circles import LoadGrid
from tympan.studies.files import write_text
from tympan.studies.study import StudyResult

#: SI units of settings by their names.
_UNITS = {field.name: DIMENSIONS[field.says.dimension].symbol
          for settings in (Rig, *BIASES.values(), LoadGrid) for field in fields_of(settings)
          if field.says.dimension}


def build_study_page(folder: Path) -> Path:
    """Draw the figures of a stored study and write folder/report.html; answers that file.

    Raises
    ------
    InputError
        When something the study stores is missing or damaged.
    MissingLibrary
        When this computer cannot draw in three dimensions.
    """
    run = view_study(StudyResult.load(folder), folder)
    figure4.draw_figure4(run, folder)
    curves.draw_curves(run, folder)
    file = folder / "report.html"
    write_text(file, render_study(run, embedded_picture(folder / "fig4.png"),
                                  embedded_picture(folder / "curves.svg")))
    return file


def render_study(run: StudyView, fig4: str, curves_: str) -> str:
    """The page as text; the figures as data URIs."""
    return template("reports/study/report.html").render(
        run=run, summary=words.study_summary(run), warnings=words.study_warnings(run),
        fig4=fig4, curves=curves_,
        hollow=any(curve.loose.any() for item in run.specimens for curve in item.curves),
        design=figure4.lay_out(run.specimens, run.stress_range),
        alphas=[item for item in run.alphas if len(item.circles) > 1],
        circles=[item for item in run.alphas if len(item.circles) == 1],
        settings=list(settings(run.record)))


def settings(record: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """What the study was run with, flat: where a setting belongs, its name, and value and unit."""
    for where, key in (("Rig", "rig"), ("Computation", "settings"),
                       ("Loads for α", "alpha_settings"), ("Libraries", "libraries")):
        yield from ((where, name, value) for name, value in _flat(record[key]))
    yield "Libraries", "Python", record["python"]


def _flat(value: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _flat(item, (*path, str(key)))
        return
    if isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
        yield from _flat({str(number): item for number, item in enumerate(value, 1)}, path)
        return
    shown = (", ".join(map(_shown, value)) or "none") if isinstance(value, list) else _shown(value)
    unit = _UNITS.get(path[-1], "") if path else ""
    yield ", ".join(part.replace("_", " ") for part in path), f"{shown} {unit}".strip()


def _shown(value: Any) -> str:
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "none"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)
