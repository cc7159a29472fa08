"""The way to an optimum: outlines of frame and plate, and stroke from trial to trial."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tympan.reports import look as style
from tympan.studies.design.elements.optimise import OptimiseResult
from tympan.studies.design.quantities import QUANTITIES
from tympan.studies.design.requirements import held_words

#: Width of the outlines' panel [mm].
_PANEL = 52.0
#: Height of all panels [mm].
_HEIGHT = 44.0
#: From one row of panels to the next, without the legends between them [mm].
_PITCH = 63.0
#: Height of a line of the legends, which stand below the panels [mm].
_LINE = 4.2
#: Legends begin so far below the panel, below its label, in parts of the panel's height.
_BELOW = 0.25


def draw_optimum(result: OptimiseResult, folder: Path) -> list[Path]:
    """Draw folder/optimum.png and .svg, one row for each optimum; answers the files, if any."""
    if not result.record["optima"]:
        return []
    return style.save_figure(folder, "optimum", lambda: _compose(result))


def _compose(result: OptimiseResult) -> Figure:
    optima = result.record["optima"]
    entries = [len(result.record["limits"]), *(len(optimum["starts"]) for optimum in optima)]
    pitch = _PITCH + _LINE * max(entries)
    figure = style.new_figure(pitch * len(optima))
    for number, optimum in enumerate(optima):
        top = 10 + pitch * number
        _outlines(style.place_axes(figure, 16, top, _PANEL, _HEIGHT), result, optimum["held"])
        _strokes(style.place_axes(figure, 84, top, 38, _HEIGHT), result, optimum)
        _limits(style.place_axes(figure, 138, top, 38, _HEIGHT), result, optimum)
    return figure


def _legend(axes: Axes) -> None:
    """Legend below the panel, where no line is."""
    axes.legend(loc="upper right", bbox_to_anchor=(1.0, -_BELOW), borderpad=0.0, labelspacing=0.3,
                handlelength=1.4)


def _outlines(axes: Axes, result: OptimiseResult, measure: str) -> None:
    """Draw the outlines of the best run from light to dark, and the reference, dashed."""
    trials = np.unique(result.outlines["trial"][result.outlines["held"] == measure])
    shades = colormaps["Blues"](np.linspace(0.25, 1.0, len(trials)))
    for trial, shade in zip(trials, shades, strict=True):
        _curves(axes, result, measure, trial, color=shade, linewidth=0.8)
    _curves(axes, result, measure, trials[-1], color=style.PALETTE[0], linewidth=1.6)
    _curves(axes, result, "", 0, color=style.PALETTE[1], linewidth=1.0, linestyle="--")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set(xlabel="x (mm)", ylabel="y (mm)")
    axes.set_title(f"Frame {held_words(measure)}: from light to dark;\n"
                   f"reference {result.record['reference']['specimen']} dashed", loc="left")


def _curves(axes: Axes, result: OptimiseResult, measure: str, trial: float, **look: Any) -> None:
    table = result.outlines
    of_design = (table["held"] == measure) & (table["trial"] == trial)
    for part in ("frame", "plate"):
        points = np.stack([table[key][of_design & (table["part"] == part)] for key in ("x", "y")])
        axes.plot(*(1e3 * np.column_stack([points, points[:, :1]])), **look)


def _strokes(axes: Axes, result: OptimiseResult, optimum: Mapping[str, Any]) -> None:
    colours = style.PALETTE[:1] + style.PALETTE[2:]
    for run, colour in zip(optimum["starts"], colours, strict=False):
        trials = _accepted(result, optimum["held"], run["start"])
        axes.plot(trials["trial"], 1e3 * trials["stroke"], "o-", color=colour, markersize=2.5,
                  label=f"start {run['start']}")
    axes.axhline(1e3 * result.record["reference"]["stroke_m"], color=style.PALETTE[1],
                 linestyle="--", linewidth=0.8)
    axes.set_xlabel("trial")
    axes.set_title("Stroke (mm)", loc="left")
    _legend(axes)


def _limits(axes: Axes, result: OptimiseResult, optimum: Mapping[str, Any]) -> None:
    """Used share of each limit along the best run, where that is most in the cycle."""
    trials = _accepted(result, optimum["held"], optimum["best_start"])
    limits = result.record["limits"]
    for (name, limit), colour in zip(limits.items(), style.PALETTE, strict=False):
        share = trials[name] / limit["bound"]
        used = 1 / share if QUANTITIES[name].gain else share
        volts = optimum["limits"][name].get("at_V")
        where = "" if volts is None else f", at {volts / 1e3:.4g} kV"
        axes.plot(trials["trial"], used, "o-", color=colour, markersize=2.5,
                  label=name.replace("_", " ") + where)
    axes.axhline(1.0, color="black", linewidth=0.8, linestyle=":")
    axes.set(xlabel="trial", ylim=(0.0, 1.08))
    axes.set_title("Share of each limit used", loc="left")
    if limits:
        _legend(axes)


def _accepted(result: OptimiseResult, measure: str, start: int) -> dict[str, NDArray[Any]]:
    """The designs gone to from a start, by column."""
    table = result.trials
    rows = (table["held"] == measure) & (table["start"] == start) & (table["accepted"] == 1)
    return {name: values[rows] for name, values in table.items()}
