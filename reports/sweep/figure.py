"""A result of a sweep over two of its keys, in colours."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Rectangle

from tympan.base.errors import InputError
from tympan.reports.look import COLOURS
from tympan.reports.sweep.maps import HEIGHT, WIDTH, map_of
from tympan.reports.sweep.view import Measure, SweepView

if TYPE_CHECKING:
    from collections.abc import Iterable


def draw_over(view: SweepView, axes: Axes, of: str, over: tuple[str, str]) -> None:
    """Draw a result, by its name or label, over two keys; its mean where more keys vary.

    Raises
    ------
    InputError
        When the sweep has no such result or key, or no values of it.
    """
    column = _named(view.columns, of, "of")
    across, up = (_named(view.keys, key, "over") for key in over)
    drawn, scale = map_of(view, column, across, up)
    for mark in drawn.marks:
        if drawn.cells:
            corner = mark.x - mark.width / 2, HEIGHT - mark.y - mark.height / 2
            hatch = "////" * mark.hatched + r"\\" * mark.beyond
            axes.add_patch(Rectangle(corner, mark.width, mark.height, hatch=hatch,
                                     facecolor=mark.colour or "white",
                                     edgecolor="white" if mark.colour else "#b8bfca"))
        else:
            axes.plot(mark.x, HEIGHT - mark.y, "o", color=mark.colour or "white",
                      markeredgecolor="#666666")
    axes.set(xlim=(0, WIDTH), ylim=(0, HEIGHT), xlabel=across.heading, ylabel=up.heading,
             title=f"{drawn.title}{f' at {drawn.where}' if drawn.where else ''}")
    axes.set_xticks(*zip(*drawn.across, strict=True))
    axes.set_yticks(*zip(*((HEIGHT - at, text) for at, text in drawn.up), strict=True))
    figure = axes.get_figure()
    assert figure is not None
    figure.colorbar(ScalarMappable(Normalize(scale.low, scale.high), COLOURS), ax=axes,
                    label=drawn.title)


def _named(measures: Iterable[Measure], name: str, key: str) -> Measure:
    spellings = {spelling: measure for measure in measures
             for spelling in (measure.label, measure.name)}
    if name not in spellings:
        raise InputError(f"must be one of {', '.join(sorted(spellings))}", key=key, given=name)
    return spellings[name]
