"""Responses of film or lumped model: voltage and displacement in time, and their loops."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.trace import Response, Responses

#: Room on the left of an axis for its numbers and words [mm].
_LEFT = 14.0
#: Room on the right, for half of the last number [mm].
_RIGHT = 4.0
#: Room above an axis for its title [mm].
_TITLE = 6.0
#: Room below an axis for its numbers and words [mm].
_AXIS = 12.0
#: Room between two axes, one below the other [mm].
_GAP = 5.0

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
    figure = style.new_figure(_TITLE + _VOLTAGE + _GAP + _RESPONSE + _AXIS)
    above, below = style.place_pair(figure, _LEFT, _TITLE, style.WIDTH - _LEFT - _RIGHT,
                                    (_VOLTAGE, _GAP, _RESPONSE))
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
    rows = -(-len(loops) // columns)
    figure = style.new_figure(rows * (_TITLE + _RESPONSE + _AXIS))
    width = style.WIDTH / columns - _LEFT - _RIGHT
    for number, (item, loop) in enumerate(loops):
        row, column = divmod(number, columns)
        axes = style.place_axes(figure, _LEFT + column * style.WIDTH / columns,
                                _TITLE + row * (_TITLE + _RESPONSE + _AXIS), width, _RESPONSE)
        axes.plot(1e-3 * loop["voltage"], 1e3 * loop["deflection"],
                  color=style.colour_of(number), linewidth=0.8)
        for share in _ARROWS:
            at = int(share * (len(loop) - 2))
            (u, v), (y, z) = (loop[name].to_numpy()[at:at + 2]
                              for name in ("voltage", "deflection"))
            axes.annotate("", (1e-3 * v, 1e3 * z), (1e-3 * u, 1e3 * y),
                          arrowprops={"arrowstyle": "-|>", "color": style.colour_of(number)})
        style.describe(axes, "voltage (kV)", "displacement (mm)" if column == 0 else "",
                       _label(item))
    return figure


def _label(item: Response) -> str:
    return f"{item.specimen}, {1e3 * item.mass_kg:g} g"
