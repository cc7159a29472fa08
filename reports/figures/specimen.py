"""A specimen before it is solved: outlines, electrode and sizes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from tympan.base.arrays import Array
from tympan.geometry.specimen import Specimen
from tympan.reports import look as style

#: Width of the picture [mm].
_WIDTH = 110.0
#: Margin on the right [mm].
_MARGIN = 6.0
#: Height above for the name and two lines on the film [mm].
_TITLE = 15.0
#: Margin on the left and below for the numbers and words of the axes [mm].
_ROOM = 14.0

#: Number of points of an outline, enough for a smooth line.
_POINTS = 721
#: Number of points along either side that show the covered part: no steps are visible.
_GRID = 240

#: Colour of the film.
_FILM = "#e9e2d0"
#: Colour of the film under an electrode.
_COVERED = "#9aa5b1"
#: Colour of the plate.
_PLATE = "#4d5763"


def draw_specimen(specimen: Specimen, folder: Path) -> list[Path]:
    """Draw folder/NAME-specimen.png and .svg; return the files."""
    return style.save_figure(folder, f"{specimen.name}-specimen", lambda: _compose(specimen))


def _compose(specimen: Specimen) -> Figure:
    a, b = specimen.frame.semi_axes
    width = min(1.0, a / b) * (_WIDTH - _ROOM - _MARGIN)
    height = width * b / a
    figure = style.new_figure(_TITLE + height + _ROOM, _WIDTH)
    axes = style.place_axes(figure, (_WIDTH - _ROOM - width + _MARGIN) / 2, _TITLE, width, height)
    draw_to_scale(specimen, axes)
    for down, words, size in ((3.5, specimen.name, 9.0), (8.0, _film(specimen), 7.5),
                              (11.5, _room(specimen), 7.5)):
        figure.text(0.5, 1 - down / (_TITLE + height + _ROOM), words, ha="center", va="center",
                    fontsize=size, weight="bold" if down < 4 else "normal")
    return figure


def _room(specimen: Specimen) -> str:
    gap = f"{1e3 * specimen.gap:.4g} mm"
    room = f"narrowest gap {gap}" if specimen.plate else f"no plate; centre {gap} from the frame"
    return f"{room}; dark film: under the electrode"


def _film(specimen: Specimen) -> str:
    film = specimen.membrane
    several = f"{film.layers} films, each " if film.layers > 1 else "film "
    return (f"{several}{1e6 * film.thickness / film.area_prestretch:.4g} µm mounted: "
            f"{1e6 * film.thickness:.4g} µm stretched by {film.prestretch[0]:.4g}, "
            f"{film.prestretch[1]:.4g}")


def draw_to_scale(specimen: Specimen, axes: Axes) -> None:
    """Draw film, electrode and plate to scale on axes [mm], with their sizes."""
    frame, plate = specimen.frame, specimen.plate
    a, b = (1e3 * length for length in frame.semi_axes)
    axes.add_patch(Polygon(1e3 * frame.points(_POINTS).T, closed=True, facecolor=_FILM,
                           edgecolor="none", zorder=0))
    _cover(specimen, axes)
    if plate is not None:
        axes.add_patch(Polygon(1e3 * plate.points(_POINTS).T, closed=True, facecolor=_PLATE,
                               edgecolor="black", linewidth=0.6, zorder=2))
    axes.add_patch(Polygon(1e3 * frame.points(_POINTS).T, closed=True, facecolor="none",
                           edgecolor="black", linewidth=1.3, zorder=3, clip_on=False))
    axes.set(xlim=(-a, a), ylim=(-b, b), aspect="equal")
    axes.axis("off")
    _dimensions(specimen, axes)


def _cover(specimen: Specimen, axes: Axes) -> None:
    """Shade the part under the electrode."""
    electrode, frame = specimen.electrode, specimen.frame
    a, b = frame.semi_axes
    x, y = np.meshgrid(np.linspace(-a, a, _GRID), np.linspace(-b, b, _GRID))
    depth: Array = -frame.level(x, y) - electrode.margin_frame
    if specimen.plate is not None:
        depth = np.minimum(depth, specimen.plate.level(x, y) - electrode.margin_plate)
    if electrode.outline is not None:
        depth = np.minimum(depth, -electrode.outline.level(x, y))
    for patch in electrode.patches:
        away = np.hypot(x - patch.centre[0], y - patch.centre[1])
        depth = np.minimum(depth, away - patch.diameter / 2)
    axes.contourf(1e3 * x, 1e3 * y, depth, [0.0, np.inf], colors=[_COVERED], zorder=1)


def _dimensions(specimen: Specimen, axes: Axes) -> None:
    """Draw sizes from edge to edge: the frame's outside the drawing, the plate's on it."""
    a, b = (1e3 * length for length in specimen.frame.semi_axes)
    size = max(a, b)
    away = 0.09 * size
    below, beside = -b - away, a + away
    _arrow(axes, (-a, below), (a, below), f"frame {2 * a:.4g} mm", across=True)
    _arrow(axes, (beside, -b), (beside, b), f"{2 * b:.4g} mm", across=False)
    axes.plot([0], [0], "+", color="white", markersize=5, markeredgewidth=0.8, zorder=4)
    if specimen.plate is None:
        return
    c, d = (1e3 * length for length in specimen.plate.outline.semi_axes)
    x, y = (1e3 * length for length in specimen.plate.offset)
    other = "" if abs(c - d) < 1e-6 else f" × {2 * d:.4g}"
    words = f"plate {2 * c:.4g}{other} mm"
    if x or y:
        words += f"\nat {x:.4g}, {y:.4g} mm"
    edge = y + d
    axes.annotate(words, (x, edge), (x, edge + 0.06 * size), ha="center", va="bottom",
                  fontsize=7.5, zorder=4)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], words: str,
           across: bool) -> None:
    """Draw a line with two heads, its length beside it."""
    axes.annotate("", start, end, annotation_clip=False,
                  arrowprops={"arrowstyle": "<->", "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0})
    middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    axes.annotate(words, middle, (0, -3) if across else (3, 0), textcoords="offset points",
                  annotation_clip=False, fontsize=7.5, rotation=0 if across else 90,
                  ha="center" if across else "left", va="top" if across else "center")
