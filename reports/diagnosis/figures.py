"""The figures of a diagnosis: readings with both models, and their residuals."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from tympan.base.arrays import Array, Columns
from tympan.base.units import table_unit
from tympan.reports import look as style
from tympan.studies.diagnosis.reading_table import OF_SEGMENTS, UNITS

#: Room above an axis for its title [mm].
_TITLE = 8.0
#: Height of an axis of residuals [mm].
_PANEL = 34.0
#: Room between two axes of residuals, one below the other [mm].
_GAP = 6.0
#: Room below an axis for its numbers and words [mm].
_AXIS = 11.0
#: Room below for the legend [mm].
_LEGEND = 8.0

#: Room on the left of an axis for its numbers and words [mm].
_LEFT = 16.0
#: Room on the right, for half of the last number [mm].
_RIGHT = 3.0
#: Room between two axes side by side [mm].
_BETWEEN = 8.0

_NAMED = 20.0  # left of panels with their specimen's name

#: Most panels of readings side by side: more are too narrow on the page.
_ACROSS = 3
#: Height of a panel of readings [mm].
_TALL = 52.0
#: Room below a panel of readings for its numbers and words [mm].
_BELOW = 14.0

#: Room left and right of the residuals, as a share of the axis.
_BESIDE = 0.05
#: Place of crosses for readings beyond the axis, as a share of it.
_EDGE = 0.95

#: Words for readings, by kind, where they are not the name of the kind.
_WORDS = {"displacement": "deflection", "film_voltage": "voltage on the film",
          "tilt_x": "slope of the plate along x", "tilt_y": "slope of the plate along y",
          **{kind: f"capacitance of segment {number}"
             for number, kind in enumerate(OF_SEGMENTS, 1)}}
#: Units of axes.
_ALONG = {"voltage": table_unit("voltage"), "displacement": table_unit("length")}
_AXES = {name: f"{name} ({unit})" for name, (unit, _) in _ALONG.items()}
#: Labels of masses [kg] and voltages [V].
_EACH: dict[str, Callable[[float], str]] = {"mass": lambda value: f"{1e3 * value:.4g} g",
                                            "voltage": lambda value: f"{1e-3 * value:.4g} kV"}
#: Scales of axes over SI.
_PER_SI = {name: per_si for name, (_, per_si) in _ALONG.items()}


def compose_readings(readings: Columns, curves: Columns) -> Figure:
    """Draw readings of lengths and the curves of both models with their band, by specimen."""
    return _compose(readings, curves, "voltage", "mass")


def compose_channels(readings: Columns, channels: Columns) -> Figure:
    """Draw other readings against the voltage likewise, a panel for each specimen and kind."""
    return _compose(_in_units(readings), channels, "voltage", "mass")


def compose_forces(readings: Columns, channels: Columns) -> Figure:
    """Draw force–displacement curves, a panel for each specimen and a colour for each voltage."""
    return _compose(_in_units(readings), channels, "displacement", "voltage")


def _compose(readings: Columns, curves: Columns, along: str, each: str) -> Figure:
    """Draw readings and curves ``along`` an axis, ``each`` mass or voltage in its colour."""
    panels = list(dict.fromkeys(zip(readings["kind"].tolist(), readings["specimen"].tolist(),
                                    strict=True)))
    colours = np.unique(readings[each]).tolist()
    figure, places = _panels_of(len(panels))
    for axes, (kind, name) in zip(places, panels, strict=True):
        for colour, value in enumerate(colours):
            some, models = ({key: values[(table["kind"] == kind) & (table["specimen"] == name)
                                         & (table[each] == value)]
                             for key, values in table.items()} for table in (readings, curves))
            _ramp(axes, style.colour_of(colour), style.marker_of(colour), some, models, along)
        words = f"{_WORDS.get(kind, kind)} ({UNITS[kind].name})"
        style.describe(axes, _AXES[along], words, name, bold=True)
    _models_legend(figure, [_EACH[each](value) for value in colours], curves,
                   slips=bool(np.any(readings["counts"] == 0)))
    return figure


def _in_units(readings: Columns) -> Columns:
    """Convert readings of several kinds to the unit of each."""
    per_si = np.array([UNITS[kind].per_si for kind in readings["kind"].tolist()])
    return {**readings, "read": per_si * readings["read"]}


def _panels_of(count: int) -> tuple[Figure, list[Axes]]:
    """Make a figure of panels of readings, with room for a legend below."""
    across = min(_ACROSS, count)
    rows = -(-count // across)
    figure = style.new_figure(_TITLE + rows * (_TALL + _BELOW) + _LEGEND - _TITLE / 2)
    width = (style.WIDTH - _RIGHT - across * _LEFT) / across
    return figure, [style.place_axes(figure, _LEFT + number % across * (width + _LEFT),
                                     _TITLE + number // across * (_TALL + _BELOW), width, _TALL)
                    for number in range(count)]


def _ramp(axes: Axes, colour: str, marker: str, readings: Columns, curves: Columns,
          along: str) -> None:
    # Lengths are in SI, other readings in their units.
    scale = 1.0 if "unit" in curves else 1e3
    for way in np.unique(curves["direction"]):
        rows = curves["direction"] == way
        place = _PER_SI[along] * curves[along][rows]
        low, high, nominal, extended = (scale * curves[name][rows] for name in
                                        ("low", "high", "baseline", "extended"))
        axes.fill_between(place, low, high, color=colour, alpha=0.18, linewidth=0)
        axes.plot(place, nominal, "--", color=colour, linewidth=0.9)
        axes.plot(place, extended, color=colour, linewidth=0.9)
    counts = readings["counts"] != 0
    place, read = _PER_SI[along] * readings[along], scale * readings["read"]
    axes.plot(place[counts], read[counts], marker,
              color=colour, markersize=3, markeredgecolor="white", markeredgewidth=0.3)
    axes.plot(place[~counts], read[~counts], "x", color=colour, markersize=5)


def _models_legend(figure: Figure, points: list[str], models: Columns, band: bool = True,
                   slips: bool = False) -> None:
    """Draw the legend of points, lines and bands, below the panels."""
    handles: list[Artist] = point_keys(points)
    if slips:
        handles.append(left_out_key())
    handles.append(line_key("baseline model", "--"))
    if not np.array_equal(models["baseline"], models["extended"], equal_nan=True):
        handles.append(line_key("extended model", "-"))
    if band:
        handles.append(Patch(color=style.GREY, alpha=0.25, linewidth=0,
                             label="where 95 % of readings are expected"))
    figure.legend(handles=handles, loc="lower center", ncols=6)


def left_out_key() -> Artist:
    """Make a legend entry for the crosses of readings that do not count."""
    return Line2D([], [], marker="x", color=style.GREY, linestyle="", markersize=5,
                  label="left out")


def point_keys(labels: Sequence[str]) -> list[Artist]:
    """Make legend entries for the points of these curves, in order."""
    return [Line2D([], [], marker=style.marker_of(number), color=style.colour_of(number),
                   linestyle="", markersize=3.5, label=label)
            for number, label in enumerate(labels)]


def line_key(label: str, line: str) -> Artist:
    """Make a legend entry for a model, whatever the curve's colour."""
    return Line2D([], [], color=style.GREY, linestyle=line, linewidth=0.9, label=label)


