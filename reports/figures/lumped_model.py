"""The lumped model compared with its field model: deflection against voltage, and difference."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.lumped.build import BuildResult

#: Width on the left of an axis for its numbers and words [mm].
_LEFT = 16.0

#: Height of the axis of deflections [mm].
_ABOVE = 62.0
#: Height of the axis of differences below it [mm].
_BELOW = 34.0

_SHOWN = {"corrected": ("-", "lumped, corrected"), "membrane": (":", "lumped, α alone")}


def draw_built(result: BuildResult, folder: Path) -> list[Path]:
    """Draw folder/build.png and .svg: a column a mass, all models above, errors below."""
    return style.save_figure(folder, "build", lambda: _compose(result.statics))


def _compose(statics: pd.DataFrame) -> Figure:
    masses, names = (statics[key].unique().tolist() for key in ("mass", "specimen"))
    figure, columns = style.pairs(len(masses), _ABOVE, _BELOW, _LEFT)
    for column, (mass, (above, below)) in enumerate(zip(masses, columns, strict=True)):
        for number, name in enumerate(names):
            loads = statics[(statics["specimen"] == name) & (statics["mass"] == mass)]
            _draw(loads, name, style.colour_of(number), above, below)
        up, error = ("deflection (mm)", "lumped/field − 1 (%)") if column == 0 else ("", "")
        style.describe(above, "", up, f"{1e3 * mass:g} g", bold=True)
        style.describe(below, "voltage (kV)", error)
        if column == 0:
            above.legend(loc="upper left", ncols=2)
    _key(columns[-1][len(columns) == 1])
    for row in zip(*columns, strict=True):
        lows, highs = zip(*(axes.get_ylim() for axes in row), strict=True)
        low, high = min(lows), max(highs)
        for axes in row:
            axes.set_ylim((0, 1.3 * high) if row[0] is columns[0][0] else (low, high))
    return figure


def _draw(loads: pd.DataFrame, name: str, colour: str, above: Axes, below: Axes) -> None:
    voltage, fitted, field = 1e-3 * loads["voltage"], loads["fitted"] == 1, loads["field_mm"]
    for kind, (line, _) in _SHOWN.items():
        above.plot(voltage, loads[f"{kind}_mm"], line, color=colour, linewidth=0.9)
        error = 100 * (loads[f"{kind}_mm"] / field - 1)
        below.plot(voltage, error, line, color=colour, linewidth=0.8)
        if kind == "corrected":
            below.plot(voltage[fitted], error[fitted], "o", color=colour, markersize=3)
    above.plot(voltage, field, "o", color=colour, markersize=3, markerfacecolor="none", label=name)


def _key(axes: Axes) -> None:
    """Add a legend of the lines, in black, that holds above and below."""
    lines = [axes.plot([], [], line, color="black", linewidth=0.9, label=words)[0]
             for line, words in _SHOWN.values()]
    dots = [axes.plot([], [], "o", color="black", markersize=3, markerfacecolor=face,
                      label=words)[0]
            for face, words in (("none", "field model"), ("black", "fitted here"))]
    axes.legend(handles=[*lines, *dots], loc="upper left", ncols=2)
