"""Numbers for pictures: colour limits, ticks, sizes on paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, floor, log10

from matplotlib.ticker import MaxNLocator


@dataclass(frozen=True)
class AxisScale:
    """A linear axis or colour scale from ``low`` to ``high`` with round ticks ``step`` apart."""

    low: float
    high: float
    ticks: tuple[float, ...]

    @property
    def step(self) -> float:
        """Distance between ticks."""
        return self.ticks[1] - self.ticks[0]

    @property
    def decimals(self) -> int:
        """Number of decimals that write the ticks exactly."""
        return next(count for count in range(20) if abs(round(self.step, count) - self.step) < 1e-6
                    * self.step)

    @property
    def from_zero(self) -> bool:
        """Whether lengths on this scale may be compared."""
        return self.low == 0

    @property
    def start(self) -> str:
        """The low end as text, exactly."""
        return self.text(self.low, more=0 if self.low == self.ticks[0] else 1)

    def text(self, value: float, more: int = 0) -> str:
        """Write a value with the decimals of the ticks, and ``more``."""
        return f"{value:.{self.decimals + more}f}".replace("-", "\N{MINUS SIGN}")


def round_scale(low: float, high: float, intervals: int = 5) -> AxisScale:
    """Choose a scale that just covers the values from ``low`` to ``high``, ending on half ticks.

    It starts at zero if the smallest value is less than a quarter of the largest. Equal values get
    a scale of a thousandth of their size, so that rounding errors do not fill it.

    Examples
    --------
    >>> round_scale(96.53, 98.68)
    AxisScale(low=96.5, high=98.75, ticks=(96.5, 97.0, 97.5, 98.0, 98.5))
    >>> round_scale(3.0, 41.0).low
    0.0
    """
    if 0 <= low < high / 4:
        low = 0.0
    least = max(abs(low), abs(high)) * 1e-3 or 1.0
    if high - low < least:
        low, high = (low + high - least) / 2, (low + high + least) / 2
    locator = MaxNLocator(intervals, steps=[1, 2, 2.5, 5, 10])
    start, second, *_ = locator.tick_values(low, high)
    step = float(second - start)
    half = step / 2
    # A value on a half tick, up to rounding, needs no further one.
    first, last = floor(low / half + 1e-9), ceil(high / half - 1e-9)
    first_tick, last_tick = ceil(first / 2), last // 2
    ticks = tuple(round(index * step, 12) for index in range(first_tick, last_tick + 1))
    return AxisScale(round(first * half, 12), round(last * half, 12), ticks)


def rows_of_panels(count: int, most: int = 3) -> list[range]:
    """Arrange the indices of ``count`` items in rows of at most ``most``, as even as possible.

    Examples
    --------
    >>> [list(row) for row in rows_of_panels(5)]
    [[0, 1, 2], [3, 4]]
    """
    rows = -(-count // most)
    longest = -(-count // rows)
    return [range(start, min(start + longest, count)) for start in range(0, count, longest)]


def paper_scale(rows: Sequence[Sequence[float]], width: float, gap: float, least: float,
                most: float) -> float:
    """Find the millimetres on paper for one millimetre of film, the same for all films of all rows.

    ``rows`` holds the widths of the films in each row; ``width`` is that of the page, ``gap`` that
    between columns. No column is narrower than ``least`` and no film wider than ``most`` on paper.
    All are in mm.
    """
    bound = most / max(max(row) for row in rows)
    for row in rows:
        low, high = 0.0, bound
        for _ in range(60):
            middle = (low + high) / 2
            fits = sum(column_widths(row, middle, least)) + gap * (len(row) - 1) <= width
            low, high = (middle, high) if fits else (low, middle)
        bound = min(bound, high)
    return bound


def column_widths(films: Sequence[float], paper: float, least: float) -> list[float]:
    """Compute the widths on paper [mm] of columns for films of these widths [mm] at a scale."""
    return [max(film * paper, least) for film in films]


def bar_length(width: float) -> float:
    """Choose a round length near a sixth of the widest film, for the scale bar.

    Examples
    --------
    >>> bar_length(150.0), bar_length(20.0)
    (20.0, 2.0)
    """
    decade = 10 ** floor(log10(width / 6))
    return float(max(factor * decade for factor in (1.0, 2.0, 5.0)
                     if factor * decade <= width / 6 * (1 + 1e-9)))
