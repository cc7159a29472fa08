"""Deflection against voltage as a picture of the page, with readings and residuals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from jinja2 import Template

from tympan.base.arrays import Array
from tympan.explore.session import FollowedCurve, Readings
from tympan.reports.figures.curve import VoltageCurve
from tympan.reports.scales import AxisScale, round_scale
from tympan.reports.template import template

#: Width of the picture in its own units, about pixels: the page scales it to its column.
_WIDTH = 560
#: Width on the left for the numbers of an axis.
_LEFT = 52
#: Width on the right for half of the last number.
_RIGHT = 14
#: Height above the curve for the words of its axis.
_TOP = 22
#: Height of the curve.
_HIGH = 230
#: Height between the curve and the residuals below it, for their words.
_GAP = 30
#: Height of the residuals, a third of the curve's: their axis has few numbers.
_LOW = 80
#: Height of a line of words.
_TEXT = 12
#: Height below for the numbers and the words of the voltage.
_BELOW = 38


@dataclass(frozen=True)
class _Panel:
    """Axes of a picture in its pixels."""

    across: AxisScale
    up: AxisScale
    top: float
    bottom: float

    def place(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Convert points to pixels."""
        right = _WIDTH - _RIGHT
        along = (x - self.across.low) / (self.across.high - self.across.low)
        high = (y - self.up.low) / (self.up.high - self.up.low)
        return _LEFT + along * (right - _LEFT), self.bottom - high * (self.bottom - self.top)

    def path(self, x: Array, y: Array) -> str:
        """Write a line through points."""
        places = np.column_stack(self.place(x, y)).ravel().tolist()
        return "M" + "L".join(["%.1f %.1f"] * (len(places) // 2)) % tuple(places)

    def parts(self, words: str, named: bool, lines: Sequence[Any], points: Sequence[Any]
              ) -> dict[str, Any]:
        """Collect the parts that the template draws."""
        return {
            "left": _LEFT, "right": _WIDTH - _RIGHT, "top": self.top, "bottom": self.bottom,
            "words": words, "named": named, "lines": lines, "points": points,
            "across": [{"at": round(self.place(tick, self.up.low)[0], 1),
                        "text": self.across.text(tick)} for tick in self.across.ticks],
            "up": [{"at": round(self.place(self.across.low, tick)[1], 1),
                    "text": self.up.text(tick)} for tick in self.up.ticks]}


def drawn_curve(curve: FollowedCurve, here: tuple[float, float] | None) -> str:
    """Draw the curve as SVG; ``here`` is the film's place, in kV and mm."""
    line = curve.line
    readings = curve.readings
    across = _scale(line.voltage, () if readings is None else readings.voltage / 1e3,
                    () if here is None else here[:1])
    up = _scale(line.deflection, line.band[1:].ravel(),
                () if readings is None else readings.measured * 1e3,
                () if here is None else here[1:])
    panel = _Panel(across, up, _TOP, _TOP + _HIGH)
    panels = [panel.parts("deflection (mm)", readings is None, list(_lines(panel, line)),
                          [*_readings(panel, readings), *_limits(panel, line),
                           *([] if here is None else [_point(panel, *here, "here", 5)])])]
    height = panel.bottom + _BELOW
    if readings is not None:
        panels.append(_residuals(across, readings, height - _BELOW + _GAP))
        height += _GAP + _LOW
    return _picture().render(
        width=_WIDTH, height=height, panels=panels, title=_title(line, readings))


@cache
def _picture() -> Template:
    """Load the picture's template once; compiling it takes longer than drawing."""
    return template("explore/curve.html")


def _scale(*values: Any) -> AxisScale:
    every = np.concatenate([np.asarray(part, float) for part in values])
    every = every[np.isfinite(every)]
    return round_scale(min(0.0, every.min(initial=0.0)), every.max(initial=0.0) or 1.0)


def _lines(panel: _Panel, line: VoltageCurve) -> Iterator[dict[str, str]]:
    """Draw the band, the curve to its first limit, beyond it, and as if it could not wrinkle."""
    places, *edges = line.band
    there = np.isfinite(edges).all(0)
    if there.sum() > 1:
        low, high = (edge[there] for edge in edges)
        x = places[there]
        outline = panel.path(np.append(x, x[::-1]), np.append(low, high[::-1]))
        yield {"kind": "band", "path": f"{outline}Z"}
    if len(line.voltage) < 2:
        return
    x, y = line.line
    for kind, part in zip(("line", "line beyond", "line kept"), line.parts, strict=True):
        if part.sum() > 1:
            yield {"kind": kind, "path": panel.path(x[part], y[part])}


def _limits(panel: _Panel, line: VoltageCurve) -> list[dict[str, Any]]:
    """Draw a mark at each limit; words of coinciding limits stand in one line."""
    marks: list[dict[str, Any]] = []
    for limit in line.limits.reached if len(line.voltage) else ():
        mark = _point(panel, limit.voltage_V / 1e3, line.deflection_at(limit), "mark", 4,
                      limit.state.label)
        if marks and abs(mark["y"] - marks[-1]["y"]) < _TEXT:
            mark["word"] = f"{marks[-1]['word']}, {mark['word']}"
            marks[-1]["word"] = ""
        marks.append(mark)
    return marks


def _readings(panel: _Panel, readings: Readings | None) -> Iterator[dict[str, Any]]:
    if readings is not None:
        for voltage, measured in zip(readings.voltage, readings.measured, strict=True):
            yield _point(panel, float(voltage) / 1e3, float(measured) * 1e3, "reading", 2.5)


def _residuals(across: AxisScale, readings: Readings, top: float) -> dict[str, Any]:
    """Draw measured minus simulated deflection at every reading that has both."""
    there = np.isfinite(readings.residual)
    voltage, residual = readings.voltage[there] / 1e3, readings.residual[there] * 1e6
    most = float(np.abs(residual).max(initial=0.0)) or 1.0
    panel = _Panel(across, round_scale(-most, most, 3), top, top + _LOW)
    axis = panel.path(np.array([across.low, across.high]), np.zeros(2))
    lines = [{"kind": "axis", "path": axis}]
    points = [_point(panel, float(x), float(y), "reading", 2.5)
              for x, y in zip(voltage, residual, strict=True)]
    return panel.parts("measured − simulated (µm)", True, lines, points)


def _point(panel: _Panel, x: float, y: float, kind: str, r: float, word: str = ""
           ) -> dict[str, Any]:
    across, down = panel.place(x, y)
    return {"kind": kind, "x": round(across, 1), "y": round(down, 1), "r": r, "word": word}


def _title(line: VoltageCurve, readings: Readings | None) -> str:
    words = f"deflection against voltage under {line.mass:g} g: {line.end}"
    return words if readings is None else f"{words}; with {len(readings.voltage)} readings"
