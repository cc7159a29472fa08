"""Histograms of films that scatter, and what makes their variance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.tolerance.result import QUANTITIES, Spread, ToleranceResult

#: Width of an axis [mm].
_WIDTH = 56.0
#: Height of an axis [mm].
_HEIGHT = 30.0
#: Room between histogram and shares, for the names of these [mm].
_GAP = 32.0
#: Ends of the axis of films that are all alike, over their value.
_ALIKE = (0.9, 1.1)
#: Least share that has a bar.
_LEAST = 0.01
#: Most bars.
_MOST = 5


def draw_tolerance(result: ToleranceResult, folder: Path) -> list[Path]:
    """Draw folder/NAME-tolerance.png and .svg; answers the files, none without distributions."""
    if not result.quantities:
        return []
    return style.save_figure(folder, f"{result.specimen}-tolerance", lambda: _compose(result))


def _compose(result: ToleranceResult) -> Figure:
    row = style.TITLE + _HEIGHT + style.AXIS
    figure = style.new_figure(row * len(result.quantities),
                              style.LEFT + 2 * _WIDTH + _GAP + style.RIGHT)
    for number, (name, spread) in enumerate(result.quantities.items()):
        top = number * row + style.TITLE
        draw_histogram(style.place_axes(figure, style.LEFT, top, _WIDTH, _HEIGHT), name, spread)
        _draw_shares(style.place_axes(figure, style.LEFT + _WIDTH + _GAP, top, _WIDTH, _HEIGHT),
                     spread)
    return figure


def draw_histogram(axes: Axes, name: str, spread: Spread) -> None:
    """Films by a quantity, with median, 5 and 95 %, and the film without scatter."""
    words, unit, factor = QUANTITIES[name]
    style.describe(axes, f"{words} ({unit})", "films")
    axes.stairs(spread.counts, factor * np.array(spread.bins), fill=True, color=style.PALETTE[4])
    for value, line in ((spread.low, ":"), (spread.median, "-"), (spread.high, ":")):
        axes.axvline(factor * value, color=style.PALETTE[0], linestyle=line, linewidth=1.0)
    if spread.nominal is not None:
        axes.plot(factor * spread.nominal, 0, "^", color=style.PALETTE[1], markersize=5.0,
                  clip_on=False, zorder=4)
    if spread.deviation == 0:  # a bar as wide as rounding has no scale
        axes.set_xlim(*(factor * spread.median * np.array(_ALIKE)))
    axes.set_title("median, 5 and 95 %; triangle: without scatter", loc="left")


def _draw_shares(axes: Axes, spread: Spread) -> None:
    """Shares of the variance with their limits."""
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
