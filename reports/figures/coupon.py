"""Coupon tests and the laws fitted to them: one panel per mode, the best law with its 95 % band."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.studies.data.coupon import MODES
from tympan.studies.material.result import MaterialFitResult

_TITLE, _PANEL, _AXIS, _LEGEND = 7.0, 52.0, 11.0, 11.0  # heights [mm]
_LEFT, _RIGHT, _GAP = 14.0, 3.0, 11.0


def draw_fit(result: MaterialFitResult, folder: Path) -> list[Path]:
    """Draw readings and fits as folder/fit.png and .svg; answers the files.

    A panel for each mode; those without readings show what the fits foretell.
    """
    return style.save_figure(folder, "fit", lambda: _compose(result))


def _compose(result: MaterialFitResult) -> Figure:
    figure = style.new_figure(_TITLE + _PANEL + _AXIS + _LEGEND)
    entries: dict[str, Artist] = {}
    width = (style.WIDTH - _LEFT - _RIGHT - 2 * _GAP) / 3
    for number, mode in enumerate(MODES):
        axes = style.place_axes(figure, _LEFT + number * (width + _GAP), _TITLE, width, _PANEL)
        _panel(axes, result, mode, "nominal stress (kPa)" if number == 0 else "")
        handles, words = axes.get_legend_handles_labels()
        entries |= dict(zip(words, handles, strict=True))
    figure.legend(entries.values(), entries.keys(), loc="lower center", ncols=5)
    return figure


def _panel(axes: Axes, result: MaterialFitResult, mode: str, up: str) -> None:
    coupons = result.coupons[result.coupons.mode == mode]
    for index, name in enumerate(dict.fromkeys(coupons.specimen)):
        read = coupons[coupons.specimen == name]
        axes.plot(read.stretch, read.stress / 1e3, style.marker_of(index), color="black",
                  markersize=3, markerfacecolor="none", markeredgewidth=0.7,
                  label=name or "readings", zorder=4)
    laws = dict.fromkeys(result.curves["law"].tolist())
    tops = [_curve(axes, result, law, mode, style.colour_of(index), index == 0)
            for index, law in enumerate(laws)]
    tested = len(coupons) > 0
    highest = max((float(coupons.stress.max()) / 1e3 if tested else 0.0), tops[0])
    lowest = min(0.0, float(coupons.stress.min()) / 1e3) if tested else 0.0
    axes.set_ylim(1.1 * lowest - 0.02 * highest, 1.25 * highest)
    title = mode.replace("_", " ") + ("" if tested else ", not tested")
    style.describe(axes, "stretch", up, title, bold=True)


def _curve(axes: Axes, result: MaterialFitResult, law: str, mode: str, colour: str,
           best: bool) -> float:
    """Draw one law; answers its largest stress [kPa] where it is not nearly taut."""
    rows = (result.curves["law"] == law) & (result.curves["mode"] == mode)
    stretch, stress, half = (factor * result.curves[name][rows] for name, factor in (
        ("stretch", 1.0), ("nominal_stress", 1e-3), ("half_band", 1e-3)))
    words = law + ("" if (result.curves["offered"][rows] == "yes").all() else " (not offered)")
    width, dashes, layer = (1.4, "-", 3) if best else (0.7, "--", 2)
    axes.plot(stretch, stress, color=colour, linewidth=width, linestyle=dashes, label=words,
              zorder=layer)
    if best:
        axes.fill_between(stretch, stress - half, stress + half, color=colour, alpha=0.2,
                          linewidth=0, zorder=1)
    return float(np.nanquantile(stress, 0.9)) if np.isfinite(stress).any() else 1.0
