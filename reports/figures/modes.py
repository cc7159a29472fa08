"""Shapes of small vibrations as small multiples: the deformed film swung out along each mode."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.reports.scales import AxisScale, bar_length, rows_of
from tympan.reports.scene import View, film_picture
from tympan.studies.film_surface import FilmSurface
from tympan.studies.modes import Mode, ModesResult

_SWING = 0.22  #: largest displacement drawn, of the frame's smaller half extent
_TURN = 0.4  #: largest rotation of the plate drawn [rad]: drawn straight on, a larger one swells it
_MARGIN, _GAP, _TITLE, _BAR = 3.0, 4.0, 9.0, 15.0  # [mm]
_MOST = 12  #: modes drawn
_COLOURS, _INK, _AXES = "RdBu_r", "#303030", "#808080"


def draw_modes(result: ModesResult, folder: Path) -> list[Path]:
    """Draw the first modes as folder/NAME-modes.png and .svg; answers the files, if any."""
    if not result.modes:
        return []
    frame = result.semi_axes_m
    wide = 2e3 * max(frame)
    shown = list(result.modes[:_MOST])
    rows = rows_of(len(shown))
    width = (style.WIDTH - 2 * _MARGIN - 2 * _GAP) / 3
    dots = 1.4 * style.DPI  # more than the print's: their average makes smooth edges
    view = View(dots * style.MM * width / wide, dots * 0.5 / 72, _COLOURS,
                AxisScale(-1, 1, (-1, 0, 1)), bar_length(wide) / 2, _AXES, _AXES, elevation=38.0,
                ink=_INK)
    pictures = [film_picture(film, film.values["along"], view, frame[1] > frame[0])
                for film in swung_films(result)[:len(shown)]]
    return style.save_figure(folder, f"{result.specimen}-modes",
                             lambda: _compose(pictures, shown, rows, width))


def swung_films(result: ModesResult) -> list[FilmSurface]:
    """The film swung out along each mode, with ``along``: the motion along the load at its points.

    It is relative to the mode's largest motion. Of the two directions a mode swings, the one in
    which it goes furthest along the load.
    """
    film = result.film
    assert film is not None
    largest = _SWING * min(result.semi_axes_m)
    films = []
    for number, mode in enumerate(result.modes, start=1):
        shape = film.values[f"mode_{number}"]
        unit = shape if shape[:, 2].max() >= -shape[:, 2].min() else -shape
        swing = min(largest, _TURN / max(float(np.linalg.norm(mode.plate_turn)), 1e-300))
        points = film.points + swing * unit
        films.append(FilmSurface(points, film.triangles, {"displacement": points - film.mounted,
                                                          "along": unit[:, 2]}))
    return films


def _compose(pictures: Sequence[style.Picture], modes: Sequence[Mode], rows: Sequence[range],
             width: float) -> Figure:
    west, east, bottom, top = (pick(extent[side] for _, extent in pictures)
                               for side, pick in enumerate((min, max, min, max)))
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
                     "motion along the load over the mode's largest motion; the size of the swing "
                     "is arbitrary")
    return figure
