"""Pictures of α: each outline with its circles, and maps over aspect ratio and plate size."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from tympan.base.arrays import Array
from tympan.reports import look as style
from tympan.studies.alpha.map import AlphaMap
from tympan.studies.alpha.table import OutlineRow, OutlineTable

_COLUMNS = 4


def draw_outlines(table: OutlineTable, folder: Path) -> list[Path]:
    """Draw folder/outlines.png and .svg; return the files."""
    return style.save_figure(folder, "outlines", lambda: _compose_outlines(table))


def _compose_outlines(table: OutlineTable) -> Figure:
    figure = style.new_figure(60.0 * -(-len(table.rows) // _COLUMNS))
    for number, row in enumerate(table.rows):
        line, column = divmod(number, _COLUMNS)
        points = [1e3 * table.frames[axis][table.frames["shape"] == row.shape] for axis in "xy"]
        axes = style.place_axes(figure, 2 + 44.5 * column, 12 + 60 * line, 42, 46)
        _frame(axes, row, *points)
    return figure


def _frame(axes: Axes, row: OutlineRow, x: Array, y: Array) -> None:
    """Draw an outline with its circles; points x, y are in mm."""
    axes.fill(x, y, color="0.93", lw=0)
    axes.plot([*x, x[0]], [*y, y[0]], color="black", lw=1.2)
    axes.add_patch(Circle((0, 0), 10, color="0.55", lw=0))
    circles = ((row.circle_1_mm, style.SHORT), (row.circle_2_mm, style.LONG))
    for radius, colour in circles:
        if radius is not None:
            axes.add_patch(Circle((0, 0), radius, fill=False, color=colour, lw=0.9))
    axes.add_patch(Circle((0, 0), row.one_circle_mm, fill=False, color="0.4", lw=0.7, ls=":"))
    alpha = ", ".join(f"{weight:.3f}" for weight in (row.alpha_1, row.alpha_2)
                      if weight is not None)
    error = "" if row.held_out_error is None else f"held-out error {row.held_out_error:.1e}"
    axes.set_title(f"{row.shape.replace('_', ' ')}\nα {alpha}\n{error}", fontsize=6.5,
                   linespacing=1.3)
    axes.set(aspect="equal", xlim=(-80, 80), ylim=(-80, 80), xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def draw_map(alpha_map: AlphaMap, folder: Path) -> list[Path]:
    """Draw folder/alpha-map.png and .svg; return the files."""
    return style.save_figure(folder, "alpha-map", lambda: _compose_map(alpha_map))


def _compose_map(alpha_map: AlphaMap) -> Figure:
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
        # Errors are rounded, so that the digits kept in a file draw the same picture.
        errors = np.abs(readings["formula"] - readings["alpha_1"]).round(7).clip(1e-5)
        axes.semilogy(readings["aspect"], errors, marker, ms=2.5, color=colour, label=label)
    axes.axvspan(*alpha_map.formula.aspects, color="0.93", zorder=0)
    axes.set(title="|formula − α₁|", xlabel="aspect ratio r₂/r₁", ylim=(8e-6, 0.1))
    axes.legend(loc="lower right", handletextpad=0.2)
