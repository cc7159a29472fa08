"""Residuals of the nominal and the extended model: a row for each specimen."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tympan.reports import look as style

_TITLE, _PANEL, _GAP, _AXIS, _LEGEND = 8.0, 34.0, 6.0, 11.0, 8.0  # heights [mm]
_LEFT, _RIGHT, _BETWEEN = 16.0, 3.0, 8.0


def draw_residuals(readings: Mapping[str, NDArray[Any]], folder: Path) -> list[Path]:
    """Draw folder/residuals.svg of columns of readings.csv, lengths in m; answers the files."""
    return style.save_figure(folder, "residuals", lambda: _compose(readings), ("svg",))


def _compose(readings: Mapping[str, NDArray[Any]]) -> Figure:
    """All panels with one scale."""
    names = list(dict.fromkeys(readings["specimen"].tolist()))
    before, after = (1e6 * (readings["read"] - readings[model])
                     for model in ("baseline", "extended"))
    height = _TITLE + len(names) * (_PANEL + _GAP) - _GAP + _AXIS + _LEGEND
    figure = style.new_figure(height)
    width = (style.WIDTH - _LEFT - _RIGHT - _BETWEEN) / 2
    changed = not np.array_equal(before, after)
    noise = float((1e6 * readings["sigma"]).max())
    reach = 1.15 * max(float(np.abs(before).max()), 2.5 * noise)
    titles = "nominal model, stiffness and permittivity fitted", "extended model"
    for row, name in enumerate(names):
        for column, (title, values) in enumerate(zip(titles, (before, after), strict=True)):
            axes = style.place_axes(figure, _LEFT + column * (width + _BETWEEN),
                                    _TITLE + row * (_PANEL + _GAP), width, _PANEL)
            _panel(axes, readings, name, values if column == 0 or changed else None)
            axes.set_ylim(-reach, reach)
            axes.set_title(title if row == 0 else "", loc="left", weight="bold")
            axes.set(ylabel=f"{name}\nread − model (µm)" if column == 0 else "",
                     xlabel="voltage (kV)" if row == len(names) - 1 else "")
            axes.tick_params(labelbottom=row == len(names) - 1, labelleft=column == 0)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=6)
    return figure


def _panel(axes: Axes, readings: Mapping[str, NDArray[Any]], name: str,
           values: NDArray[np.float64] | None) -> None:
    of_specimen = readings["specimen"] == name
    voltage, noise = readings["voltage"][of_specimen] / 1e3, 1e6 * readings["sigma"][of_specimen]
    order = np.argsort(voltage)
    edges, band = voltage[order], noise[order]
    if np.ptp(voltage) == 0:
        edges, band = np.array([voltage[0] - 0.5, voltage[0] + 0.5]), np.full(2, noise.max())
    axes.fill_between(edges, -2 * band, 2 * band, color="#e4e6ea", linewidth=0,
                      label="95 % of the noise")
    axes.axhline(0.0, color="#5a6475", linewidth=0.6)
    if values is None:
        axes.text(0.5, 0.8, "nothing to extend", transform=axes.transAxes, ha="center",
                  color="#5a6475")
        return
    for number, mass in enumerate(np.unique(readings["mass"]).tolist()):
        rows = of_specimen & (readings["mass"] == mass)
        axes.plot(readings["voltage"][rows] / 1e3, values[rows], style.marker_of(number),
                  color=style.colour_of(number), markersize=3.2, markeredgewidth=0, alpha=0.9,
                  label=f"{1e3 * mass:.4g} g")
