"""Responses of the lumped model: voltage and displacement in time, and loops of the one against the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.lumped.response import Simulated

_LEFT, _RIGHT, _TITLE, _AXIS, _GAP = 14.0, 4.0, 6.0, 12.0, 5.0  # [mm]
_VOLTAGE, _RESPONSE = 22.0, 60.0
_POINTS, _COLUMNS = 20_000, 3


def draw_simulated(found: Sequence[Simulated], folder: Path,
                   formats: Sequence[str] = ("png", "svg")) -> list[Path]:
    """Draw folder/response and, for periodic signals, folder/hysteresis; answers the files."""
    style.check(formats)
    with style.look():
        files = style.save(_responses(found), folder, "response", formats)
        if any(one.loop is not None for one in found):
            files += style.save(_loops(found), folder, "hysteresis", formats)
    return files


def _responses(found: Sequence[Simulated]) -> Figure:
    figure = style.page(_TITLE + _VOLTAGE + _GAP + _RESPONSE + _AXIS)
    width = style.WIDTH - _LEFT - _RIGHT
    above = style.place(figure, _LEFT, _TITLE, width, _VOLTAGE)
    below = style.place(figure, _LEFT, _TITLE + _VOLTAGE + _GAP, width, _RESPONSE)
    for number, one in enumerate(found):
        thin = np.unique(np.linspace(0, len(one.time) - 1, min(len(one.time), _POINTS)).astype(int))
        colour = style.PALETTE[number % len(style.PALETTE)]
        below.plot(one.time[thin], 1e3 * one.reading[thin], color=colour, linewidth=0.8,
                   label=_label(one))
        if number == 0:
            voltage = np.append(one.response.signal.first, one.voltage[thin])
            above.plot(np.append(0.0, one.time[thin]), 1e-3 * voltage, color="black", linewidth=0.8)
    above.set_ylabel("voltage (kV)")
    below.set_ylabel("displacement (mm)")
    below.set_xlabel("time (s)")
    below.legend(loc="best")
    above.tick_params(labelbottom=False)
    for axes in (above, below):
        axes.set_xlim(0, max(one.response.end for one in found))
        grid(axes)
    return figure


def _loops(found: Sequence[Simulated]) -> Figure:
    """The last period of each, every one to its own scale."""
    loops = [(one, one.loop) for one in found if one.loop is not None]
    columns = min(len(loops), _COLUMNS)
    rows = -(-len(loops) // columns)
    figure = style.page(rows * (_TITLE + _RESPONSE + _AXIS))
    width = style.WIDTH / columns - _LEFT - _RIGHT
    for number, (one, loop) in enumerate(loops):
        row, column = divmod(number, columns)
        axes = style.place(figure, _LEFT + column * style.WIDTH / columns,
                           _TITLE + row * (_TITLE + _RESPONSE + _AXIS), width, _RESPONSE)
        axes.plot(1e-3 * loop.voltage, 1e3 * loop.deflection,
                  color=style.PALETTE[number % len(style.PALETTE)],
                  linewidth=0.8)
        axes.set_title(_label(one), loc="left")
        axes.set_xlabel("voltage (kV)")
        axes.set_ylabel("displacement (mm)" if column == 0 else "")
        grid(axes)
    return figure


def _label(one: Simulated) -> str:
    actuator = one.response.actuator
    return f"{actuator.specimen.name}, {1e3 * actuator.mass:g} g"


def grid(axes: Axes) -> None:
    """Faint lines behind the curves."""
    axes.grid(color="#e4e6ea", linewidth=0.5)
    axes.set_axisbelow(True)
