"""The report of a study: one self-contained HTML page, and the numbers behind its sentences."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Template

from tympan.base.fields import fields_of
from tympan.base.units import DIMENSIONS
from tympan.fem.membrane.biases import BIASES
from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.fem.rig import Rig
from tympan.reports.figures.curve import VoltageCurve
from tympan.reports.study import curves, forces, stress_figure
from tympan.reports.study.view import SpecimenView, StudyView, view_study
from tympan.reports.template import embedded_picture, percent, sentence, template
from tympan.reports.viewer import viewer
from tympan.studies.alpha import AlphaResult
from tympan.studies.files import replaced, to_json, write_text
from tympan.studies.limits import LoadGrid
from tympan.studies.study import StudyResult

#: SI units of settings by their names.
_UNITS = {field.name: DIMENSIONS[field.says.dimension].symbol
          for settings in (Rig, *BIASES.values(), LoadGrid) for field in fields_of(settings)
          if field.says.dimension}


def build_study_page(stored: StudyResult, folder: Path) -> list[Path]:
    """Draw the figures of a study and write folder/report.html; return that file.

    A :class:`~tympan.base.system.MissingLibrary` says that this computer cannot draw in three
    dimensions.
    """
    run = view_study(stored, folder)
    pulled = [item.force for item in stored.specimens if item.force is not None]
    with replaced(folder, stored.pictures):
        stress_figure.draw_stress(run, folder)
        curves.draw_study_curves(run, folder)
        if pulled:
            forces.draw_study_forces(pulled, folder)
    file = folder / "report.html"
    films = {item.name: item.film for item in run.specimens}
    write_text(file, render_study(run, embedded_picture(folder / "stress.png"),
                                  embedded_picture(folder / "curves.svg"), viewer(films),
                                  embedded_picture(folder / "forces.svg") if pulled else ""))
    return [file]


def render_study(run: StudyView, stress: str, curves_: str, viewer: str = "", forces_: str = ""
                 ) -> str:
    """Write the page as text; figures are data URIs, the viewer of the films is HTML."""
    return template("reports/study/report.html").render(
        run=run, summary=study_summary(run), warnings=study_warnings(run),
        stress=stress, curves=curves_, viewer=viewer, forces=forces_,
        pulled=[item.force for item in run.stored.specimens if item.force is not None],
        not_pulled=[item.name for item, stored in zip(
            run.specimens, run.stored.specimens, strict=True) if stored.force is None],
        limit_states={kind: state for kind, state in LIMIT_STATES.items()
                      if any(curve.limits.by_kind.get(kind) for item in run.specimens
                             for curve in item.curves)},
        curves_of=[(", ".join(filter(None, (item.name, curve.drive))), curve)
                   for item in run.specimens for curve in item.curves],
        design=stress_figure.lay_out(run.specimens, run.stress_range),
        alphas=[item for item in run.stored.alphas if len(item.circles) > 1],
        circles=[item for item in run.stored.alphas if len(item.circles) == 1],
        settings=list(settings(run.stored)))


def settings(stored: StudyResult) -> Iterator[tuple[str, str, str]]:
    """List the settings of the study: where each belongs, its name, its value with unit."""
    loads = {item.specimen: to_json(item.loads) for item in stored.alphas}
    for record in loads.values():
        record["chosen by what the film bears"] = record.pop("from_film")
    for where, record in (("Rig", stored.rig), ("Computation", stored.settings),
                          ("Loads for α", loads), ("Libraries", stored.libraries)):
        yield from ((where, name, value) for name, value in _flat(record))
    yield "Libraries", "Python", stored.python


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


def study_summary(run: StudyView) -> str:
    """Write one paragraph on deflections, stress at the plate, effects of voltage, and α."""
    first = reference(run.specimens)
    sentences = (
        _say("deflections", run, first, [item for item in run.specimens if item is not first]),
        stress_at_plate(run.specimens, run.stress_range[0]),
        _say("tension", [item for item in run.specimens if item.loose]),
        _say("breakdown", [item for item in run.specimens
                           if item.result.breakdown_margin is not None]),
        strokes_text(run), _mixtures(run.stored.alphas))
    # A number and its unit stay on one line.
    return re.sub(r"(?<=\d) (?=(?:mm|kPa|kV|g)\b)", "\N{NO-BREAK SPACE}",
                  " ".join(filter(None, sentences)))


def reference(specimens: Sequence[SpecimenView]) -> SpecimenView:
    """Choose the film that the others are compared with: the first round one, else the first."""
    return next((item for item in specimens if item.round), specimens[0])


def stress_at_plate(specimens: Sequence[SpecimenView], least: float) -> str:
    """Say on which axis the stress at the plate is larger, and by how much.

    ``least`` is the smallest stress of all films [kPa].
    """
    different = [item for item in specimens if not item.alike]
    groups = []
    for axis in dict.fromkeys(map(_larger_axis, different)):
        ends = [{"name": item.name, "high": max(item.short.at_plate, item.long.at_plate),
                 "low": min(item.short.at_plate, item.long.at_plate)}
                for item in different if _larger_axis(item) == axis]
        groups.append({"axis": axis, "ends": ends, "shares": _shares_of_load(ends, least)})
    return _say("stress_at_plate", groups, [item for item in specimens if item.alike], least)


def _larger_axis(specimen: SpecimenView) -> str:
    return specimen.axes[specimen.short.at_plate <= specimen.long.at_plate]


def _shares_of_load(ends: Sequence[dict[str, Any]], least: float) -> list[float]:
    """Compute differences as shares of the load's part, where the film is stressed without it."""
    low = min(end["low"] for end in ends)
    if least < max(end["high"] for end in ends) / 2 or low <= least:
        return []
    return [(end["high"] - least) / (end["low"] - least) - 1 for end in ends]


