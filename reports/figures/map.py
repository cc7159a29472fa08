"""Pictures of a map: α₁ and stroke over aspect ratio and plate size, the formula's error."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.alpha.map import AlphaMap


def draw_map(alpha_map: AlphaMap, folder: Path) -> list[Path]:
    """Draw folder/alpha-map.png and .svg; answers the files."""
    return style.save_figure(folder, "alpha-map", lambda: _compose(alpha_map))


def _compose(alpha_map: AlphaMap) -> Figure:
    figure = style.new_figure(68.0)
    alpha, stroke, missed = (style.place_axes(figure, start, 8, 44, 48) for start in (12, 70, 132))
    weights = alpha_map.of("grid")["alpha_1"]
    levels = np.arange(np.ceil(40 * weights.min()), 40 * weights.max()) / 40
    _levels(alpha, alpha_map, weights, levels, "α₁ (dashed: formula)", "%.3g")
    aspect, ratio = np.meshgrid(np.linspace(*alpha_map.formula.aspects, 80),
                                np.linspace(*alpha_map.formula.ratios, 60))
    alpha.contour(aspect, ratio, alpha_map.formula(aspect, ratio), levels, colors=style.PALETTE[1],
                  linewidths=0.7, linestyles="dashed")
    voltage, mass = alpha_map.settings.voltage / 1e3, alpha_map.settings.mass * 1e3
    _levels(stroke, alpha_map, 1e3 * alpha_map.of("grid")["stroke"], 9,
            f"stroke at {voltage:g} kV, {mass:g} g [mm]", "%.2f")
    _errors(missed, alpha_map)
    return figure


def _levels(axes: Axes, alpha_map: AlphaMap, values: Any, levels: Any, title: str,
            form: str) -> None:
    shape = len(alpha_map.settings.aspects), len(alpha_map.settings.ratios)
    axes.grid(False)
    drawn = axes.contour(alpha_map.settings.aspects, alpha_map.settings.ratios,
                         values.reshape(shape).T, levels, colors=style.PALETTE[0], linewidths=1.0)
    axes.clabel(drawn, fmt=form, fontsize=6)
    axes.set(title=title, xlabel="aspect ratio r₂/r₁", ylabel="plate r/r₁")


def _errors(axes: Axes, alpha_map: AlphaMap) -> None:
    looks = {"grid": ("fitted", style.PALETTE[0], "o"),
             "inside": ("inside, not fitted", style.PALETTE[2], "s"),
             "outside": ("outside", style.PALETTE[1], "^")}
    for name, (label, colour, marker) in looks.items():
        readings = alpha_map.of(name)
        # Rounded, so that the digits a file keeps draw the same.
        errors = np.abs(readings["formula"] - readings["alpha_1"]).round(7).clip(1e-5)
        axes.semilogy(readings["aspect"], errors, marker, ms=2.5, color=colour, label=label)
    axes.axvspan(*alpha_map.formula.aspects, color="0.93", zorder=0)
    axes.set(title="|formula − α₁|", xlabel="aspect ratio r₂/r₁", ylim=(8e-6, 0.1))
    axes.legend(loc="lower right", handletextpad=0.2)
