"""Every kind of folder a command writes with figures in it, and how these are drawn again."""

from __future__ import annotations

from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from tympan.base.command_line import command_line
from tympan.base.errors import InputError

#: What commands leave behind: a pattern of the file that is written last; what draws the result
#: into a folder, a page where there is one; and the result. Both stand within tympan, and are
#: imported where they are needed.
KINDS = {
    "study": ("study.json", "reports.study.page:build_study_page", "studies.study:StudyResult"),
    "solve": ("*.vtu", "reports.figures.film:draw_film", "studies.case:CaseResult"),
    "modes": ("*-modes.json", "reports.figures.modes:draw_modes", "studies.modes:ModesResult"),
    "path": ("*-path.json", "reports.figures.path:draw_path", "studies.path:PathResult"),
    "curve": ("*-curve.json", "reports.figures.curve:draw_curves",
              "studies.limits.curve:CurveResult"),
    "force": ("*-force.json", "reports.figures.force:draw_force", "studies.force:ForceResult"),
    "sense": ("*-sense.json", "reports.figures.sense:draw_sense", "studies.sense:SenseResult"),
    "tolerance": ("*-tolerance.json", "reports.figures.tolerance:draw_tolerance",
                  "studies.tolerance.result:ToleranceResult"),
    "outlines": ("outlines.json", "reports.figures.alpha:draw_outlines",
                 "studies.alpha.table:OutlineTable"),
    "map": ("alpha-map.json", "reports.figures.alpha:draw_map", "studies.alpha.map:AlphaMap"),
    "sweep": ("sweep.json", "reports.sweep.page:build_sweep_page", "studies.sweep.run:SweepResult"),
    "design": ("design.json", "reports.figures.design:draw_design",
               "studies.design.result:DesignResult"),
    "material fit": ("fit.json", "reports.figures.coupon:draw_fit",
                     "studies.material.result:MaterialFitResult"),
    "diagnose": ("diagnosis.json", "reports.diagnosis.page:build_diagnosis_page",
                 "studies.diagnosis.result:Diagnosis"),
    "diagnose --self-check": (
        "self-check.json", "reports.diagnosis.self_check:build_self_check_page",
        "studies.diagnosis.self_check:SelfCheck"),
    "lumped paper": ("paper.json", "paper.page:build_paper_page", "paper.output:PaperResult"),
    "lumped simulate": ("simulate.json", "reports.figures.response:draw_simulated",
                        "studies.lumped.simulate:ModelResponse"),
    "lumped control": ("control.json", "reports.figures.control:draw_control",
                       "studies.lumped.control.result:ControlResult"),
    "transient": ("transient.json", "reports.figures.response:draw_simulated",
                  "studies.transient:FieldResponse"),
    "response": ("*-response.json", "reports.figures.harmonic:draw_response",
                 "studies.response:ResponseResult"),
    "lumped identify": ("identify.json", "reports.figures.identification:draw_identified",
                        "studies.identify.result:IdentifyResult"),
    "lumped build": ("build.json", "reports.figures.lumped_model:draw_built",
                     "studies.lumped.build:BuildResult"),
}


def draw_stored(command: str, folder: Path, specimen: str) -> list[Path]:
    """Draw what a command, such as "lumped build", stored in a folder; answers what to look at.

    That is the page, otherwise the figures. ``specimen`` is the one it is of, where a folder may
    hold the results of several.
    """
    if command not in KINDS:
        return []
    marker, draw, stored = KINDS[command]
    names = [specimen] if "*" in marker else []
    result = resolve_name(f"tympan.{stored}").load(folder, *names)
    return list(resolve_name(f"tympan.{draw}")(result, folder))


def draw_result(result: Any, folder: Path) -> list[Path]:
    """Draw a result that was just saved into a folder, as the command of its kind does."""
    for command, (_, _, stored) in KINDS.items():
        if (stored.endswith(f":{type(result).__name__}")
                and resolve_name(f"tympan.{stored}") is type(result)):
            return draw_stored(command, folder, getattr(result, "specimen", ""))
    return []


def _is_solved(film: Path) -> bool:
    """Whether a film is that of ``solve``, which has numbers of its name that no other writes."""
    numbers = film.with_suffix(".json")
    return numbers.is_file() and not any(numbers.match(marker) for marker, *_ in KINDS.values())


def rebuild(folder: Path) -> list[Path]:
    """Draw the figures and pages of everything stored in a folder; answers what to look at."""
    stored = [(command, file.name.removesuffix(marker.lstrip("*")))
              for command, (marker, *_) in KINDS.items() for file in sorted(folder.glob(marker))
              if command != "solve" or _is_solved(file)]
    if not stored:
        markers = ", ".join(marker for marker, *_ in KINDS.values())
        commands = ", ".join(command_line(*command.split()) for command in KINDS)
        raise InputError(f"holds none of {markers}: only what these wrote is rebuilt: {commands}",
                         file=folder)
    return [file for command, specimen in stored
            for file in draw_stored(command, folder, specimen)]
