"""Responses of the lumped model: voltage and displacement in time, and their loops."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.lumped.response import SampledResponse, SimulationResult

_LEFT, _RIGHT, _TITLE, _AXIS, _GAP = 14.0, 4.0, 6.0, 12.0, 5.0  # [mm]
_VOLTAGE, _RESPONSE = 22.0, 60.0
_POINTS, _COLUMNS = 20_000, 3


def draw_simulated(result: SimulationResult, folder: Path) -> list[Path]:
    """Draw folder/response and, for periodic signals, folder/hysteresis; answers the files."""
    responses = result.responses
    files = style.save_figure(folder, "response", lambda: _responses(responses))
    if any(response.loop is not None for response in responses):
        files += style.save_figure(folder, "hysteresis", lambda: _loops(responses))
    return files


def _responses(responses: Sequence[SampledResponse]) -> Figure:
    figure = style.new_figure(_TITLE + _VOLTAGE + _GAP + _RESPONSE + _AXIS)
    width = style.WIDTH - _LEFT - _RIGHT
    above = style.place_axes(figure, _LEFT, _TITLE, width, _VOLTAGE)
    below = style.place_axes(figure, _LEFT, _TITLE + _VOLTAGE + _GAP, width, _RESPONSE)
    for number, item in enumerate(responses):
        count = len(item.samples)
        thin = np.unique(np.linspace(0, count - 1, min(count, _POINTS)).astype(int))
        time, voltage, reading = item.samples[
            ["t", "voltage", "displacement"]].to_numpy()[thin].T
        below.plot(time, 1e3 * reading, color=style.colour_of(number), linewidth=0.8,
                   label=_label(item))
        if number == 0:
            voltage = np.append(item.numbers["linear"]["voltage_V"], voltage)
            above.plot(np.append(0.0, time), 1e-3 * voltage, color="black", linewidth=0.8)
    above.set_ylabel("voltage (kV)")
    below.set_ylabel("displacement (mm)")
    below.set_xlabel("time (s)")
    below.legend(loc="best")
    above.tick_params(labelbottom=False)
    for axes in (above, below):
        axes.set_xlim(0, max(item.samples["t"].iloc[-1] for item in responses))
        style.faint_grid(axes)
    return figure


def _loops(responses: Sequence[SampledResponse]) -> Figure:
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
        axes.set_title(_label(item), loc="left")
        axes.set_xlabel("voltage (kV)")
        axes.set_ylabel("displacement (mm)" if column == 0 else "")
        style.faint_grid(axes)
    return figure


def _label(item: SampledResponse) -> str:
    return f"{item.numbers['specimen']}, {1e3 * item.numbers['mass_kg']:g} g"
