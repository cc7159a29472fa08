"""Every kind of folder a command writes with figures in it, and how these are drawn again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tympan.geometry.errors import InputError


@dataclass(frozen=True)
class FolderKind:
    """What one command leaves behind.

    ``marker`` is a pattern of the file that the command writes last; ``draw`` takes that file and
    answers what a person looks at first: the page where there is one, otherwise the figures.
    """

    command: str
    marker: str
    draw: Callable[[Path], list[Path]]


def _study(marker: Path) -> list[Path]:
    from tympan.reports.study.page import build_study_page

    return [build_study_page(marker.parent)]


def _diagnosis(marker: Path) -> list[Path]:
    from tympan.reports.diagnosis.page import build_diagnosis_page

    return [build_diagnosis_page(marker.parent)]


def _paper(marker: Path) -> list[Path]:
    from tympan.reports.paper.page import build_paper_page

    return [build_paper_page(marker.parent)]


def _modes(marker: Path) -> list[Path]:
    from tympan.reports.figures.modes import draw_modes
    from tympan.studies.modes import ModesResult

    return draw_modes(ModesResult.load(marker.parent, marker.stem.removesuffix("-modes")),
                      marker.parent)


def _path(marker: Path) -> list[Path]:
    from tympan.reports.figures.path import draw_path
    from tympan.studies.path import PathResult

    return draw_path(PathResult.load(marker.parent, marker.stem.removesuffix("-path")),
                     marker.parent)


def _outlines(marker: Path) -> list[Path]:
    from tympan.reports.figures.outlines import draw_outlines
    from tympan.studies.alpha.table import OutlineTable

    return draw_outlines(OutlineTable.load(marker.parent), marker.parent)


def _map(marker: Path) -> list[Path]:
    from tympan.reports.figures.map import draw_map
    from tympan.studies.alpha.map import AlphaMap

    return draw_map(AlphaMap.load(marker.parent), marker.parent)


def _optimum(marker: Path) -> list[Path]:
    from tympan.reports.figures.optimum import draw_optimum
    from tympan.studies.optimise.result import OptimiseResult

    return draw_optimum(OptimiseResult.load(marker.parent), marker.parent)


def _simulate(marker: Path) -> list[Path]:
    from tympan.reports.figures.response import draw_simulated
    from tympan.studies.lumped.response import SimulationResult

    return draw_simulated(SimulationResult.load(marker.parent), marker.parent)


def _build(marker: Path) -> list[Path]:
    from tympan.reports.figures.lumped_model import draw_built
    from tympan.studies.lumped.build_result import BuildResult

    return draw_built(BuildResult.load(marker.parent), marker.parent)


def _identify(marker: Path) -> list[Path]:
    from tympan.reports.figures.identification import draw_identified
    from tympan.studies.identify.result import IdentifyResult

    return draw_identified(IdentifyResult.load(marker.parent), marker.parent)


def _material_fit(marker: Path) -> list[Path]:
    from tympan.reports.figures.coupon import draw_fit
    from tympan.studies.material.result import MaterialFitResult

    return draw_fit(MaterialFitResult.load(marker.parent), marker.parent)


KINDS = (
    FolderKind("study", "study.json", _study),
    FolderKind("modes", "*-modes.json", _modes),
    FolderKind("path", "*-path.json", _path),
    FolderKind("outlines", "outlines.json", _outlines),
    FolderKind("map", "alpha-map.json", _map),
    FolderKind("optimise", "optimum.json", _optimum),
    FolderKind("material fit", "fit.json", _material_fit),
    FolderKind("diagnose", "diagnosis.json", _diagnosis),
    FolderKind("lumped paper", "paper.json", _paper),
    FolderKind("lumped simulate", "simulate.json", _simulate),
    FolderKind("lumped identify", "identify.json", _identify),
    FolderKind("lumped build", "build.json", _build),
)


def rebuild(folder: Path) -> list[Path]:
    """Draw the figures and pages of everything stored in a folder; answers what to look at.

    Raises
    ------
    InputError
        When the folder holds nothing that can be drawn, or something in it is damaged.
    """
    stored = [(kind, marker) for kind in KINDS for marker in sorted(folder.glob(kind.marker))]
    if not stored:
        markers = ", ".join(kind.marker for kind in KINDS)
        commands = ", ".join(f"tympan {kind.command}" for kind in KINDS)
        raise InputError(f"holds none of {markers}: only what these wrote is rebuilt: {commands}",
                         file=folder)
    return [file for kind, marker in stored for file in kind.draw(marker)]
