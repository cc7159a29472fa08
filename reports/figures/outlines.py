"""A picture of α of every registered outline: each frame with its circles, weights and errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from tympan.reports import look as style
from tympan.studies.alpha.table import OutlineRow, OutlineTable

_COLUMNS = 4


def draw_outlines(table: OutlineTable, folder: Path) -> list[Path]:
    """Draw folder/outlines.png and .svg; answers the files."""
    return style.save_figure(folder, "outlines", lambda: _compose(table))


def _compose(table: OutlineTable) -> Figure:
    figure = style.new_figure(60.0 * -(-len(table.rows) // _COLUMNS))
    for number, row in enumerate(table.rows):
        line, column = divmod(number, _COLUMNS)
        points = [1e3 * table.frames[axis][table.frames["shape"] == row.shape] for axis in "xy"]
        _frame(style.place_axes(figure, 2 + 44.5 * column, 12 + 60 * line, 42, 46), row, *points)
    return figure


def _frame(axes: Axes, row: OutlineRow, x: NDArray[Any], y: NDArray[Any]) -> None:
    """Points x, y are in mm."""
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
