"""Every kind of folder a command writes with figures in it, and how these are drawn again."""

from __future__ import annotations

from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from tympan.base.command_line import command_line
from tympan.base.errors import InputError

#: What commands leave behind: a pattern of the file that is written last; what draws the result
#: into a folder, a page where there is one; and the result.
KINDS = {
    "study": ("study.json", "study.page:build_study_page", "study:StudyResult"),
    "solve": ("*.vtu", "figures.film:draw_film", "case:CaseResult"),
    "modes": ("*-modes.json", "figures.modes:draw_modes", "modes:ModesResult"),
    "path": ("*-path.json", "figures.path:draw_path", "path:PathResult"),
    "curve": ("*-curve.json", "figures.curve:draw_curves", "limits.curve:CurveResult"),
    "force": ("*-force.json", "figures.force:draw_force", "force:ForceResult"),
    "sense": ("*-sense.json", "figures.sense:draw_sense", "sense:SenseResult"),
    "tolerance": ("*-tolerance.json", "figures.tolerance:draw_tolerance",
                  "tolerance.result:ToleranceResult"),
    "outlines": ("outlines.json", "figures.alpha:draw_outlines", "alpha.table:OutlineTable"),
    "map": ("alpha-map.json", "figures.alpha:draw_map", "alpha.map:AlphaMap"),
    "sweep": ("sweep.json", "sweep.page:build_sweep_page", "sweep.run:SweepResult"),
    "design": ("design.json", "figures.design:draw_design", "design.result:DesignResult"),
    "material fit": ("fit.json", "figures.coupon:draw_fit", "material.result:MaterialFitResult"),
    "diagnose": ("diagnosis.json", "diagnosis.page:build_diagnosis_page",
                 "diagnosis.result:Diagnosis"),
    "diagnose --self-check": ("self-check.json",
                              "diagnosis.self_check:build_self_check_page",
                              "diagnosis.self_check:SelfCheck"),
    "lumped paper": ("paper.json", "paper.page:build_paper_page", "replica.output:PaperResult"),
    "lumped simulate": ("simulate.json", "figures.response:draw_simulated",
                        "lumped.simulate:ModelResponse"),
    "lumped control": ("control.json", "figures.control:draw_control",
                       "lumped.control.result:ControlResult"),
    "transient": ("transient.json", "figures.response:draw_simulated",
                  "transient:FieldResponse"),
    "response": ("*-response.json", "figures.harmonic:draw_response", "response:ResponseResult"),
    "lumped identify": ("identify.json", "figures.identification:draw_identified",
                        "identify.result:IdentifyResult"),
    "lumped build": ("build.json", "figures.lumped_model:draw_built", "lumped.build:BuildResult"),
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
    result = resolve_name(f"tympan.studies.{stored}").load(folder, *names)
    return list(resolve_name(f"tympan.reports.{draw}")(result, folder))


def draw_result(result: Any, folder: Path) -> list[Path]:
    """Draw a result that was just saved into a folder, as the command of its kind does."""
    for command, (_, _, stored) in KINDS.items():
        if (stored.endswith(f":{type(result).__name__}")
                and resolve_name(f"tympan.studies.{stored}") is type(result)):
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
