"""Capacitance against deflection at several voltages, and causes that shift the deflection."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.sense.result import SenseResult

#: Width of an axis [mm].
_WIDTH = 62.0
#: Height of an axis [mm].
_HEIGHT = 58.0
#: Width between two axes, for the second one's numbers and words [mm].
_GAP = 22.0
#: Height above for the title [mm].
_TOP = 8.0

#: Width of the line of the highest voltage [pt].
_THIN = 0.9
#: Additional width of the line of each lower voltage: coinciding lines are all visible [pt].
_WIDER = 1.2
#: Causes that shift the sensed deflection, with the line of each.
_MOVERS = (("1 pF", "-"), ("1 % prestretch", "--"), ("1 % permittivity", ":"))


def draw_sense(result: SenseResult, folder: Path) -> list[Path]:
    """Draw folder/NAME-sense.png and .svg; return the files."""
    return style.save_figure(folder, f"{result.specimen}-sense", lambda: _compose(result))


def _compose(result: SenseResult) -> Figure:
    width = style.LEFT + 2 * _WIDTH + _GAP + style.RIGHT
    figure = style.new_figure(_TOP + _HEIGHT + style.AXIS, width)
    axes = [style.place_axes(figure, style.LEFT + number * (_WIDTH + _GAP), _TOP, _WIDTH, _HEIGHT)
            for number in range(2)]
    draw_capacitance(axes[0], result)
    _draw_movers(axes[1], result)
    return figure


def draw_capacitance(axes: Axes, result: SenseResult) -> None:
    """Draw the capacitance at each voltage, with the equilibria under the loads."""
    style.describe(axes, "deflection (mm)", "capacitance (pF)", result.specimen, bold=True)
    for number, curve in enumerate(result.curves):
        axes.plot(1e3 * np.array(curve.displacement_m), 1e12 * np.array(curve.capacitance_F),
                  linewidth=_THIN + _WIDER * (len(result.curves) - 1 - number),
                  color=style.colour_of(number), label=curve.drive)
    for number, mass in enumerate(dict.fromkeys(state.mass_kg for state in result.states)):
        there = [state for state in result.states if state.mass_kg == mass]
        axes.plot([1e3 * state.displacement_m for state in there],
                  [1e12 * state.capacitance_F for state in there], style.marker_of(number),
                  color="#303030", markerfacecolor="white", markersize=4.0, zorder=4,
                  label=f"under {1e3 * mass:.4g} g")
    axes.ticklabel_format(useOffset=False)
    style.legend(axes)


def _draw_movers(axes: Axes, result: SenseResult) -> None:
    """Draw the shifts of the sensed deflection at the lowest and the highest voltage."""
    style.describe(axes, "deflection (mm)", "sensed deflection moves by (mm)")
    numbers = dict.fromkeys((0, len(result.curves) - 1))
    for number in numbers:
        curve = result.curves[number]
        moved = ((1e-12, curve.per_capacitance_m_per_F), (1.0, curve.per_percent_prestretch_m),
                 (1.0, curve.per_percent_permittivity_m))
        for (size, values), (words, line) in zip(moved, _MOVERS, strict=True):
            sizes = 1e3 * size * np.abs(np.array(values, float))
            axes.plot(1e3 * np.array(curve.displacement_m), sizes, line,
                      color=style.colour_of(number), linewidth=_THIN,
                      label=words if number == next(iter(numbers)) else None)
    axes.set_yscale("log")
    legend = style.legend(axes)
    for handle in legend.get_lines():
        handle.set_color(style.GREY)
