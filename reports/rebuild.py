"""Drawing of results into a folder: from memory for a command, from files for ``report``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from tympan.base.command_line import command_line
from tympan.base.errors import InputError


@dataclass(frozen=True)
class DrawnKind:
    """A kind of result that a command stores with figures.

    ``marker``: pattern of the file that the command writes last. ``function``: draws a ``result``
    of this class into a folder. ``loader``: class whose ``load`` reads the result back, if that is
    not the result's own class.
    """

    marker: str
    function: str
    result: str
    loader: str = ""

    def draw(self, result: Any, folder: Path) -> list[Path]:
        """Draw a result into a folder; return its page, or its figures where it has no page."""
        return list(resolve_name(f"tympan.{self.function}")(result, folder))

    def load(self, file: Path) -> Any:
        """Read the result of its last file."""
        stored = resolve_name(f"tympan.{self.loader or self.result}")
        names = [file.name.removesuffix(self.marker.lstrip("*"))] if "*" in self.marker else []
        return stored.load(file.parent, *names)


#: Kinds of results by the command that stores them; the fields of each are names within tympan.
_KINDS = {
    "study": ("study.json", "reports.study.page:build_study_page", "studies.study:StudyResult"),
    "solve": ("*.vtu", "reports.figures.film:draw_film", "studies.case:CaseResult"),
    "modes": ("*-modes.json", "reports.figures.modes:draw_modes", "studies.modes:ModesResult"),
    "path": ("*-path.json", "reports.figures.path:draw_path", "studies.path:PathResult"),
    "curve": (
        "*-curve.json", "reports.figures.curve:draw_curves", "studies.limits.curve:CurveResult"),
    "force": (
        "*-force.json", "reports.figures.force:draw_force", "studies.force.result:ForceResult"),
    "sense": (
        "*-sense.json", "reports.figures.sense:draw_sense", "studies.sense.result:SenseResult"),
    "steer": (
        "*-steer.json", "reports.figures.steer:draw_steer", "studies.steer:SteerResult"),
    "tolerance": (
        "*-tolerance.json", "reports.figures.tolerance:draw_tolerance",
        "studies.tolerance.result:ToleranceResult"),
    "outlines": (
        "outlines.json", "reports.figures.alpha:draw_outlines", "studies.alpha.table:OutlineTable"),
    "map": ("alpha-map.json", "reports.figures.alpha:draw_map", "studies.alpha.map:AlphaMap"),
    "sweep": ("sweep.json", "reports.sweep.page:build_sweep_page", "studies.sweep.run:SweepResult"),
    "design": (
        "design.json", "reports.figures.design:draw_design", "studies.design.result:DesignResult"),
    "material fit": (
        "fit.json", "reports.figures.coupon:draw_fit", "studies.material.result:MaterialFitResult"),
    "diagnose": (
        "diagnosis.json", "reports.diagnosis.page:build_diagnosis_page",
        "studies.diagnosis.result:Diagnosis"),
    "diagnose --self-check": (
        "self-check.json", "reports.diagnosis.self_check:build_self_check_page",
        "studies.diagnosis.self_check:SelfCheck"),
    "lumped paper": ("paper.json", "paper.page:build_paper_page", "paper.output:PaperResult"),
    "lumped simulate": (
        "simulate.json", "reports.figures.response:draw_simulated", "studies.trace:Responses",
        "studies.lumped.simulate:ModelResponse"),
    "lumped control": (
        "control.json", "reports.figures.control:draw_control",
        "studies.lumped.control.result:ControlResult"),
    "lumped steer": (
        "*-steered.json", "reports.figures.steered:draw_steered",
        "studies.lumped.steered.result:SteeredResult"),
    "transient": (
        "transient.json", "reports.figures.response:draw_simulated", "studies.trace:Responses",
        "studies.transient:FieldResponse"),
    "response": (
        "*-response.json", "reports.figures.harmonic:draw_response",
        "studies.response:ResponseResult"),
    "lumped identify": (
        "identify.json", "reports.figures.identification:draw_identified",
        "studies.identify.result:IdentifyResult"),
    "lumped build": (
        "build.json", "reports.figures.lumped_model:draw_built",
        "studies.lumped.build:BuildResult"),
}
KINDS = {command: DrawnKind(*strings) for command, strings in _KINDS.items()}
_BY_RESULT = {f"tympan.{kind.result}": kind for kind in KINDS.values()}


def draw_result(result: Any, folder: Path) -> list[Path]:
    """Draw a result into the folder it was saved in; return what to look at, if anything.

    Its numbers have the digits of its files, so that :func:`rebuild` draws the same pictures.
    """
    for cls in type(result).__mro__:
        if (kind := _BY_RESULT.get(f"{cls.__module__}:{cls.__qualname__}")) is not None:
            return kind.draw(getattr(result, "as_stored", lambda: result)(), folder)
    return []


def _is_solved(film: Path) -> bool:
    """Check if a film is that of ``solve``: no other command writes a record of that name."""
    numbers = film.with_suffix(".json")
    return numbers.is_file() and not any(numbers.match(kind.marker) for kind in KINDS.values())


def rebuild(folder: Path) -> list[Path]:
    """Draw the figures and pages of everything stored in a folder; return what to look at."""
    return [drawn for kind, file in stored_results(folder)
            for drawn in kind.draw(kind.load(file), file.parent)]


def stored_results(folder: Path) -> list[tuple[DrawnKind, Path]]:
    """List the results that are stored in a folder, with the last file of each."""
    stored = [(kind, file) for command, kind in KINDS.items()
              for file in sorted(folder.glob(kind.marker))
              if command != "solve" or _is_solved(file)]
    if not stored:
        markers = ", ".join(kind.marker for kind in KINDS.values())
        commands = ", ".join(command_line(*command.split()) for command in KINDS)
        raise InputError(f"holds none of {markers}: only what these wrote is rebuilt: {commands}",
                         file=folder)
    return stored