def compose_transients(readings: Columns) -> Figure:
    """Draw means of blocks of runs in time and the extended model, both minus the baseline model.

    Each specimen has a panel, over the time since the run began, on a logarithmic axis.
    """
    names = list(dict.fromkeys(readings["specimen"].tolist()))
    masses = np.unique(readings["mass"]).tolist()
    figure, places = _panels_of(len(names))
    for axes, name in zip(places, names, strict=True):
        for colour, mass in enumerate(masses):
            there = (readings["specimen"] == name) & (readings["mass"] == mass)
            for run in np.unique(readings["run"][there]):
                _course(axes, style.colour_of(colour), style.marker_of(colour), {
                    key: values[there & (readings["run"] == run)]
                    for key, values in readings.items()})
        axes.set_xscale("log")
        style.describe(axes, "time (s)", "read − baseline (µm)", name, bold=True)
    _models_legend(figure, list(map(_EACH["mass"], masses)), readings, band=False)
    return figure


def _course(axes: Axes, colour: str, marker: str, readings: Columns) -> None:
    turn = np.argsort(readings["elapsed"], kind="stable")
    time = readings["elapsed"][turn]
    # A time of 0 cannot be shown on a logarithmic axis.
    time = np.maximum(time, 0.5 * time[time > 0].min(initial=np.inf))
    read, nominal, extended, sigma = (1e6 * readings[name][turn] for name in
                                      ("read", "baseline", "extended", "sigma"))
    axes.axhline(0.0, color=style.GREY, linestyle="--", linewidth=0.9)
    axes.plot(time, extended - nominal, color=colour, linewidth=0.9)
    axes.errorbar(time, read - nominal, 1.96 * sigma, fmt=marker, color=colour, markersize=3,
                  markeredgecolor="white", markeredgewidth=0.3, elinewidth=0.6)


