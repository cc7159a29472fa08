"""Deflection against voltage up to the film's end, with marks at the voltages wanted."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox, ScaledTranslation
from scipy.interpolate import PchipInterpolator

from tympan.base.arrays import Array, Mask
from tympan.fem.results.limit_states import INSTABILITY, PULL_IN
from tympan.reports import look as style
from tympan.studies.case import Limit, Limits
from tympan.studies.limits.curve import CurveResult

#: Width of the axis [mm].
_WIDTH = 110.0
#: Height of the axis [mm].
_HEIGHT = 70.0
#: Height above for the title [mm].
_TOP = 8.0

#: Height below a legend [mm]: letters are wider and higher on a screen of few pixels.
_FOOT = 3.0

#: Offset of words from their mark [points]: to its left, a little above.
_BESIDE = (-4.0, 2.0)
#: Largest shift upwards within which words still belong to their mark [points].
_NEAR = 16.0
#: Colour of words that belong to several curves.
_OF_ALL = "#333333"
#: Most enlargements of the axis to make room for words. A bound, since room may be missing in any
#: case.
_TRIES = 25

#: Background of words that lie over a curve.
_PAPER = {"facecolor": "white", "alpha": 0.75, "linewidth": 0.0, "pad": 0.5}

#: Legend of a curve beyond its first limit.
_BEYOND = "beyond its first limit"
#: Opacity of a curve there, so that it is seen to be uncertain.
_FAINT = 0.65

#: Most entries of a legend with more than names: beyond, the rest is at the curves and in tables.
_TOLD = 8
#: Most entries of such a legend within axes, where the legend takes room from the curves.
_WITHIN = 3
#: Width of a letter over the size of the font, on average.
_LETTER = 0.52
#: Width of a legend's line and margin, over the size of the font.
_HANDLE = 5.0
#: Width of that line and of the space between two columns, in letters.
_GAP = 10
#: Least number of letters in a line of the legend: axes may be narrow.
_SHORTEST = 12

#: Deflections [mm] closer than this are equal.
_SAME = 1e-9
#: Legend of the dotted rest of a curve, beyond where its film thins as it loses tension.
_KEPT = "were it kept from wrinkling, to its pull-in"


@dataclass(frozen=True, eq=False)
class VoltageCurve:
    """Deflection [mm] against voltage [kV] under one mass [g], up to the limits.

    ``voltage`` and ``deflection`` follow the film. ``asked`` are the voltages wanted, with their
    ``status`` and deflection ``there``, NaN without equilibrium.
    """

    mass: float
    limits: Limits
    voltage: Array
    deflection: Array
    asked: Array
    status: tuple[str, ...]
    there: Array
    #: Voltages, and 5 and 95 % quantiles of films that scatter, (3, voltages).
    band: Array = field(default_factory=lambda: np.empty((3, 0)))
    #: Proportion of the segments' voltages, where they differ.
    drive: str = ""

    def named(self, *words: str) -> str:
        """Name the curve by words and the proportion of its voltages, and say how it ends."""
        return f"{', '.join(filter(None, (*words, self.drive)))}: {self.end}"

    @property
    def end(self) -> str:
        """First limit, and how the curve ends, in words with numbers."""
        limits = self.limits
        first, last = limits.limit, limits.end or limits.instability
        if first is None:
            if not len(self.voltage):
                return "no equilibrium"
            return f"no limit up to {self.voltage[-1]:.4g} kV"
        words = f"{first.words} (the limit)"
        if last is None:
            return f"{words}, followed to {self.voltage[-1]:.4g} kV"
        if last == first:
            return words
        if last.voltage_V == first.voltage_V:
            return f"{first.state.label} and {last.words} (the limit)"
        return f"{words}, {last.words}"

    @cached_property
    def parts(self) -> tuple[Mask, Mask, Mask]:
        """Masks of the line's points before its first limit, beyond it, and beyond its end.

        The last part is that of a film that thins, calculated as if it could not wrinkle. Each part
        begins where the one before it ends.
        """
        way = self.way
        y = way * self.line[1]
        ends = self.first, self.limits.end if self.limits.thins else None
        low, high = (np.inf if limit is None else way * self.deflection_at(limit)
                     for limit in ends)
        return (y <= low + _SAME, (y >= low - _SAME) & (y <= high + _SAME), y >= high - _SAME)

    @property
    def first(self) -> Limit | None:
        """First limit; after a snap the plate is at rest as before it, so a snap does not count."""
        return next((limit for limit in self.limits.reached if limit.state.signs), None)

    def deflection_at(self, limit: Limit) -> float:
        """Look up the deflection at a limit: the curve has a point there."""
        return float(self.deflection[np.argmin(np.abs(self.voltage - limit.voltage_V / 1e3))])

    @property
    def way(self) -> float:
        """Direction in which voltage moves the film: 1 along the load, -1 where gas holds it up."""
        raised = len(self.deflection) > 1 and self.deflection[-1] < self.deflection[0]
        return -1.0 if raised else 1.0

    @cached_property
    def line(self) -> tuple[Array, Array]:
        """Voltages and deflections close together; U² is interpolated smoothly over deflection."""
        y, squared = self.deflection, self.voltage**2
        # Gas may hold the film up: then a voltage moves it up, to ever more negative deflections.
        way = self.way
        y = way * y
        if len(y) < 2 or not (np.diff(y) > 0).all():
            return self.voltage, self.deflection
        dense = np.unique(np.concatenate([y, np.linspace(y[0], y[-1], 200)]))
        return np.sqrt(np.maximum(PchipInterpolator(y, squared)(dense), 0.0)), way * dense

    def at(self, voltage: float) -> float:
        """Interpolate the deflection at a voltage."""
        return float(np.interp(voltage, *self.line))


def voltage_curves(result: CurveResult) -> Iterator[VoltageCurve]:
    """Convert the curves of a result to the units of pictures."""
    table = result.table
    for curve in result.curves:
        own = result.rows_of(curve)
        asked, way = (own & (table["asked"] == number) for number in (1, 0))
        yield VoltageCurve(
            curve.mass_kg * 1e3, curve.limits, table["voltage"][way] / 1e3,
            table["deflection"][way] * 1e3, table["voltage"][asked] / 1e3,
            tuple(table["status"][asked].tolist()), table["deflection"][asked] * 1e3,
            style.edges(np.array(curve.band_voltage_V) / 1e3, curve.band_deflection_m, 1e3),
            curve.drive)


def draw_curves(result: CurveResult, folder: Path) -> list[Path]:
    """Draw folder/NAME-curve.png and .svg; return the files."""
    return style.save_figure(folder, f"{result.specimen}-curve", lambda: _compose(result))


def _compose(result: CurveResult) -> Figure:
    figure = style.new_figure(_TOP + _HEIGHT + style.AXIS, style.LEFT + _WIDTH + style.RIGHT)
    axes = style.place_axes(figure, style.LEFT, _TOP, _WIDTH, _HEIGHT)
    draw_voltage_curves(axes, result, below=True)
    make_room(figure, [[axes]], _TOP)
    return figure


def draw_voltage_curves(axes: Axes, result: CurveResult, below: bool = False) -> None:
    """Draw all curves of a specimen, with a legend of their ends, in or below the axes."""
    curves = list(voltage_curves(result))
    for number, curve in enumerate(curves):
        draw_curve(axes, curve, number, curve.named(f"{curve.mass:g} g"), len(curves))
    style.describe(axes, "voltage (kV)", "deflection (mm)", result.specimen, bold=True)
    frame_curves(axes, curves, below=below)


def make_room(figure: Figure, rows: Sequence[Sequence[Axes]], title: float) -> None:
    """Make a figure as high as rows of axes with the legends below them, ``title`` [mm] above."""
    pixels = figure.dpi * style.MM
    tall = []
    for row in rows:
        legends = [legend for axes in row if (legend := axes.get_legend()) is not None]
        room = max((legend.get_window_extent().height for legend in legends), default=0.0) / pixels
        tall.append((row[0].get_window_extent().height / pixels, style.AXIS + room + _FOOT))
    places = [[axes.get_position().bounds for axes in row] for row in rows]
    height = sum(title + axis + below for axis, below in tall)
    figure.set_size_inches(figure.get_figwidth(), height * style.MM)
    top = 0.0
    for row, place, (axis, below) in zip(rows, places, tall, strict=True):
        for axes, (left, _, width, _) in zip(row, place, strict=True):
            axes.set_position((left, 1 - (top + title + axis) / height, width, axis / height))
        top += title + axis + below


def frame_curves(axes: Axes, curves: list[VoltageCurve], *others: Axes, below: bool = False
                 ) -> None:
    """Set limits of axes that show curves whole, from zero deflection, with room for a legend.

    ``others`` show curves with the same limits. Equal words beside each other are written once,
    different ones moved apart. The legend is ``below`` the axes, or within; it is as wide as these.
    """
    panels = axes, *others
    right = max((float(part.max()) for curve in curves for part in (curve.voltage, curve.asked)
                 if len(part)), default=0.0) or 1.0
    every = np.concatenate([np.zeros(1), *(part for curve in curves for part in (
        curve.deflection, curve.band[1:].ravel()))])
    low, top = float(np.nanmin(every)), float(np.nanmax(every))
    high = (top - low) or 1.0
    bottom = low - 0.05 * high if low < 0 else 0.0
    for panel in panels:
        panel.set(xlim=(-0.02 * right, 1.06 * right), ylim=(bottom, top + 0.15 * high))
        _legend(panel, below)
        _say_once(panel)
    for _ in range(_TRIES):
        for panel in panels:
            _move_apart(panel)
        if not any(map(_crowded, panels)):
            break
        for panel in panels:
            bottom, top = panel.get_ylim()
            panel.set_ylim(bottom, top + 0.08 * (top - bottom))


def _legend(axes: Axes, below: bool) -> None:
    """Add a legend as wide as the axes: long words in lines, with many curves names alone."""
    # Entries that hold for lines of every colour come last.
    entries = sorted(zip(*axes.get_legend_handles_labels(), strict=True),
                     key=lambda entry: entry[1] in (_BEYOND, _KEPT))
    size = FontProperties(size=rcParams["legend.fontsize"]).get_size_in_points()
    width = axes.get_window_extent().width * 72 / axes.figure.dpi
    letters, columns = int((width / size - _HANDLE) / _LETTER), 1
    names = [label.partition(": ")[0] for _, label in entries if label not in (_BEYOND, _KEPT)]
    if len(names) > (_TOLD if below else _WITHIN):
        if below:
            columns = max(1, (letters + _GAP) // (max(map(len, names)) + _GAP))
            letters = (letters + _GAP) // columns - _GAP
        entries = [(handle, label.partition(": ")[0]) for handle, label in entries]
    handles = [handle for handle, _ in entries]
    labels = ["\n".join(wrap(label, max(_SHORTEST, letters))) for _, label in entries]
    down = ScaledTranslation(0.0, -style.AXIS * style.MM, axes.figure.dpi_scale_trans)
    place: dict[str, Any] = {"loc": "upper left"}
    if below:
        place |= {"bbox_to_anchor": (0.0, 0.0), "bbox_transform": axes.transAxes + down,
                  "borderaxespad": 0.0}
    axes.legend(handles, labels, ncols=columns, **place)


def _crowded(axes: Axes) -> bool:
    """Check whether the legend lies over words or curves."""
    legend = axes.get_legend()
    assert legend is not None
    covered = legend.get_window_extent()
    return (any(covered.overlaps(text.get_window_extent()) for text in _words(axes))
            or any(covered.count_contains(points) for points in _drawn(axes)))


def _say_once(axes: Axes) -> None:
    """Keep the uppermost of equal words within a line of each other, in a neutral colour."""
    said: dict[str, list[tuple[Annotation, Bbox]]] = {}
    for text in reversed(_words(axes)):
        near, box = said.setdefault(text.get_text(), []), text.get_window_extent()
        first = next((other for other, taken in near if taken.overlaps(box)), None)
        near.append((first or text, box.padded(0.0, box.height)))
        if first is not None:
            first.set_color(_OF_ALL)
            text.remove()


def _move_apart(axes: Axes) -> None:
    """Move words up from each other, lowest first; off curves only if they stay near their mark."""
    placed: list[Bbox] = []
    for text in _words(axes):
        if not _move_up(text, placed, _drawn(axes), _NEAR):
            _move_up(text, placed, [], np.inf)
        placed.append(text.get_window_extent())


def _move_up(text: Annotation, placed: list[Bbox], drawn: list[Array], most: float) -> bool:
    """Move words up until they cover nothing; False if ``most`` points are not enough."""
    across, start = _BESIDE
    up = start
    while up < start + most:
        text.xyann = across, up
        box = text.get_window_extent()
        if not (any(map(box.overlaps, placed)) or any(map(box.count_contains, drawn))):
            return True
        up += 1.0
    return False


def _drawn(axes: Axes) -> list[Array]:
    """Compute points of curves and marks [pixels]."""
    return [axes.transData.transform(line.get_xydata()) for line in axes.get_lines()]


def _words(axes: Axes) -> list[Annotation]:
    """List the words at limits, the lowest first."""
    texts = [text for text in axes.texts if isinstance(text, Annotation)]
    return sorted(texts, key=lambda text: text.get_window_extent().y0)


def draw_curve(axes: Axes, curve: VoltageCurve, number: int, label: str, count: int = 1) -> None:
    """Draw one curve in the colour of its number, of ``count``, with its limits and end."""
    colour = style.colour_of(number, count)
    if not len(curve.voltage):
        axes.plot([], [], color=colour, label=label)
        return
    limits, (x, y) = curve.limits, curve.line
    style.band(axes, curve.band, colour)
    before, beyond, kept = curve.parts
    axes.plot(x[before], y[before], color=colour, label=label, zorder=2)
    for part, line, words in ((beyond, "--", _BEYOND), (kept, ":", _KEPT)):
        if part.sum() > 1:
            faint, = axes.plot(x[part], y[part], color=colour, linestyle=line, alpha=_FAINT,
                               zorder=2)
            if words not in axes.get_legend_handles_labels()[1]:
                faint.set_label(words)
    if limits.tension is not None:  # a wide, pale line where part of the film has lost tension
        loose = curve.way * (y - curve.deflection_at(limits.tension)) >= -_SAME
        axes.plot(x[loose], y[loose], color=colour, alpha=0.25, linewidth=5.0, zorder=1,
                  solid_capstyle="butt")
    here = np.isfinite(curve.there)
    axes.plot(curve.asked[here], curve.there[here], style.marker_of(number), markersize=3.2,
              color=colour, zorder=3)
    for limit in limits.reached:
        # The legend names the end of the dotted rest, and the end of a film that thins at once.
        silent = limits.thins and (limit.kind == PULL_IN.kind or (
            limit.kind == INSTABILITY.kind and limits.tension is not None
            and limit.voltage_V == limits.tension.voltage_V))
        _mark(axes, curve, limit, "" if silent else limit.state.label, colour)
    if limits.end is None and limits.instability is None:
        _word(axes, (float(x[-1]), float(y[-1])), "not followed further", colour)


def _mark(axes: Axes, curve: VoltageCurve, limit: Limit, word: str, colour: str) -> None:
    place = limit.voltage_V / 1e3, curve.deflection_at(limit)
    marker = limit.state.marker
    axes.plot(*place, marker, color=colour, markerfacecolor="white", linestyle="none", zorder=4,
              markersize=7 if marker == "x" else 4.5, markeredgewidth=1.4 if marker == "x" else 1.0)
    _word(axes, place, word, colour)


def _word(axes: Axes, place: tuple[float, float], word: str, colour: str) -> None:
    if word:
        axes.annotate(word, place, _BESIDE, textcoords="offset points", ha="right", va="bottom",
                      color=colour, fontsize=6.5, bbox=_PAPER, zorder=5)
