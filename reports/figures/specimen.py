"""A specimen before it is solved: outlines, electrode and sizes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon
from matplotlib.patheffects import withStroke

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

#: Depth of places in a segment where its name may be, over the largest one.
_DEEP = 0.95

#: Colour of the film.
_FILM = "#e9e2d0"
#: Colour of the film under an electrode.
_COVERED = "#9aa5b1"
#: Colour of bare film beside segments, which have colours of their own.
_BARE = "#d9dbde"
#: Colour of the plate.
_PLATE = "#4d5763"

#: Height of a line of the legend of segments [mm].
_LINE = 4.5
#: Distances of that legend from what is above it, and from the page's lower edge [mm].
_ABOVE = 1.5
_BELOW = 1.0
#: Segments in a line of their legend.
_ABREAST = 4


def draw_specimen(specimen: Specimen, folder: Path, voltage: float | None = None) -> list[Path]:
    """Draw folder/NAME-specimen.png and .svg; return the files.

    ``voltage`` is that of the film [V]: each segment's own is written in the legend.
    """
    return style.save_figure(folder, f"{specimen.name}-specimen",
                             lambda: _compose(specimen, voltage))


def _compose(specimen: Specimen, voltage: float | None) -> Figure:
    a, b = specimen.frame.semi_axes
    width = min(1.0, a / b) * (_WIDTH - _ROOM - _MARGIN)
    height = width * b / a
    words = segment_words(specimen, voltage)
    page = _TITLE + height + _ROOM + legend_height(len(words))
    figure = style.new_figure(page, _WIDTH)
    axes = style.place_axes(figure, (_WIDTH - _ROOM - width + _MARGIN) / 2, _TITLE, width, height)
    draw_to_scale(specimen, axes)
    add_segment_legend(figure, words)
    for down, text, size in ((3.5, specimen.name, 9.0), (8.0, _film(specimen), 7.5),
                              (11.5, _room(specimen), 7.5)):
        figure.text(0.5, 1 - down / page, text, ha="center", va="center", fontsize=size,
                    weight="bold" if down < 4 else "normal")
    return figure


def _room(specimen: Specimen) -> str:
    gap = f"{1e3 * specimen.gap:.4g} mm"
    room = f"narrowest gap {gap}" if specimen.plate else f"no plate; centre {gap} from the frame"
    segments = specimen.electrode.segments
    return f"{room}; {'coloured' if segments else 'dark'} film: under the electrode"


def segment_words(specimen: Specimen, voltage: float | None = None) -> dict[str, str]:
    """Write the voltage of each segment, by its name; without one its share, unless it is all."""
    segments = specimen.electrode.segments
    if voltage is not None:
        return {name: f"{own / 1e3:.4g} kV"
                for name, own in specimen.electrode.voltages(voltage).items()}
    shares = {each.name: f"{100 * each.share:.4g} % of the voltage" if each.share else "grounded"
              for each in segments}
    return shares | {each.name: "" for each in segments if each.share == 1}


def segment_handles(words: Mapping[str, str]) -> list[Patch]:
    """Make the entries of a legend of segments, in their colours."""
    return [Patch(facecolor=colour, label=f"{name}  {text}".rstrip())
            for colour, (name, text) in zip(style.segment_colours(len(words)), words.items(),
                                            strict=True)]


def legend_height(count: int) -> float:
    """Compute the height of a legend of segments [mm]; 0 without segments."""
    lines = -(-count // _ABREAST)
    return _ABOVE * bool(lines) + _LINE * lines


def add_segment_legend(figure: Figure, words: Mapping[str, str]) -> None:
    """Add a legend of segments at the lower edge of a page; none without segments."""
    if words:
        below = _BELOW * style.MM / figure.get_size_inches()[1]
        figure.legend(handles=segment_handles(words), ncols=_ABREAST, loc="lower center",
                      bbox_to_anchor=(0.5, below), handlelength=1.2)


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
    axes.add_patch(Polygon(1e3 * frame.points(_POINTS).T, closed=True,
                           facecolor=_BARE if specimen.electrode.segments else _FILM,
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
    if not electrode.segments:
        axes.contourf(1e3 * x, 1e3 * y, depth, [0.0, np.inf], colors=[_COVERED], zorder=1)
    colours = style.segment_colours(len(electrode.segments))
    for colour, segment in zip(colours, electrode.segments, strict=True):
        within = np.minimum(depth, -segment.level(x, y, frame, electrode.gap))
        axes.contourf(1e3 * x, 1e3 * y, within, [0.0, np.inf], colors=[colour], zorder=1)
        # A border between two colours shows where no gap does.
        axes.contour(1e3 * x, 1e3 * y, within, [0.0], colors="white", linewidths=0.6, zorder=1)
        if specimen.plate is not None:
            within = np.minimum(within, specimen.plate.level(x, y))
        right, up = _middle(x, y, np.minimum(within, -frame.level(x, y)))
        axes.text(1e3 * right, 1e3 * up, segment.name, ha="center", va="center", fontsize=8,
                  weight="bold", color="white", zorder=4,
                  path_effects=[withStroke(linewidth=2.5, foreground=colour)])


def _middle(x: Array, y: Array, depth: Array) -> tuple[float, float]:
    """Find a place for a word in a region: where it is deepest, near the middle of such places."""
    deep = depth >= _DEEP * depth.max()
    x, y = x[deep], y[deep]
    nearest = np.argmin(np.hypot(x - x.mean(), y - y.mean()))
    return float(x[nearest]), float(y[nearest])


def _dimensions(specimen: Specimen, axes: Axes) -> None:
    """Draw sizes from edge to edge: the frame's outside the drawing, the plate's on it."""
    a, b = (1e3 * length for length in specimen.frame.semi_axes)
    size = max(a, b)
    away = 0.09 * size
    below, beside = -b - away, a + away
    _arrow(axes, (-a, below), (a, below), f"frame {2 * a:.4g} mm", across=True)
    _arrow(axes, (beside, -b), (beside, b), f"{2 * b:.4g} mm", across=False)
    if specimen.plate is not None or not specimen.electrode.segments:
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
                  fontsize=7.5, zorder=4,
                  bbox={"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.5}
                  if specimen.electrode.segments else None)


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float], words: str,
           across: bool) -> None:
    """Draw a line with two heads, its length beside it."""
    axes.annotate("", start, end, annotation_clip=False,
                  arrowprops={"arrowstyle": "<->", "linewidth": 0.6, "shrinkA": 0, "shrinkB": 0})
    middle = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    axes.annotate(words, middle, (0, -3) if across else (3, 0), textcoords="offset points",
                  annotation_clip=False, fontsize=7.5, rotation=0 if across else 90,
                  ha="center" if across else "left", va="top" if across else "center")
