"""Deformed membranes side by side in colours of stress, and stress along their axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from tympan.reports import look as style
from tympan.reports.scales import (
    AxisScale,
    bar_length,
    column_widths,
    paper_scale,
    round_scale,
    rows_of_panels,
)
from tympan.reports.scene import View, film_picture
from tympan.reports.study.view import SpecimenView, StudyView
from tympan.reports.template import digits

#: Width on the left of the page for the numbers and words of an axis [mm].
_LEFT = 13.0
#: Width on the right of the page [mm].
_RIGHT = 2.0
#: Width between columns [mm].
_GAP = 5.0

#: Height above a film for its name [mm].
_TITLE = 9.5
#: Height below the first row for colour bar, scale bar and the meaning of the lines [mm].
_BAR = 19.0
#: Height between rows [mm].
_SPACE = 4.0
#: Height of the curves below a film [mm].
_PANEL = 38.0
#: Height below an axis for its numbers and words [mm].
_AXIS = 11.0

#: Narrowest column [mm], wide enough for the numbers of its axis.
_LEAST = 36.0
#: Widest film [mm]: half of the page, so that a single film does not fill it.
_MOST = 85.0
#: Space for a film's outline, over its width.
_ROOM = 1.02


@dataclass(frozen=True, eq=False)
class FigureLayout:
    """Every number of the figure: one scale of paper, colours and view for all membranes.

    ``paper`` is mm of paper per mm of membrane, ``columns`` the widths of each row's columns on
    paper [mm], ``reach`` mm of the curves' abscissa per mm of paper.
    """

    rows: tuple[range, ...]
    columns: tuple[tuple[float, ...], ...]
    paper: float
    reach: float
    view: View


def draw_stress(run: StudyView, folder: Path) -> list[Path]:
    """Draw folder/stress.png, .pdf and .svg; return the files."""
    design = lay_out(run.specimens, run.stress_range)
    pictures = [specimen_picture(specimen, design.view) for specimen in run.specimens]
    return style.save_figure(folder, "stress", lambda: compose_stress(run, design, pictures),
                             ("png", "pdf", "svg"))


def specimen_picture(specimen: SpecimenView, view: View) -> style.Picture:
    """Draw the film in colours of its largest true stress, the long axis across."""
    return film_picture(specimen.film, specimen.stress, view,
                        specimen.semi_axes[1] > specimen.semi_axes[0])


def lay_out(specimens: Sequence[SpecimenView], stress: tuple[float, float]) -> FigureLayout:
    """Lay the figure out for films whose stress lies between two values [kPa]."""
    widths = [2 * max(item.semi_axes) for item in specimens]
    rows = rows_of_panels(len(specimens))
    films = [[_ROOM * widths[index] for index in row] for row in rows]
    paper = paper_scale(films, style.WIDTH - _LEFT - _RIGHT, _GAP, _LEAST, _MOST)
    columns = tuple(tuple(column_widths(row, paper, _LEAST)) for row in films)
    flat = (width for row in columns for width in row)
    reach = max(float(side.distance[-1]) / width
                for item, width in zip(specimens, flat, strict=True)
                for line in (item.along_x, item.along_y) for side in line.sides)
    # Pixels are those of the print, each the average of four, which makes smooth edges.
    view = View(style.DPI * style.MM * paper, style.DPI * 0.7 / 72, round_scale(*stress),
                bar_length(max(widths)) / 2, samples=2)
    return FigureLayout(tuple(rows), columns, paper, 1.03 * reach, view)


def compose_stress(run: StudyView, design: FigureLayout, pictures: Sequence[style.Picture]
                   ) -> Figure:
    """Put pictures, colour bar and curves on one page."""
    sizes = [upper - lower for _, (_, _, lower, upper) in pictures]
    heights = [max(sizes[index] for index in row) * design.paper for row in design.rows]
    figure = style.new_figure(sum(heights) + len(heights) * (_TITLE + _PANEL + _AXIS) + _BAR
                              + (len(heights) - 1) * _SPACE)
    top = 0.0
    for row, columns, height in zip(design.rows, design.columns, heights, strict=True):
        lefts = style.centred(columns, _GAP, _LEFT, _RIGHT)
        for start, width, index in zip(lefts, columns, row, strict=True):
            axes = style.place_axes(figure, start, top + _TITLE, width, height)
            specimen = run.specimens[index]
            style.show_picture(
                axes, pictures[index], (specimen.name, 4.2, "bold", 8.5),
                (f"deflection {digits(specimen.deflection)} mm", 0.6, "normal", 7.5),
                interpolation="none")
            *_, bottom, upper = pictures[index][1]
            middle, half = (bottom + upper) / 2, height / design.paper / 2
            axes.set(xlim=(-width / design.paper / 2, width / design.paper / 2),
                     ylim=(middle - half, middle + half))
        top += _TITLE + height
        if row[0] == 0:
            _explain(figure, run, design, top)
        top += _BAR if row[0] == 0 else _SPACE
        for start, width, index in zip(lefts, columns, row, strict=True):
            axes = style.place_axes(figure, start, top, width, _PANEL)
            _panel(axes, run.specimens[index], design, width * design.reach)
            if index == row[0]:
                axes.set_ylabel("largest true stress (kPa)")
            else:
                axes.tick_params(labelleft=False)
        top += _PANEL + _AXIS
        middle = (lefts[0] + lefts[-1] + columns[-1]) / 2
        _write(figure, middle, top - _AXIS + 5.0, "distance from the plate's edge (mm)",
               ha="center", va="top")
    return figure


def end_values(specimen: SpecimenView, scale: AxisScale) -> list[tuple[str, float, str]]:
    """Label the plate's edge: text, stress [kPa] and colour; one entry if both axes agree."""
    short, long = specimen.short.at_plate, specimen.long.at_plate
    texts = [scale.text(value, more=1) for value in (short, long)]
    if specimen.alike or texts[0] == texts[1]:
        mean = (short + long) / 2
        return [(f"{scale.text(mean, more=1)} on both axes", mean, "black")]
    ends = zip(texts, specimen.axes, (short, long), (style.SHORT_TEXT, style.LONG_TEXT),
               strict=True)
    return [(f"{text} on the {axis} axis", value, colour) for text, axis, value, colour in ends]


