"""Shapes of small vibrations as small pictures: the film displaced along each mode."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tympan.base.errors import InputError
from tympan.reports import look as style
from tympan.reports.figures.animation import (
    FRAME_DPI,
    common_extent,
    figure_pixels,
    write_frames,
)
from tympan.reports.scales import AxisScale, bar_length, rows_of_panels
from tympan.reports.scene import View, film_picture
from tympan.studies.film_surface import FilmSurface
from tympan.studies.modes import ModesResult

_SWING = 0.22  #: largest displacement drawn, over the frame's smaller half extent
_TURN = 0.4  #: largest rotation of the plate drawn [rad]: straight arrows swell it beyond

#: Margin at the edges of the picture [mm].
_MARGIN = 3.0
#: Width between two modes [mm].
_GAP = 4.0
#: Height above a mode for its name and frequency [mm].
_TITLE = 9.0
#: Height below for the colour bar with its words [mm].
_BAR = 15.0

_MOST = 12  #: modes drawn
_FRAMES = 24  #: number of pictures of one period

#: Colour map of motion up and down.
_COLOURS = "RdBu_r"
#: Colour of the net on the film.
_INK = "#303030"
#: Colour of the lines along its axes.
_AXES = "#808080"


def draw_modes(result: ModesResult, folder: Path) -> list[Path]:
    """Draw the first modes as folder/NAME-modes.png and .svg; return the files, if any."""
    if result.film is None:
        return []
    # More dots than in print: their average makes smooth edges.
    pictures = _pictures(result, 1.0, _view(result, 1.4 * style.DPI))
    return style.save_figure(folder, f"{result.specimen}-modes",
                             lambda: _compose(pictures, result, common_extent(pictures)))


def animate_modes(result: ModesResult, file: Path) -> None:
    """Write the first modes, one period each, as a GIF, and as an MP4 where FFmpeg is installed.

    All modes move at the same pace: the frequency is written beside them.

    Raises
    ------
    InputError
        When there are no modes, or no surface that shows them, or FFmpeg fails.
    """
    if result.film is None:
        raise InputError(f"there is nothing to draw: {'; '.join(result.warnings)}")
    view = _view(result, 2.8 * FRAME_DPI, line=1.0)
    there = [_pictures(result, float(np.cos(phase)), view)
             for phase in np.linspace(0.0, np.pi, _FRAMES // 2 + 1)]
    extent = common_extent(picture for pictures in there for picture in pictures)
    with style.figure_style():
        frames = [figure_pixels(_compose(pictures, result, extent)) for pictures in there]
    # The way back repeats the frames in reverse, without the first and the last one.
    write_frames([*frames, *frames[-2:0:-1]], file)


def _view(result: ModesResult, dots: float, line: float = 0.5) -> View:
    """Make the view of films, with dots per inch of the figure and lines [pt]."""
    wide = 2e3 * max(result.semi_axes_m)
    return View(dots * style.MM * _width() / wide, dots * line / 72,
                AxisScale(-1, 1, (-1, 0, 1)), bar_length(wide) / 2, _COLOURS, _AXES, _AXES,
                elevation=38.0, ink=_INK)


def _width() -> float:
    """Compute the width of one picture [mm]."""
    return (style.WIDTH - 2 * _MARGIN - 2 * _GAP) / 3


def _pictures(result: ModesResult, share: float, view: View) -> list[style.Picture]:
    frame = result.semi_axes_m
    return [film_picture(film, film.values["along"], view, frame[1] > frame[0])
            for film in swung_films(result, share)[:_MOST]]


def swung_films(result: ModesResult, share: float = 1.0) -> list[FilmSurface]:
    """Displace the film along each mode, with ``along``: the motion along the load at its points.

    ``along`` is relative to the mode's largest motion. The sign of a mode is that of its largest
    motion along the load. ``share``, -1 to 1, scales the displacement.
    """
    film = result.film
    assert film is not None
    largest = _SWING * min(result.semi_axes_m)
    films = []
    for number, mode in enumerate(result.modes, start=1):
        shape = film.values[f"mode_{number}"]
        unit = shape if shape[:, 2].max() >= -shape[:, 2].min() else -shape
        swing = min(largest, _TURN / max(float(np.linalg.norm(mode.plate_turn)), 1e-300))
        points = film.points + share * swing * unit
        films.append(FilmSurface(points, film.triangles, {"displacement": points - film.mounted,
                                                          "along": share * unit[:, 2]}))
    return films


def _compose(pictures: Sequence[style.Picture], result: ModesResult,
             extent: tuple[float, float, float, float]) -> Figure:
    west, east, bottom, top = extent
    modes, rows, width = result.modes, rows_of_panels(len(pictures)), _width()
    height = width * (top - bottom) / (east - west)
    figure = style.new_figure(len(rows) * (_TITLE + height) + _BAR)
    for number, row in enumerate(rows):
        for start, index in zip(style.centred([width] * len(row), _GAP), row, strict=True):
            axes = style.place_axes(figure, start, _TITLE + number * (_TITLE + height), width,
                                    height)
            style.show_picture(axes, pictures[index],
                               (f"{index + 1}  {modes[index].name}", 3.8, "bold", 7.5),
                               (modes[index].speed, 0.4, "normal", 7.5))
            axes.set(xlim=(west, east), ylim=(bottom, top))
    style.colour_bar(figure, (style.WIDTH - 70) / 2, len(rows) * (_TITLE + height) + 2, (70, 2.4),
                     AxisScale(-1, 1, (-1, 0, 1)), _COLOURS,
                     "motion along the load over the mode's largest motion; size and pace of the "
                     "swing are arbitrary")
    return figure