def compose_residuals(readings: Columns, unit: str = "µm", per_si: float = 1e6,
                      along: str = "voltage", each: str = "mass") -> Figure:
    """Draw readings minus predictions of each model, a row for each specimen, all on one scale.

    The abscissa is ``along`` an axis, and ``each`` mass or voltage has its colour. Readings that do
    not count are crosses and do not affect the scale.
    """
    names = list(dict.fromkeys(readings["specimen"].tolist()))
    before, after = (per_si * (readings["read"] - readings[model])
                     for model in ("baseline", "extended"))
    counts = readings["counts"] != 0
    readings = {**readings, "sigma": per_si * readings["sigma"]}
    height = _TITLE + len(names) * (_PANEL + _GAP) - _GAP + _AXIS + _LEGEND
    figure = style.new_figure(height)
    width = (style.WIDTH - _NAMED - _RIGHT - _BETWEEN) / 2
    changed = not np.array_equal(before, after)
    noise = float(readings["sigma"].max())
    reach = 1.15 * max(float(np.abs(before[counts]).max(initial=0.0)), 2.5 * noise)
    before, after = (np.clip(values, -_EDGE * reach, _EDGE * reach) for values in (before, after))
    places = _PER_SI[along] * readings[along]
    left, right = float(places.min()), float(places.max())
    titles = "baseline model, stiffness and permittivity fitted", "extended model"
    for row, name in enumerate(names):
        for column, (title, values) in enumerate(zip(titles, (before, after), strict=True)):
            axes = style.place_axes(figure, _NAMED + column * (width + _BETWEEN),
                                    _TITLE + row * (_PANEL + _GAP), width, _PANEL)
            _panel(axes, readings, name, values if column == 0 or changed else None, along, each)
            axes.set_ylim(-reach, reach)
            if right > left:  # only the lowest row has numbers
                axes.set_xlim(left - _BESIDE * (right - left), right + _BESIDE * (right - left))
            axes.set_title(title if row == 0 else "", loc="left", weight="bold")
            axes.set(ylabel=f"{name}\nread − model ({unit})" if column == 0 else "",
                     xlabel=_AXES[along] if row == len(names) - 1 else "")
            axes.tick_params(labelbottom=row == len(names) - 1, labelleft=column == 0)
    handles, _ = figure.axes[0].get_legend_handles_labels()
    if not counts.all():
        handles.append(left_out_key())
    figure.legend(handles=handles, loc="lower center", ncols=6)
    return figure


def _panel(axes: Axes, readings: Columns, name: str, values: Array | None,
           along: str, each: str) -> None:
    of_specimen = readings["specimen"] == name
    places = _PER_SI[along] * readings[along]
    place, noise = places[of_specimen], readings["sigma"][of_specimen]
    edges = np.unique(place)
    band = np.array([noise[place == edge].max() for edge in edges])
    if len(edges) == 1:
        edges, band = edges + np.array([-0.5, 0.5]), np.full(2, band[0])
    axes.fill_between(edges, -2 * band, 2 * band, color=style.FAINT, linewidth=0,
                      label="95 % of the noise")
    axes.axhline(0.0, color=style.GREY, linewidth=0.6)
    if values is None:
        axes.text(0.5, 0.8, "nothing to extend", transform=axes.transAxes, ha="center",
                  color=style.GREY)
        return
    for number, value in enumerate(np.unique(readings[each]).tolist()):
        every = of_specimen & (readings[each] == value)
        rows, off = every & (readings["counts"] != 0), every & (readings["counts"] == 0)
        axes.plot(places[rows], values[rows], style.marker_of(number),
                  color=style.colour_of(number), markersize=3.2, markeredgewidth=0, alpha=0.9,
                  label=_EACH[each](value))
        axes.plot(places[off], values[off], "x", color=style.colour_of(number), markersize=5)
