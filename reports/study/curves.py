"""Deflection against voltage of all specimens, one panel per mass: the paper's Figs. 7 and 8."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.reports.figures.curve import draw_curve, frame_curves, make_room
from tympan.reports.scales import rows_of_panels
from tympan.reports.study.view import StudyView

#: Height above an axis for its title [mm].
_TITLE = 7.0
#: Height of an axis [mm].
_PANEL = 60.0

#: Width on the left of an axis for its numbers and words [mm].
_LEFT = 13.0
#: Width on the right, for half of the last number [mm].
_RIGHT = 3.0
#: Width between two panels [mm].
_GAP = 6.0


def draw_study_curves(run: StudyView, folder: Path) -> list[Path]:
    """Draw folder/curves.png and .svg; return the files."""
    return style.save_figure(folder, "curves", lambda: compose_curves(run))


def compose_curves(run: StudyView) -> Figure:
    """Draw one panel per mass, all with the same limits."""
    curves = [(specimen.name, curve) for specimen in run.specimens for curve in specimen.curves]
    numbers = {key: number for number, key in enumerate(dict.fromkeys(
        (name, curve.drive) for name, curve in curves))}
    masses = sorted({curve.mass for *_, curve in curves})
    rows = rows_of_panels(len(masses), most=2)
    width = (style.WIDTH - _LEFT - _RIGHT - _GAP) / 2 if len(rows[0]) > 1 else 110.0
    lefts = style.centred([width] * len(rows[0]), _GAP, _LEFT, _RIGHT)
    height = _TITLE + _PANEL + style.AXIS
    figure = style.new_figure(len(rows) * height)
    placed: list[list[Axes]] = [[] for _ in rows]
    for number, row in enumerate(rows):
        for column, panel in enumerate(row):
            axes = style.place_axes(figure, lefts[column], number * height + _TITLE, width, _PANEL)
            for name, curve in curves:
                if curve.mass == masses[panel]:
                    draw_curve(axes, curve, numbers[name, curve.drive], curve.named(name),
                               len(numbers))
            style.describe(axes, "voltage (kV)", "deflection (mm)" if column == 0 else "",
                           f"{masses[panel]:g} g", bold=True)
            axes.tick_params(labelleft=column == 0)
            placed[number].append(axes)
    first, *others = chain.from_iterable(placed)
    frame_curves(first, [curve for *_, curve in curves], *others, below=True)
    make_room(figure, placed, _TITLE)
    return figure
