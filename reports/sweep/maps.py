"""Maps of results over two keys of a sweep, as numbers for the page's own SVG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps

from tympan.base.errors import InputError
from tympan.reports.look import COLOURS
from tympan.reports.scales import AxisScale, round_scale
from tympan.reports.sweep.view import Measure, SweepView
from tympan.reports.template import digits
from tympan.studies.sweep.plan import MOST

#: Most values of a key with a row or column each.
_FEW = 12

#: Most maps, of the first keys, so that a browser can show the page.
_MOST_PAIRS = 28

#: Most marks of a page's map without cells: with that many in each of 45 maps it has 9 MB.
_MOST_MARKS = 2000

#: Ticks of a map: place [px] and text.
Ticks = list[tuple[float, str]]

#: Width of a letter [px].
_LETTER = 5.4
#: Width of one of the broad letters "mwMW" [px].
_BROAD = 8.8

#: Width of a map without its labels [px].
WIDTH = 190.0
#: Height of a map without its labels [px].
HEIGHT = 150.0


@dataclass(frozen=True)
class Mark:
    """A value: its place [px], size [px], colour, and text.

    ``hatched``: some case has no result there; if none has, there is no colour. ``beyond``: some
    case is beyond a limit.
    """

    x: float
    y: float
    width: float
    height: float
    colour: str
    text: str
    hatched: bool = False
    beyond: bool = False


@dataclass(frozen=True)
class Map:
    """One result over two keys; ``where`` says its loads, ``bar`` are the ticks of its colours.

    ``shown`` says how many of the cases are drawn if these are too many for a page.
    """

    title: str
    where: str
    across: Ticks
    up: Ticks
    marks: list[Mark]
    bar: Ticks
    cells: bool
    shown: str = ""

    @property
    def margins(self) -> tuple[float, float]:
        """Widths for the words on the left and on the right [px]."""
        first, second = (_widest(ticks) for ticks in (self.up, self.bar))
        slanted = 1.2 * self.slanted - self.across[0][0] if self.slanted else 0.0
        return max(12 + first, slanted), 26 + second

    @property
    def slanted(self) -> float:
        """Height for slanted words below, where level ones would overlap, or 0 [px]."""
        places = [place for place, _ in self.across]
        nearest = min((after - before for before, after in pairwise(places)), default=WIDTH)
        return 0.64 * _widest(self.across) if _widest(self.across) > nearest - _LETTER else 0.0


def _widest(ticks: Ticks) -> float:
    return max(_width(text) for _, text in ticks)


def _width(text: str) -> float:
    broad = sum(text.count(letter) for letter in "mwMW")
    return _LETTER * (len(text) - broad) + _BROAD * broad


@dataclass(frozen=True)
class Maps:
    """All maps over a pair of keys."""

    across: Measure
    up: Measure
    maps: list[Map]


def sweep_maps(view: SweepView) -> list[Maps]:
    """Make the maps of every pair of keys over which something varies."""
    pairs = list(combinations(view.keys, 2))[:_MOST_PAIRS]
    over_pairs = (Maps(across, up, [drawn for drawn, _ in _maps(view, across, up, view.columns,
                                                                _MOST_MARKS)])
                  for across, up in pairs)
    return [maps for maps in over_pairs if maps.maps]


def map_of(view: SweepView, column: Measure, across: Measure, up: Measure
           ) -> tuple[Map, AxisScale]:
    """Make the map of one result over two keys, and the scale of its colours.

    Raises
    ------
    InputError
        When the result does not depend on the keys, or has no values.
    """
    for drawn, scale in _maps(view, across, up, [column]):
        return drawn, scale
    raise InputError("was found nowhere, or does not change with these keys", key="of",
                     given=column.label)


def colours() -> list[str]:
    """List the colours of a scale, from its low end to its high one."""
    return _hex(np.linspace(0, 1, 12))


def _hex(shares: np.ndarray) -> list[str]:
    """Write the colours at shares of a scale in hexadecimal."""
    levels = np.round(255 * colormaps[COLOURS](shares)[:, :3]).astype(int)
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in levels.tolist()]


def _maps(view: SweepView, across: Measure, up: Measure, columns: Sequence[Measure],
          most: int = MOST) -> Iterator[tuple[Map, AxisScale]]:
    pair = [across.name, up.name]
    rows = view.at_shown(*({"mass", "voltage"} - set(pair)))
    rows = rows.assign(word=rows["beyond"].where(rows["beyond"] != ""))
    for column in columns:
        depends = view.table[column.name].dims
        if any(key in view.loads and key not in depends for key in pair):
            continue
        fixed = [load for load in view.loads if load in depends and load not in pair]
        grouped = rows.groupby(pair, sort=False)
        means = grouped.agg(value=(column.name, "mean"), count=(column.name, "count"),
                            cases=(column.name, "size"), name=("label", "first"),
                            word=("word", "first"), beyond=("word", "count")).reset_index()
        if means["value"].notna().any():
            yield _map(column, across, up, view.shown_words(*fixed), means, most)


def _map(column: Measure, across: Measure, up: Measure, where: str, means: pd.DataFrame,
         most: int) -> tuple[Map, AxisScale]:
    values = means["value"].to_numpy(float) / column.size
    finite = values[np.isfinite(values)]
    scale = round_scale(finite.min(), finite.max())
    x, x_ticks, x_cell = _placed(across, means[across.name], WIDTH)
    y, y_ticks, y_cell = _placed(up, means[up.name], HEIGHT)
    cells = bool(x_cell and y_cell)
    shown = ""
    if not cells and len(means) > most:
        some = np.linspace(0, len(means) - 1, most).astype(int)
        x, y, values = x[some], y[some], values[some]
        shown, means = f"{most:,} of {len(means):,} cases", means.iloc[some]
    shades = _hex((values - scale.low) / (scale.high - scale.low))
    marks = []
    for at_x, at_y, value, shade, count, cases, name, beyond, word in zip(
            x.tolist(), y.tolist(), values.tolist(), shades, means["count"], means["cases"],
            means["name"], means["beyond"], means["word"], strict=True):
        colour = shade if np.isfinite(value) else ""
        text = digits(value) if colour else "no result"
        if count > 1:
            text += f", mean of {count}"
        elif cases == 1:
            text = f"{name}: {text}"
        if 0 < count < cases:
            text += f"; {cases - count} of {cases} without a result"
        if beyond:
            of_cases = f"; {beyond} of {cases}" if cases > 1 else ","
            text += f"{of_cases} beyond {word}"
        marks.append(Mark(at_x, HEIGHT - at_y, x_cell, y_cell, colour, text, count < cases,
                          bool(beyond)))
    span = scale.high - scale.low
    bar = [(HEIGHT * (1 - (tick - scale.low) / span), scale.text(tick)) for tick in scale.ticks]
    y_ticks = [(HEIGHT - at, text) for at, text in y_ticks]
    return Map(column.heading, where, x_ticks, y_ticks, marks, bar, cells, shown), scale


def _placed(key: Measure, values: pd.Series[Any], length: float
            ) -> tuple[np.ndarray, Ticks, float]:
    """Place values along an axis of a length, with its ticks and the size of a cell, or 0 [px]."""
    distinct, numbers = pd.unique(values), pd.api.types.is_numeric_dtype(values)
    if not numbers or len(distinct) <= _FEW:
        order = sorted(distinct) if numbers else list(distinct)
        cell = length / len(order)
        every = -(-len(order) // 6)
        ticks = [((number + 0.5) * cell, f"{value / key.size:.4g}" if numbers else str(value))
                 for number, value in enumerate(order) if number % every == 0]
        return (values.map(order.index).to_numpy(float) + 0.5) * cell, ticks, cell
    shown = values.to_numpy(float) / key.size
    scale = round_scale(shown.min(), shown.max(), 4)
    low, high = min(shown.min(), scale.low), max(shown.max(), scale.high)
    ticks = [((tick - low) / (high - low) * length, scale.text(tick)) for tick in scale.ticks]
    return (shown - low) / (high - low) * length, ticks, 0.0
