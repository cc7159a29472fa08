"""Histograms of films that scatter, and the causes of their variance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.tolerance.result import Chance, Spread, ToleranceResult
from tympan.studies.wanted import by_column

#: Width of an axis [mm].
_WIDTH = 56.0
#: Height of an axis [mm].
_HEIGHT = 30.0
#: Height of a row of shares of films [mm].
_ROW = 5.0
#: Width for the names of the rows of shares [mm].
_NAMES = 58.0
#: Width between histogram and shares, for the names of the shares [mm].
_GAP = 32.0
#: Ends of the axis, over the value, if all films are the same.
_ALIKE = (0.9, 1.1)
#: Smallest share that has a bar.
_LEAST = 0.01
#: Most bars drawn.
_MOST = 5


def draw_tolerance(result: ToleranceResult, folder: Path) -> list[Path]:
    """Draw folder/NAME-tolerance.png and .svg; return the files, none without distributions."""
    if not result.quantities:
        return []
    return style.save_figure(folder, f"{result.specimen}-tolerance", lambda: _compose(result))


def _compose(result: ToleranceResult) -> Figure:
    row, films = style.TITLE + _HEIGHT + style.AXIS, _ROW * len(_film_rows(result))
    above, width = style.TITLE + films + style.AXIS, 2 * _WIDTH + _GAP
    figure = style.new_figure(above + row * len(result.quantities),
                              style.LEFT + width + style.RIGHT)
    draw_shares(style.place_axes(figure, style.LEFT + _NAMES, style.TITLE, width - _NAMES, films),
               result)
    for number, (name, spread) in enumerate(result.quantities.items()):
        top = above + number * row + style.TITLE
        draw_histogram(style.place_axes(figure, style.LEFT, top, _WIDTH, _HEIGHT), name, spread)
        _draw_shares(style.place_axes(figure, style.LEFT + _WIDTH + _GAP, top, _WIDTH, _HEIGHT),
                     spread)
    return figure


def _film_rows(result: ToleranceResult) -> list[tuple[str, Chance, str]]:
    """List shares of films, with names and colours: voltage reached, failures, bounds kept."""
    rows = [(f"reach {result.voltage_V / 1e3:.4g} kV", result.reached, style.PALETTE[0])]
    rows += [(f"meet {failure.label} before", failure.share, style.PALETTE[1])
             for failure in result.fails]
    rows += [(each.text, each.kept, style.PALETTE[0]) for each in result.wanted]
    return rows if result.kept is None else [*rows, ("all together", result.kept,
                                                     style.PALETTE[0])]


def draw_shares(axes: Axes, result: ToleranceResult) -> None:
    """Draw shares of films that reach their voltage, fail before it, and keep wanted bounds."""
    rows = _film_rows(result)[::-1]
    for number, (_, chance, colour) in enumerate(rows):
        axes.barh(number, 100 * chance.probability, 0.6, color=colour)
        axes.plot([100 * chance.low, 100 * chance.high], [number] * 2, color=style.GREY,
                  linewidth=0.9)
    axes.set_yticks(range(len(rows)), [name for name, *_ in rows])
    style.describe(axes, "share of the films (%)", "", "line: 95 % limits")
    axes.set_xlim(0, 100)
    axes.set_ylim(-0.5, len(rows) - 0.5)


def draw_histogram(axes: Axes, name: str, spread: Spread) -> None:
    """Draw films by a quantity, with median, 5 and 95 %, and the film without scatter."""
    quantity = by_column()[name]
    factor = quantity.per_si
    style.describe(axes, f"{quantity.title} ({quantity.table_unit})", "films")
    axes.stairs(spread.counts, factor * np.array(spread.bins), fill=True, color=style.PALETTE[4])
    for value, line in ((spread.low, ":"), (spread.median, "-"), (spread.high, ":")):
        axes.axvline(factor * value, color=style.PALETTE[0], linestyle=line, linewidth=1.0)
    if spread.nominal is not None:
        axes.plot(factor * spread.nominal, 0, "^", color=style.PALETTE[1], markersize=5.0,
                  clip_on=False, zorder=4)
    if spread.deviation == 0:  # a bar that is as narrow as rounding has no scale
        axes.set_xlim(*(factor * spread.median * np.array(_ALIKE)))
    axes.set_title("median, 5 and 95 %; triangle: without scatter", loc="left")


def _draw_shares(axes: Axes, spread: Spread) -> None:
    """Draw shares of the variance with their limits."""
    style.describe(axes, "share of the variance (%)")
    shown = [share for share in spread.shares if share.alone >= _LEAST][:_MOST][::-1]
    for number, share in enumerate(shown):
        axes.barh(number, 100 * min(share.alone, 1.0), 0.6, color=style.PALETTE[0])
        axes.plot([100 * max(share.low, 0.0), 100 * min(share.high, 1.0)], [number] * 2,
                  color=style.GREY, linewidth=0.9)
    axes.set_yticks(range(len(shown)), [share.label for share in shown])
    if not shown:
        why = "all films are alike" if spread.deviation == 0 else "too few films reach the voltage"
        axes.text(50, 0.5, why, ha="center", va="center", transform=axes.get_xaxis_transform())
    axes.set_xlim(0, 100)
