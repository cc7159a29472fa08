"""Films for requirements: their outlines, and their use of each bound."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.base.units import BENCH
from tympan.reports import look as style
from tympan.studies.design.result import (
    DesignedFilm,
    DesignedQuantity,
    DesignFront,
    DesignResult,
)

#: Width of the outlines' axis [mm].
_OUTLINES = 52.0
#: Width of the axis of bounds [mm].
_BOUNDS = 66.0
#: Height of a film's axes [mm].
_HEIGHT = 44.0
#: Width for the names of bounds [mm].
_NAMES = 32.0
#: Most films drawn.
_MOST = 4
#: Largest value over its bound that is drawn to length; a larger one is written as a number.
_LONGEST = 3.0


def draw_design(result: DesignResult, folder: Path) -> list[Path]:
    """Draw folder/design.png and .svg; return the files."""
    return style.save_figure(folder, "design", lambda: _compose(result))


def _compose(result: DesignResult) -> Figure:
    row = style.TITLE + _HEIGHT + style.AXIS
    shown = result.films[:_MOST]
    rows = len(shown) + (result.front is not None)
    figure = style.new_figure(row * rows,
                              style.LEFT + _OUTLINES + _NAMES + _BOUNDS + style.RIGHT)
    for number, film in enumerate(shown):
        top = number * row + style.TITLE
        _draw_outlines(style.place_axes(figure, style.LEFT, top, _OUTLINES, _HEIGHT), result, film)
        axes = style.place_axes(figure, style.LEFT + _OUTLINES + _NAMES, top, _BOUNDS, _HEIGHT)
        draw_bounds(axes, result, film)
    if result.front is not None:
        width = _OUTLINES + _NAMES + _BOUNDS
        top = len(shown) * row + style.TITLE
        _draw_front(style.place_axes(figure, style.LEFT, top, width, _HEIGHT), result,
                    result.front)
    return figure


def _draw_front(axes: Axes, result: DesignResult, front: DesignFront) -> None:
    """Draw films between two quantities, and the best film."""
    scales = [BENCH.get(unit, (unit, 1.0)) for unit in (front.first_unit, front.second_unit)]
    words = []
    for name, (unit, _) in zip((front.first, front.second), scales, strict=True):
        in_unit = "" if unit == "1" else f" ({unit})"
        words.append(name.replace("_", " ") + in_unit)
    (_, across), (_, up) = scales
    axes.plot([across * film.first for film in front.films],
              [up * film.second for film in front.films], "o-", color=style.PALETTE[0],
              markersize=3.0, label="films between, without scatter")
    first, second = (result.films[0].quantity(name).reduced
                     for name in (front.first, front.second))
    if first is not None and second is not None:
        axes.plot(across * first, up * second, "D", color=style.PALETTE[1], markersize=4.5,
                  label="best film")
    style.describe(axes, words[0], words[1], "all keep the bounds, with margins")
    style.legend(axes)


def _draw_outlines(axes: Axes, result: DesignResult, film: DesignedFilm) -> None:
    """Draw frame and plate."""
    specimen = result.specimens[film.specimen_file]
    outlines = [(specimen.frame.points(360), (0.0, 0.0))]
    if (plate := specimen.plate) is not None:
        outlines.append((plate.outline.points(360), plate.offset))
    for points, move in outlines:
        x, y = points
        axes.fill(1e3 * (x + move[0]), 1e3 * (y + move[1]), facecolor=style.FAINT,
                  edgecolor=style.PALETTE[0], linewidth=1.2)
    axes.set_aspect("equal", adjustable="datalim")
    style.describe(axes, "x (mm)", "y (mm)", specimen.name)


def draw_bounds(axes: Axes, result: DesignResult, film: DesignedFilm) -> None:
    """Draw values over their bounds: without scatter, of most films, of the given film."""
    bounded = [each for each in film.quantities if each.bound is not None][::-1]
    for number, each in enumerate(bounded):
        colour = style.PALETTE[1] if each.binding else style.PALETTE[0]
        value = _share(each, each.value)
        if value is not None:
            axes.barh(number, min(value, _LONGEST), 0.5, color=colour)
        if value is not None and value > _LONGEST:
            axes.text(_LONGEST - 0.05, number, f"{value:.3g} >", ha="right", va="center",
                      color="white")
        now = _share(each, each.given)
        if now is not None and now < _LONGEST:
            axes.plot(now, number, "D", color=style.GREY, markerfacecolor="white", markersize=3.5)
        reached = _share(each, each.reached)
        if reached is not None and reached < _LONGEST:
            axes.plot([reached] * 2, [number - 0.4, number + 0.4], color=style.PALETTE[5],
                      linewidth=1.4)
    axes.axvline(1.0, color=style.GREY, linewidth=0.9, linestyle=":")
    axes.set_yticks(range(len(bounded)), [
        f"{each.name.replace('_', ' ')} {'≥' if each.sense == 'at least' else '≤'}"
        for each in bounded])
    axes.set_xlim(0.0, _LONGEST)
    title = "orange: binds"
    title += "; diamond: now" * any(each.given is not None for each in bounded)
    title += "" if film.reached is None else f"; line: {100 * result.share:g} % of films"
    # Failures of films that do not bear their voltage at all have no bar.
    fails = ", ".join(f"{each.label} {100 * each.share.probability:.3g} %" for each in film.fails)
    below = f"\nfilms that fail before: {fails}" if fails else ""
    style.describe(axes, f"value over bound{below}", "", title)


def _share(each: DesignedQuantity, value: float | None) -> float | None:
    """Divide a value by its bound."""
    return None if value is None or each.bound is None else value / each.bound
