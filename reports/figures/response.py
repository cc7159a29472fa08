"""Responses of film or lumped model: voltage and displacement in time, and their loops."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.trace import Response, Responses

#: Height of the axis of the voltage [mm].
_VOLTAGE = 22.0
#: Height of the axis of the deflection, and of a loop [mm].
_RESPONSE = 60.0

#: Most points of a line: more cannot be seen, and make a large file.
_POINTS = 20_000
#: Loops beside each other, and columns of a legend.
_COLUMNS = 3

_BEFORE = 0.03  # of the time shown: how much is seen before a signal
_ARROWS = (0.125, 0.625)  # where along a loop its direction is shown


def draw_simulated(result: Responses, folder: Path) -> list[Path]:
    """Draw folder/response and, for periodic signals, folder/hysteresis; answers the files."""
    responses = result.responses
    files = style.save_figure(folder, "response", lambda: _responses(responses))
    if any(response.loop is not None for response in responses):
        files += style.save_figure(folder, "hysteresis", lambda: _loops(responses))
    return files


def _responses(responses: Sequence[Response]) -> Figure:
    figure, [(above, below)] = style.pairs(1, _VOLTAGE, _RESPONSE)
    end = max(item.samples["t"].iloc[-1] for item in responses)
    for number, item in enumerate(responses):
        count = len(item.samples)
        thin = np.unique(np.linspace(0, count - 1, min(count, _POINTS)).astype(int))
        samples = item.samples[["t", "voltage", "displacement"]]
        time, voltage, reading = samples.to_numpy()[thin].T
        below.plot(time, 1e3 * reading, color=style.colour_of(number), linewidth=0.8,
                   label=_label(item))
        if number == 0:
            first = item.first_voltage_V
            above.plot([-end, time[0], *time], 1e-3 * np.array([first, first, *voltage]),
                       color="black", linewidth=0.8)
    above.legend(*below.get_legend_handles_labels(), loc="lower right", bbox_to_anchor=(1, 1),
                 ncols=_COLUMNS)
    style.describe(above, "", "voltage (kV)")
    style.describe(below, "time (s)", "displacement (mm)")
    for axes in (above, below):
        axes.set_xlim(-_BEFORE * end, end)
    return figure


def _loops(responses: Sequence[Response]) -> Figure:
    """The last period of each, every one to its own scale."""
    loops = [(item, item.loop) for item in responses if item.loop is not None]
    columns = min(len(loops), _COLUMNS)
    figure, panels = style.panels(len(loops), columns, _RESPONSE)
    for number, (axes, (item, loop)) in enumerate(zip(panels, loops, strict=True)):
        axes.plot(1e-3 * loop["voltage"], 1e3 * loop["deflection"],
                  color=style.colour_of(number), linewidth=0.8)
        for share in _ARROWS:
            at = int(share * (len(loop) - 2))
            (u, v), (y, z) = (loop[name].to_numpy()[at:at + 2]
                              for name in ("voltage", "deflection"))
            axes.annotate("", (1e-3 * v, 1e3 * z), (1e-3 * u, 1e3 * y),
                          arrowprops={"arrowstyle": "-|>", "color": style.colour_of(number)})
        style.describe(axes, "voltage (kV)", "" if number % columns else "displacement (mm)",
                       _label(item))
    return figure


def _label(item: Response) -> str:
    return f"{item.specimen}, {1e3 * item.mass_kg:g} g"
