"""Residuals of the nominal and the extended model: a row for each specimen."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tympan.reports import look as style

Array = NDArray[np.float64]

_TITLE, _PANEL, _GAP, _AXIS, _LEGEND = 8.0, 34.0, 6.0, 11.0, 8.0  # heights [mm]
_LEFT, _RIGHT, _BETWEEN = 16.0, 3.0, 8.0


@dataclass(frozen=True, eq=False)
class Residuals:
    """Readings less what a model says [µm], shape (rows,) each.

    ``noise`` is the standard deviation of each reading [µm].
    """

    specimen: NDArray[np.str_]
    mass: Array
    voltage: Array
    before: Array
    after: Array
    noise: Array

    @property
    def specimens(self) -> list[str]:
        """Names in the order of the readings."""
        return list(dict.fromkeys(self.specimen.tolist()))


def draw_residuals(residuals: Residuals, folder: Path) -> list[Path]:
    """Draw folder/residuals.svg; answers the files."""
    return style.save_figure(folder, "residuals", lambda: _compose(residuals), ("svg",))


def _compose(residuals: Residuals) -> Figure:
    """All panels with one scale."""
    names = residuals.specimens
    height = _TITLE + len(names) * (_PANEL + _GAP) - _GAP + _AXIS + _LEGEND
    figure = style.new_figure(height)
    width = (style.WIDTH - _LEFT - _RIGHT - _BETWEEN) / 2
    changed = not np.array_equal(residuals.before, residuals.after)
    reach = 1.15 * max(float(np.abs(residuals.before).max()), 2.5 * float(residuals.noise.max()))
    for row, name in enumerate(names):
        for column, (words, values) in enumerate((("nominal model", residuals.before),
                                                  ("extended model", residuals.after))):
            axes = style.place_axes(figure, _LEFT + column * (width + _BETWEEN),
                                    _TITLE + row * (_PANEL + _GAP), width, _PANEL)
            _panel(axes, residuals, name, values if column == 0 or changed else None)
            axes.set_ylim(-reach, reach)
            title = f"{words}, stiffness and permittivity fitted" if column == 0 else words
            axes.set_title(title if row == 0 else "", loc="left", weight="bold")
            axes.set_ylabel(f"{name}\nread − model (µm)" if column == 0 else "")
            axes.tick_params(labelbottom=row == len(names) - 1, labelleft=column == 0)
            axes.set_xlabel("voltage (kV)" if row == len(names) - 1 else "")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=6)
    return figure


def _panel(axes: Axes, residuals: Residuals, name: str, values: Array | None) -> None:
    of_specimen = residuals.specimen == name
    voltage, noise = residuals.voltage[of_specimen], residuals.noise[of_specimen]
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
    for number, mass in enumerate(np.unique(residuals.mass).tolist()):
        rows = of_specimen & (residuals.mass == mass)
        axes.plot(residuals.voltage[rows], values[rows], style.marker_of(number),
                  color=style.colour_of(number), markersize=3.2, markeredgewidth=0, alpha=0.9,
                  label=f"{mass:.4g} g")
