"""Map of a plate's deflection and tilt over the voltages of segments, and the tilts in reach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.base.arrays import AnyArray
from tympan.reports import look as style
from tympan.studies.steer import SteerResult

#: Size of an axis [mm].
_SIZE = 50.0
#: Width between two axes, for the second one's numbers and words [mm].
_GAP = 20.0
#: Height above for the title [mm].
_TOP = 10.0
#: Number of lines of equal deflection or tilt.
_LINES = 10
#: Size of a film's mark in the plane of tilts [pt].
_MARK = 2.0


def draw_steer(result: SteerResult, folder: Path) -> list[Path]:
    """Draw folder/NAME-steer.png and .svg; return the files."""
    return style.save_figure(folder, f"{result.specimen}-steer", lambda: _compose(result))


def _compose(result: SteerResult) -> Figure:
    width = style.LEFT + 3 * _SIZE + 2 * _GAP + style.RIGHT
    figure = style.new_figure(_TOP + _SIZE + style.AXIS, width)
    axes = [style.place_axes(figure, style.LEFT + number * (_SIZE + _GAP), _TOP, _SIZE, _SIZE)
            for number in range(3)]
    tilt = np.hypot(result.values("tilt_x_rad"), result.values("tilt_y_rad"))
    _draw_map(axes[0], result, 1e3 * result.values("deflection_m"), "deflection (mm)")
    _draw_map(axes[1], result, 1e3 * tilt, "tilt (mrad)")
    draw_reach(axes[2], result)
    return figure


def _draw_map(axes: Axes, result: SteerResult, values: AnyArray, words: str) -> None:
    """Draw lines of equal values over the voltages of the first two segments that vary."""
    varied = [number for number, segment in enumerate(result.segments)
              if len(segment.voltage_V) > 1]
    shown, others = varied[:2], varied[2:]
    counts = [len(segment.voltage_V) for segment in result.segments]
    first = tuple(slice(None) if number in shown else 0 for number in range(len(counts)))
    there = values.reshape(counts)[first]
    holds = np.array(result.holds).reshape(counts)[first]
    volts = [1e-3 * np.array(result.segments[number].voltage_V) for number in shown]
    names = [f"voltage of {result.segments[number].name} (kV)" for number in shown]
    beside = ", ".join(f"{result.segments[number].name} at "
                       f"{result.segments[number].voltage_V[0] / 1e3:.3g} kV" for number in others)
    title = words + f"; {beside}" * bool(others)
    if len(shown) == 1:
        style.describe(axes, names[0], words, title, bold=True)
        axes.plot(volts[0], np.where(holds, there, np.nan))
        axes.plot(volts[0], np.where(holds, np.nan, there), ":", color=style.GREY)
        return
    across, up = names
    style.describe(axes, across, up, title, bold=True)
    if not holds.all():
        axes.contourf(*volts, holds.T.astype(float), levels=(-0.5, 0.5), colors=[style.FAINT])
    if np.isfinite(there).any() and np.nanmax(there) > np.nanmin(there):
        lines = axes.contour(*volts, there.T, levels=_LINES, linewidths=0.9)
        axes.clabel(lines, fontsize=6)


def draw_reach(axes: Axes, result: SteerResult) -> None:
    """Draw the tilts of all films, by their deflection, and the line about those that hold."""
    style.describe(axes, "slope along x (mrad)", "slope along y (mrad)", "tilts in reach",
                   bold=True)
    holds = np.array(result.holds)
    slopes = 1e3 * np.array([result.values("tilt_x_rad"), result.values("tilt_y_rad")])
    x, y = slopes
    axes.scatter(x[~holds], y[~holds], s=_MARK, color=style.FAINT, linewidths=0, rasterized=True)
    if holds.any():
        marks = axes.scatter(x[holds], y[holds], s=_MARK, linewidths=0, rasterized=True,
                             c=1e3 * result.values("deflection_m")[holds])
        axes.figure.colorbar(marks, ax=axes, label="deflection (mm)", fraction=0.05)
        _draw_edge(axes, slopes[:, holds].T)
    axes.set_aspect("equal", adjustable="datalim")


def _draw_edge(axes: Axes, points: AnyArray) -> None:
    """Draw the convex line about points, where they do not lie on one line."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners = ConvexHull(points).vertices
    except (QhullError, ValueError):
        return
    axes.plot(*points[np.append(corners, corners[0])].T, color=style.GREY, linewidth=0.8)
