"""The page of a self-check: verdicts on errors hidden in readings like a dataset's own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tympan.reports import look as style
from tympan.reports.template import embedded_picture, template
from tympan.studies.diagnosis.self_check import OUTCOMES, SelfCheck
from tympan.studies.files import write_text

#: Room on the left for the names of effects [mm].
_LEFT = 44.0
#: Room above [mm].
_TOP = 3.0
#: Height of an effect's bar with the room around it [mm].
_ROW = 6.0
#: Room below an axis for its numbers and words [mm].
_AXIS = 10.0
#: Room below for the legend [mm].
_LEGEND = 11.0

#: Words for the outcomes and their colours, right answers in greens, wrong ones in reds.
SAID = {"named": ("named rightly", "#117733"), "listed": ("listed among others", "#88ccaa"),
        "unexplained": ("no known effect", "#b8bdc7"), "nothing": ("nothing noticed", "#e4e6ea"),
        "others_listed": ("only others listed", "#eebb99"),
        "other_named": ("another one named", "#c23b22")}


def build_self_check_page(check: SelfCheck, folder: Path) -> list[Path]:
    """Draw folder/self-check.svg and write folder/self-check.html; return the page."""
    picture, = style.save_figure(folder, "self-check", lambda: _compose(check.rows), ("svg",))
    page = folder / "self-check.html"
    write_text(page, template("reports/diagnosis/self_check.html").render(
        check=check, outcomes=OUTCOMES, said=SAID, figure=embedded_picture(picture)))
    return [page]


def _compose(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the shares of the verdicts for each hidden effect."""
    height = _ROW * len(rows)
    figure = style.new_figure(_TOP + height + _AXIS + _LEGEND)
    axes = style.place_axes(figure, _LEFT, _TOP, style.WIDTH - _LEFT - style.RIGHT, height)
    at, start = np.arange(len(rows)), np.zeros(len(rows))
    for outcome in OUTCOMES:
        words, colour = SAID[outcome]
        share = np.array([100 * row[outcome] / row["sets"] for row in rows])
        axes.barh(at, share, left=start, color=colour, height=0.75, label=words)
        start += share
    axes.set_yticks(at, [f"{row['cause']} ({row['sets']})" for row in rows])
    axes.set(xlim=(0, 100), ylim=(len(rows) - 0.4, -0.6),
             xlabel="synthetic sets of readings in which this was hidden (%)")
    figure.legend(*axes.get_legend_handles_labels(), loc="lower center", ncols=3)
    return figure
