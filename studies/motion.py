"""Motion of a film along time, by any model: its moments, and curves through them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.transient.dense_output import spline
from tympan.studies.signals import Signal, nominal

if TYPE_CHECKING:
    import pandas as pd

#: Number of points of a loop, for a smooth line.
_POINTS = 401
#: Points of Gauss's rule between two times of a motion: exact where the voltage is linear, and to
#: 1e-9 where a step is a quarter of a sine.
_GAUSS = 6


@dataclass(frozen=True, eq=False)
class Trace:
    """The moments of a motion [s], ascending; a moment that appears twice is a jump.

    Values at the moments are arrays whose first axis is time. Between jumps they follow cubic
    splines.
    """

    time: Array

    @property
    def end(self) -> float:
        """Time of the last moment [s]."""
        return float(self.time[-1])

    @cached_property
    def parts(self) -> list[slice]:
        """Slices of the moments between jumps."""
        starts = (np.flatnonzero(np.diff(self.time) == 0) + 1).tolist()
        return [slice(*ends) for ends in zip([0, *starts], [*starts, len(self.time)], strict=True)]

    def at(self, values: Array, when: Array) -> Array:
        """Interpolate values at times [s]; at a jump the value after it, nan past the end."""
        result = np.full((len(when), *values.shape[1:]), np.nan)
        starts = self.time[[part.start for part in self.parts]]
        of = np.where(when <= self.time[-1], np.searchsorted(starts, when, "right") - 1, -1)
        order = np.argsort(of, kind="stable")
        ends = np.searchsorted(of[order], np.arange(len(self.parts) + 1))
        for number in np.flatnonzero(np.diff(ends)).tolist():
            within = order[ends[number]:ends[number + 1]]
            part = self.parts[number]
            result[within] = spline(self.time[part], values[part])(when[within])
        return result

    def rates(self, values: Array) -> Array:
        """Compute the rate of change of values at the moments [1/s].

        At a jump these are the rates before and after it; the jump itself has no rate.
        """
        return np.concatenate([spline(self.time[part], values[part])(self.time[part], 1)
                               for part in self.parts])

    def integrals(self, values: Array) -> Array:
        """Integrate values of shape (moments,) over each part between jumps."""
        return np.array([spline(self.time[part], values[part]).integrate(
            self.time[part.start], self.time[part.stop - 1]) for part in self.parts])

    def extremes(self, values: Array) -> tuple[tuple[float, float], tuple[float, float]]:
        """Find time [s] and value of the smallest, and time and value of the largest.

        The values have the shape (moments,). Extremes between moments are found, too. Of several
        equal extremes the first counts.
        """
        when, what = [self.time], [values]
        for part in self.parts:
            curve = spline(self.time[part], values[part])
            turns = curve.derivative().roots(extrapolate=False)
            # Where the curve is constant, any time is a root, which scipy marks by a nan.
            turns = turns[np.isfinite(turns)]
            when.append(turns)
            what.append(curve(turns))
        times, heights = np.concatenate(when), np.concatenate(what)
        low, high = (int(np.lexsort((times, sign * heights))[0]) for sign in (1, -1))
        return (float(times[low]), float(heights[low])), (float(times[high]), float(heights[high]))

    def last_loop(self, signal: Signal, period: float, deflection: Array
                  ) -> tuple[pd.DataFrame, float]:
        """Sample the last period [s] of a signal, and compute ∮ y du [V m].

        The area is positive if the deflection lags behind the voltage.
        """
        import pandas as pd  # films of a sweep, and force curves, do without

        when = np.linspace(self.end - period, self.end, _POINTS)
        u, y = nominal(signal, when), self.at(deflection, when)
        area = self._enclosed(signal, float(when[0]), deflection)
        return (pd.DataFrame({"voltage": u, "deflection": y}),
                area - float(u[-1] * y[-1] - u[0] * y[0]))

    def _enclosed(self, signal: Signal, begin: float, deflection: Array) -> float:
        """Integrate ∫ u dy [V m] from a time [s] on; jumps count at their mean voltage."""
        nodes, weights = np.polynomial.legendre.leggauss(_GAUSS)
        time, total = self.time, 0.0
        for part, following in zip(self.parts, [*self.parts[1:], None], strict=True):
            times = np.unique(np.maximum(time[part], begin))
            if len(times) > 1:
                half = np.diff(times)[:, None] / 2
                at = times[:-1, None] + half + half * nodes
                rates = spline(time[part], deflection[part])(at, 1)
                total += float((half * weights * nominal(signal, at) * rates).sum())
            if following is not None and time[following.start] > begin:
                jump = deflection[following.start] - deflection[part.stop - 1]
                piece = int(np.searchsorted(signal.breaks, time[following.start])) - 1
                ends = [signal.within(number, time[following.start])
                        for number in (piece, piece + 1)]
                total += float(jump * np.mean(ends))
        return total
