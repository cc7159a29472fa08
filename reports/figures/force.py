"""Force on the plate against its displacement, as in a tensile test, with load lines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tympan.base.arrays import Array, Mask
from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.reports import look as style
from tympan.studies.force.result import ForceCurve, ForceLimit, ForceResult, LoadLine

#: Width of the axis [mm].
_WIDTH = 100.0
#: Height of the axis [mm].
_HEIGHT = 70.0
#: Height above for the title [mm].
_TOP = 8.0

#: Forces from this on are drawn in newtons [N].
_NEWTONS = 1.0
#: Styles of load lines, in turns; no curve has their colour.
_LINES = ("-", "-.", ":")
_LOAD = "#303030"

#: Words for a part of a curve, written once in the legend.
_LOOSE = "part of the film without tension"
_UNSTABLE = "unstable under a constant force"


def draw_force(result: ForceResult, folder: Path) -> list[Path]:
    """Draw folder/NAME-force.png and .svg; return the files."""
    return style.save_figure(folder, f"{result.specimen}-force", lambda: _compose(result))


def _compose(result: ForceResult) -> Figure:
    figure = style.new_figure(_TOP + _HEIGHT + style.AXIS, style.LEFT + _WIDTH + style.RIGHT)
    draw_force_curves(style.place_axes(figure, style.LEFT, _TOP, _WIDTH, _HEIGHT), result)
    return figure


def draw_force_curves(axes: Axes, result: ForceResult) -> None:
    """Draw curves at each voltage, their limits, load lines and their equilibria."""
    most = max((abs(force) for curve in result.curves for force in curve.force_N), default=0.0)
    unit, factor = ("N", 1.0) if most >= _NEWTONS else ("mN", 1e3)
    style.describe(axes, "displacement (mm)", f"force ({unit})", result.specimen, bold=True)
    lines = []
    for number, curve in enumerate(result.curves):
        lines.append(_curve(axes, curve, factor, style.colour_of(number)))
    drives = [(curve.voltage_V, curve.segment_voltages_V) for curve in result.curves]
    for loop in result.loops:
        number = drives.index((loop.voltage_V, loop.segment_voltages_V))
        axes.plot(1e3 * np.array(loop.displacement_m), factor * np.array(loop.force_N),
                  color=style.colour_of(number), linewidth=0.8, alpha=0.8, zorder=2)
        _say(axes, f"at {1e3 * loop.rate_m_per_s:.4g} mm/s", color=style.GREY, linewidth=0.8)
    _blocked(axes, result, factor, unit)
    bottom, top = axes.get_ylim()
    for number, line in enumerate(result.loads):
        lines.append(_load_line(axes, line, factor, _LINES[number % len(_LINES)]))
    loads = [factor * force for line in result.loads for force in line.force_N]
    # A steep bias must not press the curves flat.
    room = top - bottom
    axes.set_ylim(max(min([bottom, *loads]), bottom - room / 2),
                  min(max([top, *loads]), top + room / 2))
    marks = [mark for mark in axes.get_legend_handles_labels()[0] if mark not in lines]
    style.legend(axes, [*lines, *marks])


def _curve(axes: Axes, curve: ForceCurve, factor: float, colour: str) -> Line2D:
    x, y = 1e3 * np.array(curve.displacement_m), factor * np.array(curve.force_N)
    drawn, = axes.plot(x, y, color=colour, label=curve.drive, zorder=2)
    style.band(axes, style.edges(x[:len(curve.band_force_N)], curve.band_force_N, factor), colour)
    for where, look, words in (
            (~np.array(curve.tense, bool), {"linewidth": 5.0, "alpha": 0.25, "zorder": 1.0,
                                            "color": colour}, _LOOSE),
            (~np.array(curve.stable, bool), {"linewidth": 1.5, "linestyle": (0, (2, 2)),
                                             "color": "white", "zorder": 3.0}, _UNSTABLE)):
        if (where[1:] & where[:-1]).any():
            _part(axes, x, y, where, **look)
            grey = {"color": style.GREY} | (
                {"linewidth": 5.0, "alpha": 0.25} if words is _LOOSE else {"linestyle": "--"})
            _say(axes, words, **grey)
    ended = () if curve.ended is None else (curve.ended,)
    for limit in dict.fromkeys((*curve.limits, *ended)):
        _mark(axes, limit, factor, colour)
    return drawn


def _blocked(axes: Axes, result: ForceResult, factor: float, unit: str) -> None:
    """Draw the blocked force, between the curves of the lowest and the highest voltage."""
    place, force = result.blocked_displacement_m, result.blocked_force_N
    if place is None or force is None:
        return
    ends = [factor * float(np.interp(place, curve.displacement_m, curve.force_N))
            for curve in (result.curves[0], result.curves[-1])]
    axes.plot([1e3 * place] * 2, ends, color=_LOAD, linewidth=2.5, alpha=0.6, zorder=1.5,
              solid_capstyle="butt", label=f"blocked force {factor * force:.3g} {unit}")


def _part(axes: Axes, x: Array, y: Array,
          where: Mask, **look: Any) -> None:
    """Draw parts of a curve again, each extended to the points before and after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], where.astype(int), [0]])))
    for start, end in edges.reshape(-1, 2):
        piece = slice(max(start - 1, 0), min(end + 1, len(x)))
        axes.plot(x[piece], y[piece], solid_capstyle="butt", **look)


def _say(axes: Axes, words: str, **look: Any) -> None:
    """Add an entry to the legend, once."""
    if words not in axes.get_legend_handles_labels()[1]:
        axes.plot([], [], label=words, **look)


def _mark(axes: Axes, limit: ForceLimit, factor: float, colour: str) -> None:
    state = LIMIT_STATES.get(limit.kind)
    marker = "|" if state is None else state.marker
    axes.plot(1e3 * limit.displacement_m, factor * limit.force_N, marker, color=colour,
              markerfacecolor="white", markersize=5.0, linestyle="none", zorder=4)
    _say(axes, limit.words, color=style.GREY, marker=marker, markerfacecolor="white",
         markersize=5.0, linestyle="none")


def _load_line(axes: Axes, line: LoadLine, factor: float, look: str) -> Line2D:
    stroke = "" if line.stroke_m is None else f": stroke {1e3 * line.stroke_m:.3g} mm"
    drawn, = axes.plot(1e3 * np.array(line.displacement_m), factor * np.array(line.force_N), look,
                       color=_LOAD, linewidth=0.9, label=f"{line.load}{stroke}", zorder=2)
    for stable, face, words in ((True, _LOAD, "equilibrium"),
                                (False, "white", "unstable equilibrium")):
        there = [each for each in line.crossings if each.stable == stable]
        if there:
            mark: dict[str, Any] = {"color": _LOAD, "marker": "o", "markerfacecolor": face,
                                    "markersize": 4.0, "linestyle": "none"}
            axes.plot([1e3 * each.displacement_m for each in there],
                      [factor * each.force_N for each in there], zorder=5,
                      **mark)
            _say(axes, words, **mark)
    return drawn