def _spread(positions: Sequence[float], least: float) -> list[float]:
    """Move positions apart, in order and about their middle, to be at least ``least`` apart.

    Examples
    --------
    >>> _spread([5.0, 4.9], 1.0), _spread([5.0, 1.0], 1.0)
    ([5.45, 4.45], [5.0, 1.0])
    """
    if len(positions) < 2 or abs(positions[0] - positions[1]) >= least:
        return list(positions)
    middle, up = sum(positions) / 2, 1 if positions[0] >= positions[1] else -1
    return [middle + up * least / 2, middle - up * least / 2]


def _explain(figure: Figure, run: StudyView, design: FigureLayout, top: float) -> None:
    """Draw the row below the pictures: scale bar, colour bar, load and meaning of the lines."""
    view, length = design.view, 2 * design.view.net
    bar = style.place_axes(figure, _LEFT, top + 3.5, length * design.paper, 1.0)
    bar.set_axis_off()
    bar.fill_between([0, 1], 0, 1, color="black", linewidth=0)
    bar.set(xlim=(0, 1), ylim=(0, 1))
    _write(figure, _LEFT, top + 5.5,
           f"{length:g} mm, left to right\nnet: {view.net:g} mm of flat film\n"
           f"seen from {view.elevation:g}° above, to scale")
    style.colour_bar(figure, (style.WIDTH + _LEFT - _RIGHT - 70) / 2, top + 3, (70, 2.6),
                     view.scale, view.colours, stress_label(view.scale))
    right = style.WIDTH - _RIGHT - 32.0
    _write(figure, right, top + 2.6, f"load {run.mass:g} g, {run.stored.drive}")
    names = next((item.axes for item in run.specimens if not item.round), run.specimens[0].axes)
    for row, (name, colour, dashes) in enumerate(zip(names, (style.SHORT, style.LONG), ("-", "--"),
                                                     strict=True)):
        down = top + 8.3 + 3.6 * row
        sample = style.place_axes(figure, right, down - 0.5, 8.0, 1.0)
        sample.set_axis_off()
        sample.plot([0, 1], [0, 0], dashes, color=colour, clip_on=False)
        _write(figure, right + 9.5, down, f"{name} axis", va="center")
    if any(item.loose for item in run.specimens):
        sample = style.place_axes(figure, right, top + 14.1, 8.0, 2.8)
        sample.set_axis_off()
        sample.add_patch(Rectangle((0, 0), 1, 1, facecolor="white", edgecolor="black",
                                   hatch="//////", linewidth=0.6))
        _write(figure, right + 9.5, top + 15.5, "loss of tension", va="center")


def stress_label(scale: AxisScale) -> str:
    """Say what colours and curves show, and where the scale starts."""
    start = "" if scale.from_zero else f"; scales start at {scale.start}, not 0"
    return f"largest principal true stress (kPa{start})"


def _panel(axes: Axes, specimen: SpecimenView, design: FigureLayout, reach: float) -> None:
    """Draw stress along both axes up to a distance ``reach`` [mm], and label the plate's edge."""
    limits = design.view.scale
    for line, colour, dashes in ((specimen.short, style.SHORT, "-"),
                                 (specimen.long, style.LONG, (0, (3.2, 1.6)))):
        for side in line.sides:
            axes.plot(side.distance, side.stress, linestyle=dashes, color=colour)
        axes.plot(0, line.at_plate, "o", color=colour, markersize=3, clip_on=False, zorder=3)
    axes.set(xlim=(-0.02 * reach, reach), ylim=(limits.low, limits.high))
    axes.set_yticks(limits.ticks, [limits.text(tick) for tick in limits.ticks])
    values = end_values(specimen, limits)
    least = (limits.high - limits.low) * 3.4 / _PANEL
    places = _spread([value for _, value, _ in values], least)
    for (text, _, colour), place in zip(values, places, strict=True):
        axes.annotate(text, (0, place), (11, 0), textcoords="offset points", va="center",
                      color=colour,
                      bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 0.6})


def _write(figure: Figure, left_edge: float, top: float, text: str, **how: Any) -> None:
    """Write text at a place measured from the page's top left corner [mm]."""
    across, down = figure.get_size_inches() / style.MM
    figure.text(left_edge / across, 1 - top / down, text,
                **{"va": "top", "linespacing": 1.35, **how})
