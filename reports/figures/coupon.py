"""Coupon tests and the laws fitted to them: one panel a mode, the best law with its 95 % band.

Tests in time are drawn above: every run against stretch and against time, with law and branches.
"""
from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tympan.base.arrays import Array
from tympan.reports import look as style
from tympan.studies.data.coupon import MODES
from tympan.studies.material.result import MaterialFitResult

#: Height above an axis for its title [mm].
_TITLE = 7.0
#: Height of an axis [mm].
_PANEL = 52.0
#: Height below an axis for its numbers and words [mm].
_AXIS = 11.0
#: Height below for the legend [mm].
_LEGEND = 11.0

#: Width on the right, for half of the last number [mm].
_RIGHT = 3.0
#: Width between two axes, for the second one's numbers [mm].
_GAP = 11.0

#: Height of tests in time [mm].
_HISTORY = 72.0
#: Height of a line in the legend of tests in time [mm].
_LINE = 4.0

#: Width of a legend's entry without its words [mm].
_KEY = 14.0
#: Width of a letter of a legend [mm], at most.
_LETTER = 1.5

_STRESS = "nominal stress (kPa)"


def draw_fit(result: MaterialFitResult, folder: Path, dpi: int = style.DPI) -> list[Path]:
    """Draw readings and fits as folder/fit.png and .svg; return the files.

    There is a panel for each mode; those without readings show the predictions of the fits.
    """
    return style.save_figure(folder, "fit", lambda: _compose(result), dpi=dpi)


def _compose(result: MaterialFitResult) -> Figure:
    runs = () if result.histories is None else tuple(dict.fromkeys(_run_names(result.histories)))
    above = _HISTORY + _AXIS + _row_height(runs) if runs else 0.0
    figure = style.new_figure(above + _TITLE + _PANEL + _AXIS + _LEGEND)
    if result.histories is not None:
        _draw_histories(figure, result.histories, runs)
    entries: dict[str, Artist] = {}
    width = (style.WIDTH - style.LEFT - _RIGHT - 2 * _GAP) / 3
    for number, mode in enumerate(MODES):
        axes = style.place_axes(figure, style.LEFT + number * (width + _GAP), above + _TITLE, width,
                                 _PANEL)
        _panel(axes, result, mode, _STRESS if number == 0 else "")
        handles, words = axes.get_legend_handles_labels()
        entries |= dict(zip(words, handles, strict=True))
    figure.legend(entries.values(), entries.keys(), loc="lower center", ncols=5)
    return figure


def draw_laws(axes: Axes, result: MaterialFitResult) -> None:
    """Draw readings and laws of the mode with most readings."""
    _panel(axes, result, max(MODES, key=lambda mode: result.numbers["readings"].get(mode, 0)),
           _STRESS)
    style.legend(axes)


def _panel(axes: Axes, result: MaterialFitResult, mode: str, up: str) -> None:
    every = coupons = result.coupons[result.coupons.mode == mode]
    if result.histories is not None:
        coupons = coupons[np.isnan(coupons.time)]
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
    title = (mode.replace("_", " ") + (", at rest" if result.histories is not None else "")
             + ("" if len(every) else ", not tested"))
    style.describe(axes, "stretch", up, title, bold=True)


def _curve(axes: Axes, result: MaterialFitResult, law: str, mode: str, colour: str,
           best: bool) -> float:
    """Draw one law; return its largest stress [kPa], without the steep end near locking."""
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


def _run_names(histories: Mapping[str, Array]) -> list[str]:
    specimens, runs = (histories[name].tolist() for name in ("specimen", "run"))
    if len(set(specimens)) == 1:
        return [run or "readings" for run in runs]
    return [" ".join(filter(None, pair)) for pair in zip(specimens, runs, strict=True)]


def _legend_columns(runs: tuple[str, ...]) -> int:
    widest = _KEY + _LETTER * max(map(len, runs))
    return max(1, int((style.WIDTH - style.LEFT) / widest))


def _row_height(runs: tuple[str, ...]) -> float:
    return _LINE * (1 + -(-len(runs) // _legend_columns(runs)))


def _draw_histories(figure: Figure, histories: Mapping[str, Array],
                    runs: tuple[str, ...]) -> None:
    """Draw every run against stretch and against time: readings as points, the fit as a line."""
    width = (style.WIDTH - style.LEFT - _RIGHT - _GAP) / 2
    names, panels = np.array(_run_names(histories)), []
    for number, (column, across, title) in enumerate((
            ("stretch", "stretch", "tests in time: points, and the law with branches: lines"),
            ("t", "time (s)", ""))):
        axes = style.place_axes(figure, style.LEFT + number * (width + _GAP), _TITLE, width,
                                _HISTORY - _TITLE)
        style.describe(axes, across, "" if number else _STRESS, title, bold=True)
        for index, run in enumerate(runs):
            part = names == run
            colour, line = style.colour_of(index), "-" if index < len(style.PALETTE) else "--"
            at = histories[column][part]
            axes.plot(at, histories["nominal_stress"][part] / 1e3, style.marker_of(index),
                      color=colour, markersize=2, markerfacecolor="none", markeredgewidth=0.4,
                      alpha=0.6)
            axes.plot(at, histories["fitted_stress"][part] / 1e3, line, color=colour,
                      linewidth=1.0, label=run)
        panels.append(axes)
    time = histories["t"]
    if np.median(time) < 0.1 * time.max():
        panels[1].set_xscale("log", nonpositive="mask")
    height = figure.get_size_inches()[1] / style.MM
    figure.legend(*panels[0].get_legend_handles_labels(), loc="upper center",
                  ncols=_legend_columns(runs),
                  bbox_to_anchor=(0.5, 1 - (_HISTORY + _AXIS - 2) / height))
