"""Quantities that colour a film in rotatable pictures: values, words, scale, colours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from tympan.base.arrays import Array
from tympan.reports import look
from tympan.reports.scales import AxisScale, round_scale
from tympan.studies.film_surface import FilmSurface

#: Largest margin that has a colour of its own.
MOST_MARGIN = 10.0

#: Factors by which depth may be enlarged, round numbers.
DEPTHS = (1, 2, 5, 10, 20)
#: Sag of a plate as drawn, as a share of the frame's half extent: it is visible and still looks
#: like a film.
_HANGS = 0.25


@dataclass(frozen=True)
class Colouring:
    """A quantity: its ``label`` in a list, ``words`` with unit, and its values at a film's points.

    ``scale`` covers a range of values; ``colours`` is matplotlib's name of the map.
    """

    label: str
    words: str
    unit: str
    of: Callable[[FilmSurface], Array]
    scale: Callable[[float, float], AxisScale] = round_scale
    colours: str = look.COLOURS

    @property
    def title(self) -> str:
        """Words and unit."""
        return f"{self.words} ({self.unit})" if self.unit else self.words


def _margin(film: FilmSurface) -> Array:
    share = film.values["breakdown_share"]
    margin = np.divide(1.0, share, where=share > 0, out=np.full(len(share), np.inf))
    return np.asarray(np.minimum(margin, MOST_MARGIN))


def _margins(low: float, high: float) -> AxisScale:
    """Give all films the same scale."""
    return AxisScale(0.0, MOST_MARGIN, (0.0, 2.0, 4.0, 6.0, 8.0, 10.0))


#: Quantities that colour any film, by key.
COLOURINGS = {
    "stress": Colouring("largest stress", "largest principal true stress", "kPa",
                        lambda film: film.values["stress_1"] / 1e3),
    "field": Colouring("electric field", "electric field", "MV/m",
                       lambda film: film.values["electric_field"] / 1e6),
    "margin": Colouring("breakdown margin",
                        f"strength over field, to {MOST_MARGIN:g}: 1 is breakdown", "",
                        _margin, _margins),
    "thickness": Colouring("thickness", "thickness", "µm",
                           lambda film: film.values["thickness"] * 1e6),
    "deflection": Colouring("deflection", "deflection", "mm",
                            lambda film: film.values["displacement"][:, 2] * 1e3)}


def about_zero(low: float, high: float) -> AxisScale:
    """Make a scale that reaches as far below zero as above."""
    half = round_scale(0.0, max(abs(low), abs(high)), 3)
    ticks = [tick for tick in half.ticks if tick]
    return AxisScale(-half.high, half.high, (*(-tick for tick in ticks[::-1]), 0.0, *ticks))


@cache
def colour_table(name: str) -> NDArray[np.uint8]:
    """Compute the 256 colours of a map, shape (256, 3)."""
    return np.round(255 * colormaps[name](np.arange(256))[:, :3]).astype(np.uint8)


@cache
def css_gradient(name: str = look.COLOURS) -> str:
    """Write the colours of a map as a CSS gradient, from left to right."""
    stops = ", ".join(f"rgb({red}, {green}, {blue})" for red, green, blue
                      in colour_table(name)[np.linspace(0, 255, 17).round().astype(int)])
    return f"linear-gradient(to right, {stops})"


def tick_places(scale: AxisScale) -> list[dict[str, str]]:
    """Place the ticks along a colour bar, with their words."""
    return [{"left": f"{100 * (tick - scale.low) / (scale.high - scale.low):.2f}%",
             "text": scale.text(tick)} for tick in scale.ticks]


def usual_depth(sag: float, extent: float) -> int:
    """Choose the factor on depths that makes the sag of a film visible; lengths in one unit."""
    if sag == 0:
        return 1
    return max((factor for factor in DEPTHS if factor <= _HANGS * extent / sag), default=1)
