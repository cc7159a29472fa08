"""Results drawn into a folder: by a command from memory, by ``report`` from what is stored."""

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

    ``marker``: pattern of the file that the command writes last. ``function``: it draws a
    ``result`` of this class into a folder. ``loader``: class whose ``load`` reads the result back,
    where that is not the result's own.
    """

    marker: str
    function: str
    result: str
    loader: str = ""

    def draw(self, result: Any, folder: Path) -> list[Path]:
        """Draw a result into a folder; answers its page, or its figures where it has no page."""
        return list(resolve_name(f"tympan.reports.{self.function}")(result, folder))

    def draw_stored(self, file: Path) -> list[Path]:
        """Draw the result again whose last file this is."""
        stored = resolve_name(f"tympan.studies.{self.loader or self.result}")
        names = [file.name.removesuffix(self.marker.lstrip("*"))] if "*" in self.marker else []
        return self.draw(stored.load(file.parent, *names), file.parent)


#: Kinds of results by the command that stores them: the fields of each.
_KINDS = {
    "study": ("study.json", "study.page:build_study_page", "study:StudyResult"),
    "solve": ("*.vtu", "figures.film:draw_film", "case:CaseResult"),
    "modes": ("*-modes.json", "figures.modes:draw_modes", "modes:ModesResult"),
    "path": ("*-path.json", "figures.path:draw_path", "path:PathResult"),
    "curve": ("*-curve.json", "figures.curve:draw_curves", "limits.curve:CurveResult"),
    "force": ("*-force.json", "figures.force:draw_force", "force.result:ForceResult"),
    "sense": ("*-sense.json", "figures.sense:draw_sense", "sense.result:SenseResult"),
    "tolerance": ("*-tolerance.json", "figures.tolerance:draw_tolerance",
                  "tolerance.result:ToleranceResult"),
    "outlines": ("outlines.json", "figures.alpha:draw_outlines", "alpha.table:OutlineTable"),
    "map": ("alpha-map.json", "figures.alpha:draw_map", "alpha.map:AlphaMap"),
    "sweep": ("sweep.json", "sweep.page:build_sweep_page", "sweep.run:SweepResult"),
    "design": ("design.json", "figures.design:draw_design", "design.result:DesignResult"),
    "material fit": ("fit.json", "figures.coupon:draw_fit", "material.result:MaterialFitResult"),
    "diagnose": ("diagnosis.json", "diagnosis.page:build_diagnosis_page",
                 "diagnosis.result:Diagnosis"),
    "diagnose --self-check": ("self-check.json", "diagnosis.self_check:build_self_check_page",
                              "diagnosis.self_check:SelfCheck"),
    "lumped paper": ("paper.json", "paper.page:build_paper_page", "replica.output:PaperResult"),
    "lumped simulate": ("simulate.json", "figures.response:draw_simulated", "trace:Responses",
                        "lumped.simulate:ModelResponse"),
    "lumped control": ("control.json", "figures.control:draw_control",
                       "lumped.control.result:ControlResult"),
    "transient": ("transient.json", "figures.response:draw_simulated", "trace:Responses",
                  "transient:FieldResponse"),
    "response": ("*-response.json", "figures.harmonic:draw_response", "response:ResponseResult"),
    "lumped identify": ("identify.json", "figures.identification:draw_identified",
                        "identify.result:IdentifyResult"),
    "lumped build": ("build.json", "figures.lumped_model:draw_built", "lumped.build:BuildResult"),
}
KINDS = {command: DrawnKind(*strings) for command, strings in _KINDS.items()}
_BY_RESULT = {f"tympan.studies.{kind.result}": kind for kind in KINDS.values()}


def draw_result(result: Any, folder: Path) -> list[Path]:
    """Draw a result into the folder it was saved in; answers what to look at, if anything.

    Its numbers have the digits of its files, so that :func:`rebuild` draws the same pictures.
    """
    for cls in type(result).__mro__:
        if (kind := _BY_RESULT.get(f"{cls.__module__}:{cls.__qualname__}")) is not None:
            return kind.draw(getattr(result, "as_stored", lambda: result)(), folder)
    return []


def _is_solved(film: Path) -> bool:
    """Whether a film is that of ``solve``, which has numbers of its name that no other writes."""
    numbers = film.with_suffix(".json")
    return numbers.is_file() and not any(numbers.match(kind.marker) for kind in KINDS.values())


def rebuild(folder: Path) -> list[Path]:
    """Draw the figures and pages of everything stored in a folder; answers what to look at."""
    stored = [(kind, file) for command, kind in KINDS.items()
              for file in sorted(folder.glob(kind.marker))
              if command != "solve" or _is_solved(file)]
    if not stored:
        markers = ", ".join(kind.marker for kind in KINDS.values())
        commands = ", ".join(command_line(*command.split()) for command in KINDS)
        raise InputError(f"holds none of {markers}: only what these wrote is rebuilt: {commands}",
                         file=folder)
    return [drawn for kind, file in stored for drawn in kind.draw_stored(file)]
