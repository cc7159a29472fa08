"""One film under its load: deformed, in colours of stress."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.reports.figures.specimen import add_segment_legend, legend_height
from tympan.reports.scales import AxisScale, bar_length, round_scale
from tympan.reports.scene import View, film_picture
from tympan.reports.template import digits
from tympan.studies.case import CaseResult

#: Width of the picture [mm].
_WIDTH = 110.0
#: Margin at the edges of the picture [mm].
_MARGIN = 4.0
#: Height above the film for the title [mm].
_TITLE = 11.0
#: Height below for the colour bar with its words [mm].
_BAR = 14.0


def draw_film(result: CaseResult, folder: Path) -> list[Path]:
    """Draw folder/NAME.png and .svg; return the files, none where there is no film."""
    film = result.film
    if film is None:
        return []
    spans = 1e3 * np.ptp(film.mounted[:, :2], axis=0)
    wide = float(spans.max())
    stress = film.values["stress_1"] / 1e3
    dots = 2 * style.DPI  # twice those of print: averages of four make smooth edges
    view = View(dots * style.MM * (_WIDTH - 2 * _MARGIN) / wide, dots * 0.7 / 72,
                round_scale(float(stress.min()), float(stress.max())), bar_length(wide) / 2)
    picture = film_picture(film, stress, view, bool(spans[1] > spans[0]))
    return style.save_figure(folder, result.specimen,
                             lambda: _compose(result, picture, view.scale))


def _compose(result: CaseResult, picture: style.Picture, scale: AxisScale) -> Figure:
    west, east, bottom, top = picture[1]
    width = _WIDTH - 2 * _MARGIN
    height = width * (top - bottom) / (east - west)
    below = legend_height(len(result.segments))
    figure = style.new_figure(_TITLE + height + _BAR + below, _WIDTH)
    axes = style.place_axes(figure, _MARGIN, _TITLE, width, height)
    loads = f"{1e3 * result.mass_kg:.4g} g, {result.voltage_V / 1e3:.4g} kV: deflection "
    style.show_picture(axes, picture, (result.specimen, 4.4, "bold", 8.5),
                       (f"{loads}{digits(1e3 * (result.deflection_m or 0.0))} mm", 0.6, "normal",
                        7.5))
    axes.set(xlim=(west, east), ylim=(bottom, top))
    start = "" if scale.from_zero else f"; the scale starts at {scale.start}"
    style.colour_bar(figure, (_WIDTH - 70) / 2, _TITLE + height + 2.0, (70, 2.4), scale,
                     style.COLOURS, f"largest principal true stress (kPa{start})")
    add_segment_legend(figure, {each.name: f"{each.voltage_V / 1e3:.4g} kV"
                                for each in result.segments})
    return figure
