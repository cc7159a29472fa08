"""The films of a sweep side by side, all on one scale of size and one of colours."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from textwrap import wrap

import numpy as np
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.reports.scales import bar_length, round_scale
from tympan.reports.scene import View, film_picture
from tympan.reports.study.stress_figure import stress_label
from tympan.reports.sweep.view import Measure
from tympan.reports.template import digits
from tympan.studies.files import replaced
from tympan.studies.film_surface import FilmSurface
from tympan.studies.sweep.run import SweepResult, fields_file

#: Number of films in a row of a sheet.
_COLUMNS = 6
#: Rows of films on a sheet, about the height of a page.
_ROWS = 8

#: Width between films [mm].
_GAP = 3.0
#: Height above for the colour bar [mm].
_BAR = 14.0
#: Margin at the edges of the picture [mm].
_MARGIN = 2.0
#: Height of a line of words [mm].
_LINE = 2.5

_LETTERS = 22  #: letters in a line as wide as a column
_DPI = 220

#: Lines of keys in which a specimen differs from the others, its deflection [m] and film.
DrawnFilm = tuple[list[str], float, FilmSurface]


def draw_films(result: SweepResult, folder: Path) -> list[Path]:
    """Draw the first case of every specimen with an equilibrium, on sheets folder/films-N.png."""
    with replaced(folder, [file.name for file in folder.glob("films-*.png")]):
        return _sheets(_films(result, folder), folder)


def _sheets(films: list[DrawnFilm], folder: Path) -> list[Path]:
    if not films:
        return []
    widths = [float(np.ptp(film.mounted, axis=0).max()) * 1e3 for *_, film in films]
    stresses = [film.values["stress_1"] / 1e3 for *_, film in films]
    room = (style.WIDTH - 2 * _MARGIN - (_COLUMNS - 1) * _GAP) / _COLUMNS
    paper = room / (1.02 * max(widths))
    # A line of the net is narrower than a pixel: each pixel is the average of four.
    view = View(_DPI * style.MM * paper, 0.7 * _DPI / 72,
                round_scale(min(map(np.min, stresses)), max(map(np.max, stresses))),
                bar_length(max(widths)) / 2, samples=2)
    files = []
    for number, start in enumerate(range(0, len(films), _COLUMNS * _ROWS), start=1):
        sheet = films[start:start + _COLUMNS * _ROWS]
        files += style.save_figure(folder, f"films-{number}", partial(_sheet, sheet, view, paper),
                                   ("png",), _DPI)
    return files


def _films(result: SweepResult, folder: Path) -> list[DrawnFilm]:
    """List the films of all specimens with an equilibrium under the first mass and voltage."""
    first = result.table.isel({load: 0 for load in ("mass", "voltage") if load in
                               result.table.dims})
    grid = [Measure.of(first[axis]) for axis in first["status"].dims if axis != "specimen"]
    cases = first[["id", "status", "deflection_m"]].to_dataframe(
        dim_order=list(first["status"].dims)).reset_index()
    several = first.sizes.get("specimen", 1) > 1 or not grid
    return [([row["specimen"]] * several
             + wrap(", ".join(key.text(row[key.name]) for key in grid), _LETTERS),
             row["deflection_m"], FilmSurface.load(fields_file(folder, row["id"])))
            for _, row in cases[cases["status"] == "equilibrium"].iterrows()]


def _sheet(films: list[DrawnFilm], view: View, paper: float) -> Figure:
    pictures = []
    for *_, film in films:
        x, y, _ = np.ptp(film.mounted, axis=0)
        pictures.append(film_picture(film, film.values["stress_1"] / 1e3, view, bool(y > x)))
    sizes = [(upper - bottom) * paper for _, (_, _, bottom, upper) in pictures]
    heights = [max(sizes[start:start + _COLUMNS]) for start in range(0, len(films), _COLUMNS)]
    room = (style.WIDTH - 2 * _MARGIN - (_COLUMNS - 1) * _GAP) / _COLUMNS
    caption = _LINE * (1.5 + max(len(lines) for lines, *_ in films))
    figure = style.new_figure(_BAR + sum(heights) + len(heights) * caption)
    style.colour_bar(figure, (style.WIDTH - 70) / 2, 2.0, (70, 2.6), view.scale, view.colours,
                     stress_label(view.scale))
    for number, ((lines, deflection, _), picture) in enumerate(zip(films, pictures, strict=True)):
        row, column = divmod(number, _COLUMNS)
        low_x, high_x, bottom, upper = picture[1]
        width = (high_x - low_x) * paper
        left = _MARGIN + column * (room + _GAP) + (room - width) / 2
        top = _BAR + sum(heights[:row]) + (row + 1) * caption
        axes = style.place_axes(figure, left, top, width, (upper - bottom) * paper)
        above = [*lines, f"{digits(1e3 * deflection)} mm"][::-1]
        captions = [(line, 0.5 + _LINE * place, "bold" if place else "normal", 5.5)
                    for place, line in enumerate(above)]
        style.show_picture(axes, picture, *captions, interpolation="none")
    return figure
