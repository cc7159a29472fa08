"""Pictures of a map: α₁ and stroke over aspect ratio and plate size, and what the formula misses."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.alpha.map import Chart
from tympan.studies.alpha.map_readings import Reading


def draw_map(chart: Chart, folder: Path) -> list[Path]:
    """Draw folder/alpha-map.png and .svg; answers the files."""
    return style.save_figure(folder, "alpha-map", lambda: _compose(chart))


def _compose(chart: Chart) -> Figure:
    figure = style.new_figure(68.0)
    alpha, stroke, missed = (style.place_axes(figure, left, 8, 44, 48) for left in (12, 70, 132))
    weights = np.array([reading.alpha for reading in chart.grid])
    levels = np.arange(np.ceil(40 * weights.min()), 40 * weights.max()) / 40
    _levels(alpha, chart, weights, levels, "α₁ (dashed: formula)", "%.3g")
    _formula(alpha, chart, levels)
    voltage, mass = chart.settings.voltage / 1e3, chart.settings.mass * 1e3
    _levels(stroke, chart, 1e3 * np.array([reading.stroke for reading in chart.grid]), 9,
            f"stroke at {voltage:g} kV, {mass:g} g [mm]", "%.2f")
    _errors(missed, chart)
    return figure


def _levels(axes: Axes, chart: Chart, values: Any, levels: Any, title: str, form: str) -> None:
    shape = len(chart.settings.aspects), len(chart.settings.ratios)
    axes.grid(False)
    drawn = axes.contour(chart.settings.aspects, chart.settings.ratios, values.reshape(shape).T,
                         levels, colors=style.PALETTE[0], linewidths=1.0)
    axes.clabel(drawn, fmt=form, fontsize=6)
    axes.set(title=title, xlabel="aspect ratio r₂/r₁", ylabel="plate r/r₁")


def _formula(axes: Axes, chart: Chart, levels: Any) -> None:
    aspect, ratio = np.meshgrid(np.linspace(*chart.formula.aspects, 80),
                                np.linspace(*chart.formula.ratios, 60))
    axes.contour(aspect, ratio, chart.formula(aspect, ratio), levels, colors=style.PALETTE[1],
                 linewidths=0.7, linestyles="dashed")


def _errors(axes: Axes, chart: Chart) -> None:
    sets: dict[str, tuple[tuple[Reading, ...], str, str]] = {
        "fitted": (chart.grid, style.PALETTE[0], "o"),
        "inside, not fitted": (chart.inside, style.PALETTE[2], "s"),
        "outside": (chart.outside, style.PALETTE[1], "^")}
    for name, (readings, colour, marker) in sets.items():
        aspects = [reading.place.aspect for reading in readings if np.isfinite(reading.alpha)]
        axes.semilogy(aspects, np.abs(chart.formula.errors(readings)).clip(1e-5), marker, ms=2.5,
                      color=colour, label=name)
    axes.axvspan(*chart.formula.aspects, color="0.93", zorder=0)
    axes.set(title="|formula − α₁|", xlabel="aspect ratio r₂/r₁", ylim=(8e-6, 0.1))
    axes.legend(loc="lower right", handletextpad=0.2)
