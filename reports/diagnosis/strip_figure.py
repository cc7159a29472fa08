"""The picture of a diagnosis of coupons: stress with both models, and their residuals."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from tympan.base.arrays import Columns
from tympan.reports import look as style
from tympan.reports.diagnosis.figures import line_key, point_keys
from tympan.studies.data.coupon import MODES

#: Room above an axis for its title [mm].
_TITLE = 7.0
#: Height of the axis of stresses [mm].
_ABOVE = 58.0
#: Height of the axis of residuals below it [mm].
_BELOW = 34.0
#: Room between the axes of stresses and residuals [mm].
_GAP = 4.0
#: Room below an axis for its numbers and words [mm].
_AXIS = 12.0
#: Height of a line of the legend [mm].
_LINE = 4.5

#: Room on the left of an axis for its numbers and words [mm].
_LEFT = 15.0
#: Room on the right, for half of the last number [mm].
_RIGHT = 3.0
#: Room between two columns, for the second one's numbers [mm].
_BETWEEN = 14.0


_SHOWN = {"stress": "stress (kPa)", "drop": "drop of the stress (kPa)"}
#: Entries of the legend side by side.
_ACROSS = 4


def compose_strips(readings: Columns, reading: str = "stress") -> Figure:
    """Draw a column for each film and mode: readings and models above, residuals below.

    ``readings`` has the columns of a diagnosis of coupons, in SI; ``reading`` is the judged
    quantity: the "stress" or its "drop". Colours are conditions and runs.
    """
    labels = _conditions(readings)
    conditions = list(dict.fromkeys(labels))
    panels = [(name, mode) for name in dict.fromkeys(readings["specimen"].tolist())
              for mode in MODES if np.any((readings["specimen"] == name)
                                          & (readings["mode"] == mode))]
    lines = -(-(len(conditions) + 4) // _ACROSS)
    figure = style.new_figure(_TITLE + _ABOVE + _GAP + _BELOW + _AXIS + _LINE * lines)
    width = (style.WIDTH - _LEFT - _RIGHT - (len(panels) - 1) * _BETWEEN) / len(panels)
    several = len({name for name, _ in panels}) > 1
    for column, (name, mode) in enumerate(panels):
        place = _LEFT + column * (width + _BETWEEN)
        above, below = style.place_pair(figure, place, _TITLE, width, (_ABOVE, _GAP, _BELOW))
        rows = (readings["specimen"] == name) & (readings["mode"] == mode)
        _column(above, below, {key: values[rows] for key, values in readings.items()},
                np.array(labels)[rows], conditions)
        title = mode.replace("_", " ") + (f", {name}" if several else "")
        style.describe(above, "", _SHOWN[reading] if column == 0 else "", title, bold=True)
        style.describe(below, "stretch", "read − model (kPa)" if column == 0 else "")
    _legend(figure, conditions)
    return figure


def _conditions(readings: Columns) -> list[str]:
    """List the conditions that distinguish the runs, in words, for each reading."""
    parts = []
    if np.ptp(readings["voltage"]) > 0:
        parts.append([f"{value / 1e3:g} kV" for value in readings["voltage"].tolist()])
    if np.ptp(readings["temperature_C"]) > 0:
        parts.append([f"{value:g} °C" for value in readings["temperature_C"].tolist()])
    parts.append(readings["run"].tolist())
    return [", ".join(filter(None, words)) or "readings" for words in zip(*parts, strict=True)]


def _column(above: Axes, below: Axes, readings: Columns, labels: NDArray[np.str_],
            conditions: list[str]) -> None:
    along, kilo = readings["stretch"], {name: readings[name] / 1e3 for name in
                                        ("read", "sigma", "baseline", "extended")}
    order = np.argsort(along)
    below.fill_between(along[order], -2 * kilo["sigma"][order], 2 * kilo["sigma"][order],
                       color=style.FAINT, linewidth=0)
    below.axhline(0.0, color=style.GREY, linewidth=0.6)
    for number, condition in enumerate(conditions):
        colour, marker = style.colour_of(number), style.marker_of(number)
        for leg in np.unique(readings["leg"][labels == condition]):
            rows = (labels == condition) & (readings["leg"] == leg)
            above.plot(along[rows], kilo["baseline"][rows], "--", color=colour, linewidth=0.8)
            above.plot(along[rows], kilo["extended"][rows], color=colour, linewidth=0.9)
            above.plot(along[rows], kilo["read"][rows], marker, color=colour, markersize=3,
                       markeredgecolor="white", markeredgewidth=0.3)
            below.plot(along[rows], (kilo["read"] - kilo["baseline"])[rows], marker, color=colour,
                       markersize=3, markerfacecolor="none", markeredgewidth=0.6)
            below.plot(along[rows], (kilo["read"] - kilo["extended"])[rows], marker, color=colour,
                       markersize=3, markeredgewidth=0)


def _legend(figure: Figure, conditions: list[str]) -> None:
    handles = [*point_keys(conditions), line_key("baseline model (below: hollow)", "--"),
               line_key("extended model (below: full)", "-"),
               Patch(color=style.FAINT, label="95 % of the noise")]
    figure.legend(handles=handles, loc="lower center", ncols=_ACROSS)
