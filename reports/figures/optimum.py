"""The way to an optimum: outlines of frame and plate, and stroke from trial to trial."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.geometry.specimen import Specimen
from tympan.reports import look as style
from tympan.studies.optimise.optimise import Optimised, Optimum

_PANEL = 52.0  #: width of the outlines' panel [mm]


def draw_optimum(result: Optimised, folder: Path) -> list[Path]:
    """Draw folder/optimum.png and .svg, one row for each optimum; answers the files."""
    return style.save_figure(folder, "optimum", lambda: _compose(result))


def _compose(result: Optimised) -> Figure:
    figure = style.new_figure(6 + 62 * max(1, len(result.optima)))
    for number, optimum in enumerate(result.optima):
        top = 10 + 62 * number
        _outlines(style.place_axes(figure, 16, top, _PANEL, 44), result, optimum)
        _strokes(style.place_axes(figure, 84, top, 38, 44), result, optimum)
        _limits(style.place_axes(figure, 138, top, 38, 44), result, optimum)
    return figure


def _outlines(axes: Axes, result: Optimised, optimum: Optimum) -> None:
    """Along the best run from light to dark, and the reference, dashed."""
    ways = [station.design.specimen for station in optimum.best.stations if station.accepted]
    specimens = [specimen for specimen in ways if specimen is not None]
    shades = colormaps["Blues"](np.linspace(0.25, 1.0, len(specimens)))
    for specimen, shade in zip(specimens, shades, strict=True):
        _curves(axes, specimen, color=shade, linewidth=0.8)
    _curves(axes, specimens[-1], color=style.PALETTE[0], linewidth=1.6)
    _curves(axes, result.problem.reference, color=style.PALETTE[1], linewidth=1.0, linestyle="--")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("x [mm]")
    axes.set_ylabel("y [mm]")
    axes.set_title(f"Equal frame {optimum.held}: from light to dark;\n"
                   f"reference {result.problem.reference.name} dashed", loc="left")


def _curves(axes: Axes, specimen: Specimen, **look: Any) -> None:
    offset = np.array(specimen.plate.offset)[:, None]
    for points in (specimen.frame.points(360), specimen.plate.outline.points(360) + offset):
        closed = 1e3 * np.column_stack([points, points[:, :1]])
        axes.plot(*closed, **look)


def _strokes(axes: Axes, result: Optimised, optimum: Optimum) -> None:
    for run, colour in zip(optimum.runs, style.PALETTE[:1] + style.PALETTE[2:], strict=False):
        kept = [(number, 1e3 * station.design.stroke) for number, station in enumerate(run.stations)
                if station.accepted]
        axes.plot(*zip(*kept, strict=True), "o-", color=colour, markersize=2.5,
                  label=f"start {run.start + 1}")
    axes.axhline(1e3 * result.reference.stroke, color=style.PALETTE[1], linestyle="--",
                 linewidth=0.8)
    axes.set_xlabel("trial")
    axes.set_title("Stroke [mm]", loc="left")
    axes.legend()


def _limits(axes: Axes, result: Optimised, optimum: Optimum) -> None:
    """How much of each limit is used along the best run."""
    kept = [(number, station.design) for number, station in enumerate(optimum.best.stations)
            if station.accepted]
    for limit, colour in zip(result.problem.limits, style.PALETTE, strict=False):
        upper = limit.unit in ("Pa", "V/m")
        used = [design.limited[limit.name] / limit.bound if upper
                else limit.bound / design.limited[limit.name] for _, design in kept]
        axes.plot([number for number, _ in kept], used, "o-", color=colour, markersize=2.5,
                  label=limit.name.replace("_", " "))
    axes.axhline(1.0, color="black", linewidth=0.8, linestyle=":")
    axes.set_xlabel("trial")
    axes.set_title("Share of each limit used", loc="left")
    axes.set_ylim(0.0, 1.08)
    if result.problem.limits:
        axes.legend(loc="lower left", fontsize=5.5, labelspacing=0.15, handlelength=1.2)