def strokes_text(run: StudyView) -> str:
    """Say the stroke of each plate by the voltage, under the picture's mass or the lightest one.

    It is taken over the voltages wanted, or up to each film's first limit.
    """
    masses = sorted({curve.mass for item in run.specimens for curve in item.curves})
    if not masses:
        return ""
    mass = run.mass if run.mass in masses else masses[0]
    pairs = [(item.name, curve) for item in run.specimens for curve in item.curves
             if curve.mass == mass]
    asked = [float(voltage) for _, curve in pairs for voltage in curve.asked]
    low, high = (min(asked), max(asked)) if asked else (0.0, np.inf)
    return _say("strokes", mass, low, high, [stroke(name, curve, low, high)
                                             for name, curve in pairs])


def stroke(name: str, curve: VoltageCurve, low: float, high: float) -> dict[str, Any]:
    """Compute the stroke of a plate [mm] between two voltages [kV], or to the first limit."""
    end = float(curve.voltage[-1]) if len(curve.voltage) else -1.0
    if end < low:
        trouble = "pull-in at once" if len(curve.voltage) else "no equilibrium"
        return {"name": name, "trouble": trouble}
    limit = curve.first
    if limit is None or limit.voltage_V >= 1e3 * high:
        return {"name": name, "trouble": "", "limit": None, "end": min(end, high),
                "stroke": curve.at(min(end, high)) - curve.at(low)}
    if limit.voltage_V < 1e3 * low:
        return {"name": name, "trouble": limit.words}
    return {"name": name, "trouble": "", "limit": limit,
            "stroke": curve.deflection_at(limit) - curve.at(low)}


def _mixtures(alphas: Sequence[AlphaResult]) -> str:
    """Say the mixture of circles that is equivalent to each elongated shape."""
    elongated = [(item, item.by_basis["membrane"]) for item in alphas if len(item.circles) > 1]
    worst = max((weights.fit_error for _, weights in elongated), default=0.0)
    return _say("mixtures", [
        {"specimen": item.specimen, "parts": list(zip(weights.alpha, item.circles, strict=True))}
        for item, weights in elongated], percent(worst).removeprefix("< "))


def study_warnings(run: StudyView) -> list[str]:
    """List every warning stored, and every point of the curves without a result, by specimen."""
    return [*(f"{item.name}: {text}" for item in run.specimens for text in item.result.warnings),
            *(text for item in run.specimens for curve in item.curves
              for text in curve_warnings(item.name, curve)),
            *(f"{item.specimen}, α: {text}" for item in run.stored.alphas for text in item.warnings
              if not text.startswith("the semi-axes are equal"))]


def curve_warnings(name: str, curve: VoltageCurve) -> Iterator[str]:
    """List loads without result, limits that the mesh hardly resolves, a curve without an end.

    Limits themselves are in the table.
    """
    unsolved = [voltage for voltage, status in zip(curve.asked, curve.status, strict=True)
                if status == "not_converged"]
    if unsolved:
        yield _say("no_result", name, curve.mass, unsolved)
    for limit in curve.limits.told:
        if limit.advice:
            yield _say("unresolved", name, curve.mass, limit.words,
                       limit.advice)
    if curve.limits.end is None and curve.limits.instability is None:
        yield _say("ended", name, curve.mass, curve.limits.ended)


def _say(part: str, *values: Any) -> str:
    return sentence(_words(), part, *values)


@cache
def _words() -> Template:
    return template("reports/study/words.txt")
