"""Deflection against voltage of all specimens, one panel per mass: the paper's Figs. 7 and 8."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.reports.scales import rows_of
from tympan.reports.study.view import StudyView, VoltageCurve

_TITLE, _PANEL, _AXIS = 7.0, 56.0, 11.0  # heights [mm]
_LEFT, _RIGHT, _GAP = 13.0, 3.0, 6.0


def draw_curves(run: StudyView, folder: Path) -> list[Path]:
    """Draw folder/curves.png and .svg; answers the files."""
    return style.save_figure(folder, "curves", lambda: compose_curves(run))


def curve_label(name: str, curve: VoltageCurve) -> str:
    """A curve's name in the legend, with the voltages the pull-in lies between."""
    if curve.pull_in is None:
        return name
    below, above = curve.pull_in
    if np.isnan(below):
        return f"{name}: no equilibrium"
    return f"{name}: pull-in {below:g}\N{EN DASH}{above:g} kV"


def compose_curves(run: StudyView) -> Figure:
    """One panel per mass, all with the same limits: from no deflection, with room for a legend."""
    curves = [curve for specimen in run.specimens for curve in specimen.curves]
    deepest = max((float(np.nanmax(curve.deflection)) for curve in curves if curve.found.any()),
                  default=0.0) or 1.0
    highest = max(float(curve.voltage.max()) for curve in curves) or 1.0
    masses = sorted({curve.mass for curve in curves})
    rows = rows_of(len(masses), most=2)
    width = (style.WIDTH - _LEFT - _RIGHT - _GAP) / 2 if len(rows[0]) > 1 else 110.0
    lefts = style.centred([width] * len(rows[0]), _GAP, _LEFT, _RIGHT)
    height = _TITLE + _PANEL + _AXIS
    figure = style.new_figure(len(rows) * height)
    for number, row in enumerate(rows):
        for column, index in enumerate(row):
            axes = style.place_axes(figure, lefts[column], number * height + _TITLE, width, _PANEL)
            _panel(axes, run, masses[index], "deflection (mm)" if column == 0 else "")
            axes.tick_params(labelleft=column == 0)
            axes.set(xlim=(-0.02 * highest, 1.03 * highest), ylim=(0, 1.12 * deepest))
    return figure


def _panel(axes: Axes, run: StudyView, mass: float, up: str) -> None:
    for index, specimen in enumerate(run.specimens):
        for curve in (item for item in specimen.curves if item.mass == mass):
            colour, marker = style.colour_of(index), style.marker_of(index)
            axes.plot(curve.voltage, curve.deflection, marker=marker, markersize=3.2, color=colour,
                      label=curve_label(specimen.name, curve))
            # Hollow: part of the film has lost tension.
            axes.plot(curve.voltage[curve.loose], curve.deflection[curve.loose], marker=marker,
                      markersize=3.2, color=colour, markerfacecolor="white", linestyle="none",
                      zorder=5)
            if curve.pull_in is not None and not np.isnan(curve.pull_in[0]):
                # A cross at the last equilibrium; beyond, along the dots, there is no rest.
                below, _ = curve.pull_in
                last = curve.deflection[curve.voltage == below][-1]
                axes.plot(below, last, "x", color=colour, markersize=8, markeredgewidth=1.6,
                          zorder=4)
                axes.vlines(below, last, last + 1e6, color=colour, linestyle=":", linewidth=1.0)
    axes.legend(loc="upper left")
    style.describe(axes, "voltage (kV)", up, f"{mass:g} g", bold=True)
