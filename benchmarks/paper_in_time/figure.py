"""What the fitted film does in figures 9 to 12, 13 and 14."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from benchmarks.paper_in_time.compare import Comparison
from benchmarks.paper_in_time.step_responses import LONG, ZOOM, StepResponses
from tympan.paper import published
from tympan.reports import look
from tympan.studies.signals import nominal


def compose(comparison: Comparison) -> Figure:
    """Deflections over the levels under both masses, the voltage below; a loop on the right."""
    figure = look.new_figure(116.0)
    when, deflections = comparison.levels
    loop = look.place_axes(figure, 133.0, 8.0, 40.0, 68.0)
    below = look.place_axes(figure, 15.0, 88.0, 98.0, 14.0)
    for row, mass in enumerate(published.MASSES):
        axes = look.place_axes(figure, 15.0, 8.0 + 40.0 * row, 98.0, 28.0)
        for number, deflection in enumerate(deflections[:, row]):
            axes.plot(when, 1e3 * deflection, color=look.colour_of(number), linewidth=0.8)
        look.describe(axes, "", "deflection (mm)", f"{1e3 * mass:g} g", bold=True)
    steps = np.asarray(nominal(comparison.signal, when))
    below.plot(when, 1e-3 * steps, color="black", linewidth=0.8)
    look.describe(below, "time (s)", "voltage (kV)")
    for number, (voltage, deflection) in enumerate(comparison.loops):
        loop.plot(1e-3 * voltage, 1e3 * deflection, color=look.colour_of(number), linewidth=1.0,
                  label=published.NAMES[number])
    look.describe(loop, "voltage (kV)", "deflection (mm)", "a loop under 17.9 g", bold=True)
    loop.legend(loc="upper left")
    return figure


def compose_steps(steps: StepResponses) -> Figure:
    """Figures 9 to 12: what the plate moves after the step, under both masses, long and zoomed."""
    figure = look.new_figure(128.0)
    for row, mass in enumerate(published.MASSES):
        for column, (end, words) in enumerate(((LONG, "figure"), (ZOOM, "zoom, figure"))):
            axes = look.place_axes(figure, 15.0 + 84.0 * column, 8.0 + 60.0 * row, 68.0, 44.0)
            chosen = steps.time <= end
            for number, name in enumerate(published.NAMES):
                colour = look.colour_of(number)
                for moved, style, of in ((steps.shown, "-", "film in time"),
                                         (steps.lumped, ":", "cones")):
                    axes.plot(steps.time[chosen], 1e6 * moved[row, number, chosen], style,
                              color=colour, linewidth=0.8, label=f"{name}, {of}")
                if end == ZOOM and (row, number) in steps.field:
                    times, moved = steps.field[row, number]
                    axes.plot(times[::10], 1e6 * moved[::10], "o", color="black", markersize=2.0,
                              markerfacecolor="none", markeredgewidth=0.5, label="field model")
            look.describe(axes, "time (s)" if row else "", "" if column else "moved (µm)",
                          f"{words} {9 + 2 * row + column}: {1e3 * mass:g} g", bold=True)
            if column:
                axes.legend(loc="upper right", ncols=2, fontsize="xx-small")
    return figure
