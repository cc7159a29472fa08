"""Pictures of a map: α₁ and stroke over aspect ratio and plate size, and what the formula misses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from tympan.reports import look as style
from tympan.studies.alpha.map import Chart
from tympan.studies.alpha.map_readings import Reading


def draw(chart: Chart, folder: Path, formats: Sequence[str] = ("png",)) -> list[Path]:
    """``alpha-map`` in each format; answers the files."""
    style.check(formats)
    with style.look():
        figure = style.page(68.0)
        alpha, stroke, missed = (style.place(figure, left, 8, 44, 48) for left in (12, 70, 132))
        weights = np.array([one.alpha for one in chart.grid])
        levels = np.arange(np.ceil(40 * weights.min()), 40 * weights.max()) / 40
        _levels(alpha, chart, weights, levels, "α₁ (dashed: formula)", "%.3g")
        _formula(alpha, chart, levels)
        _levels(stroke, chart, 1e3 * np.array([one.stroke for one in chart.grid]), 9,
                f"stroke at {chart.settings.voltage / 1e3:g} kV, {chart.settings.mass * 1e3:g} g [mm]", "%.2f")
        _errors(missed, chart)
        return style.save(figure, folder, "alpha-map", formats)


def _levels(axes: Axes, chart: Chart, values: Any, levels: Any, title: str, form: str) -> None:
    shape = len(chart.settings.aspects), len(chart.settings.ratios)
    axes.grid(False)
    drawn = axes.contour(chart.settings.aspects, chart.settings.ratios, values.reshape(shape).T,
                         levels,
                         colors=style.PALETTE[0], linewidths=1.0)
    axes.clabel(drawn, fmt=form, fontsize=6)
    axes.set(title=title, xlabel="aspect ratio r₂/r₁", ylabel="plate r/r₁")


def _formula(axes: Axes, chart: Chart, levels: Any) -> None:
    aspect, ratio = np.meshgrid(np.linspace(*chart.formula.aspects, 80),
                                np.linspace(*chart.formula.ratios, 60))
    axes.contour(aspect, ratio, chart.formula(aspect, ratio), levels, colors=style.PALETTE[1],
                 linewidths=0.7,
                 linestyles="dashed")


def _errors(axes: Axes, chart: Chart) -> None:
    sets: dict[str, tuple[tuple[Reading, ...], str, str]] = {
        "fitted": (chart.grid, style.PALETTE[0], "o"),
        "inside, not fitted": (chart.inside, style.PALETTE[2], "s"),
        "outside": (chart.outside, style.PALETTE[1], "^")}
    for name, (read, colour, marker) in sets.items():
        places = [one.place.aspect for one in read if np.isfinite(one.alpha)]
        axes.semilogy(places, np.abs(chart.formula.errors(read)).clip(1e-5), marker, ms=2.5,
                      color=colour, label=name)
    axes.axvspan(*chart.formula.aspects, color="0.93", zorder=0)
    axes.set(title="|formula − α₁|", xlabel="aspect ratio r₂/r₁", ylim=(8e-6, 0.1))
    axes.legend(loc="lower right", handletextpad=0.2)
