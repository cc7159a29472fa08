"""A branch of equilibria as curves: deflection against the load, and charge against voltage."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.fem.results.limit_states import LIMIT_STATES
from tympan.reports import look as style
from tympan.studies.path import Along, PathResult, Station

#: Width of an axis [mm].
_WIDTH = 72.0
#: Height of an axis [mm].
_HEIGHT = 62.0
#: Height above for a title [mm].
_TOP = 8.0
#: Width between two axes, for the second one's numbers [mm].
_GAP = 20.0

Scaled = tuple[str, str, float]  #: a quantity's words, its name in a station, and 1 / its unit
_NAMES: dict[Along, Scaled] = {
    "voltage": ("film voltage (kV)", "voltage_V", 1e-3), "charge": ("charge (µC)", "charge_C", 1e6),
    "mass": ("load (N)", "force_N", 1.0), "pressure": ("gas pressure (Pa)", "pressure_Pa", 1.0)}


def draw_path(result: PathResult, folder: Path) -> list[Path]:
    """Draw folder/NAME-path.png and .svg; return the files."""
    return style.save_figure(folder, f"{result.specimen}-path", lambda: _compose(result))


def _compose(result: PathResult) -> Figure:
    panels = 2 if result.along in ("voltage", "charge") else 1
    figure = style.new_figure(_TOP + _HEIGHT + style.AXIS,
                              style.LEFT + panels * (_WIDTH + _GAP) - _GAP + style.RIGHT)
    first = style.place_axes(figure, style.LEFT, _TOP, _WIDTH, _HEIGHT)
    draw_stations(first, result)
    style.legend(first)
    if panels == 2:
        second = style.place_axes(figure, style.LEFT + _WIDTH + _GAP, _TOP, _WIDTH, _HEIGHT)
        _panel(second, result, _NAMES["charge"], _NAMES["voltage"])
    return figure


def draw_stations(axes: Axes, result: PathResult) -> None:
    """Draw deflection against the load: stable or not, where tension is lost, and the events."""
    _panel(axes, result, _NAMES[result.along], ("deflection (mm)", "deflection_m", 1e3),
           f"{result.specimen}, from {result.mass_kg * 1e3:g} g and {result.voltage_V / 1e3:g} kV")


def _panel(axes: Axes, result: PathResult, across: Scaled, up: Scaled, title: str = "") -> None:
    def places(stations: Sequence[Station]) -> list[np.ndarray]:
        return [factor * np.array([getattr(station, name) for station in stations])
                for _, name, factor in (across, up)]

    x, y = places(result.stations)
    stable = np.array([station.stable for station in result.stations])
    tense = np.array([station.tense for station in result.stations])
    axes.plot(x[~tense], y[~tense], color="#c9ccd1", linewidth=5.0, solid_capstyle="round",
              zorder=1, label="part of the film without tension")
    for kind, colour, line, label in ((stable, style.PALETTE[0], "-", "stable"),
                                      (~stable, style.PALETTE[1], "--", "unstable")):
        # Each part of the curve of one kind is drawn on to the next point.
        edges = np.flatnonzero(np.diff(np.concatenate([[0], kind.astype(int), [0]])))
        for number, (start, end) in enumerate(edges.reshape(-1, 2)):
            piece = slice(start, min(end + 1, len(x)))
            axes.plot(x[piece], y[piece], color=colour, linestyle=line, zorder=2,
                      label=label if number == 0 else None)
    for event in result.events:
        state = LIMIT_STATES[event.what]
        words = state.at(event.value_text)
        shown = axes.get_legend_handles_labels()[1]
        axes.plot(*places([event.station]), state.marker, color="#303030", markersize=4.5,
                  markerfacecolor="white", zorder=4, linestyle="none",
                  label=None if words in shown else words)
    style.describe(axes, across[0], up[0], title, bold=True)
