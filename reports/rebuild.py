"""Every kind of folder a command writes with figures in it, and how these are drawn again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name

from tympan.geometry.errors import InputError


@dataclass(frozen=True)
class FolderKind:
    """What one command leaves behind.

    ``marker`` is a pattern of the file that the command writes last; ``draw`` names what draws the
    folder, a page where there is one; or the ``result`` stored in it.
    """

    command: str
    marker: str
    draw: str
    result: str = ""

    def rebuild(self, marker: Path) -> list[Path]:
        """Draw again; answers what a person looks at first: the page, otherwise the figures."""
        draw = resolve_name(f"tympan.reports.{self.draw}")
        if not self.result:
            return [draw(marker.parent)]
        # Where a folder holds the results of several specimens, the marker says of which.
        names = [marker.name.removesuffix(self.marker[1:])] if self.marker[0] == "*" else []
        load = resolve_name(f"tympan.studies.{self.result}").load
        return list(draw(load(marker.parent, *names), marker.parent))


KINDS = (
    FolderKind("study", "study.json", "study.page:build_study_page"),
    FolderKind("modes", "*-modes.json", "figures.modes:draw_modes", "modes:ModesResult"),
    FolderKind("path", "*-path.json", "figures.path:draw_path", "path:PathResult"),
    FolderKind("outlines", "outlines.json", "figures.outlines:draw_outlines",
               "alpha.table:OutlineTable"),
    FolderKind("map", "alpha-map.json", "figures.map:draw_map", "alpha.map:AlphaMap"),
    FolderKind("optimise", "optimum.json", "figures.optimum:draw_optimum",
               "optimise.optimise:OptimiseResult"),
    FolderKind("material fit", "fit.json", "figures.coupon:draw_fit",
               "material.result:MaterialFitResult"),
    FolderKind("diagnose", "diagnosis.json", "diagnosis.page:build_diagnosis_page"),
    FolderKind("lumped paper", "paper.json", "paper.page:build_paper_page"),
    FolderKind("lumped simulate", "simulate.json", "figures.response:draw_simulated",
               "lumped.response:SimulationResult"),
    FolderKind("lumped identify", "identify.json", "figures.identification:draw_identified",
               "identify.result:IdentifyResult"),
    FolderKind("lumped build", "build.json", "figures.lumped_model:draw_built",
               "lumped.build:BuildResult"),
)


def draw_stored(command: str, folder: Path, specimen: str) -> list[Path]:
    """Draw what a command, such as "lumped build", stored in a folder; answers what to look at.

    ``specimen`` is the one it is of, where a folder may hold the results of several.
    """
    return [file for kind in KINDS if kind.command == command
            for file in kind.rebuild(folder / kind.marker.replace("*", specimen))]


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
    return [file for kind, marker in stored for file in kind.rebuild(marker)]
