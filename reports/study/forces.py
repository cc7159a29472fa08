"""Force on the plate against its displacement, one panel for each specimen."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.reports.figures.force import draw_force_curves
from tympan.reports.scales import rows_of_panels
from tympan.studies.force.result import ForceResult

#: Height above an axis for its title [mm].
_TITLE = 7.0
#: Height of an axis [mm].
_PANEL = 60.0
#: Width between two panels, with the numbers of the right one [mm].
_GAP = 16.0
#: Width of a single panel [mm].
_ALONE = 110.0


def draw_study_forces(results: list[ForceResult], folder: Path) -> list[Path]:
    """Draw folder/forces.png and .svg; return the files."""
    return style.save_figure(folder, "forces", lambda: compose_forces(results))


def compose_forces(results: list[ForceResult]) -> Figure:
    """Draw one panel for each specimen: films of other sizes have scales of their own."""
    rows = rows_of_panels(len(results), most=2)
    width = ((style.WIDTH - style.LEFT - style.RIGHT - _GAP) / 2 if len(rows[0]) > 1 else _ALONE)
    lefts = style.centred([width] * len(rows[0]), _GAP, style.LEFT, style.RIGHT)
    height = _TITLE + _PANEL + style.AXIS
    figure = style.new_figure(len(rows) * height)
    for number, row in enumerate(rows):
        for left, panel in zip(lefts, row, strict=False):
            axes = style.place_axes(figure, left, number * height + _TITLE, width, _PANEL)
            draw_force_curves(axes, results[panel])
    return figure
