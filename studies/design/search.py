"""The best film of a space: random starts, and steps from the best of them.

The steps are those of :func:`tympan.studies.design.sqp.maximise`, by differences of reduced films.
Where no quantity is optimised, or no film keeps all bounds, the common share by which all bounds
are kept is maximised. It is negative where they cannot be kept.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.design.space import DesignSpace
from tympan.studies.design.sqp import Descent, DescentSettings, Linearisation, maximise
from tympan.studies.films.population import LoadedFilms
from tympan.studies.wanted import QUANTITIES, Bound

#: Number of the best random films; the search starts from each of them.
_STARTS = 2
#: Step of differences, as a share of a variable's range: truncation 1e-6, rounding 1e-7.
_STEP = 1e-3
#: Largest share by which bounds may be kept or missed in common.
_COMMON = 4.0
#: Cost of a missed share, over the aim, among random films.
_PRICE = 10.0
#: Largest missed share at an optimum: 10 um for a frame of 100 mm.
KEPT = 1e-4

#: Settings of the steps; differences are accurate to about 1e-5 of the aim.
_DESCENT = DescentSettings(step=3e-4, gain=1e-6, residual=1e-2, violation=KEPT, iterations=40)


@dataclass(frozen=True, eq=False)
class Search:
    """Films of a space as an objective of the search.

    ``best``: the quantity to optimise under bounds, or "" for their common share. ``least``:
    whether its least value is sought, where that is not the usual sense. ``shifts``: margins of the
    bounds for scatter, as shares.
    """

    space: DesignSpace
    bounds: Mapping[str, Bound]
    best: str
    shifts: Mapping[str, float] = field(default_factory=dict)
    least: bool | None = None

    @property
    def variables(self) -> int:
        """Number of variables, including the common share."""
        return len(self.space.variables) + (not self.best)

    def missed(self, films: LoadedFilms) -> Array:
        """Compute the missed shares c of films, (films, bounds); nan without their states."""
        c = np.array([bound.misses(films) + self.shifts.get(key, 0.0)
                      for key, bound in self.bounds.items()]).T
        return np.where(films.sound[:, None], c, np.nan)

    def aims(self, films: LoadedFilms) -> Array:
        """Compute the aim that is maximised, (films,)."""
        quantity = QUANTITIES[self.best]
        least = not quantity.gain if self.least is None else self.least
        return np.asarray(quantity.of(films) * (-1 if least else 1))

    def at(self, x: Array) -> Linearisation | None:
        """Linearise at shares x of the ranges; None where there is no film."""
        size = len(self.space.variables)
        unit = np.eye(size)
        ahead = np.clip(x[:size] + _STEP * unit, 0, 1)
        behind = np.clip(x[:size] - _STEP * unit, 0, 1)
        places = np.concatenate([x[None, :size], ahead, behind])
        films = self.space.films(self.space.values(places))
        c = self.missed(films)
        f = self.aims(films) if self.best else np.zeros(len(places))
        table = np.column_stack([f, c])
        if not np.isfinite(table[0]).all():
            return None
        steps = np.array([(ahead - x[:size]).diagonal(), (x[:size] - behind).diagonal()])
        first, last = (np.where(np.isfinite(part), part, table[0])
                       for part in (table[1: 1 + size], table[1 + size:]))
        there = np.array([np.isfinite(part).all(1)
                          for part in (table[1: 1 + size], table[1 + size:])])
        whole = (steps * there).sum(0)
        if not whole.all():
            return None
        slopes = ((first - last) / whole[:, None]).T
        if self.best:
            return Linearisation(float(f[0]), slopes[0], c[0], slopes[1:])
        # The common share t is the last variable, and it is maximised.
        t = _COMMON * (2 * x[-1] - 1)
        wide = np.append(np.zeros(size), 2 * _COMMON)
        return Linearisation(t, wide, c[0] + t,
                             np.column_stack([slopes[1:], np.full(len(c[0]), 2 * _COMMON)]))

    def started(self, x: Array) -> Array:
        """Make a start at a film, with the common share of its bounds where that is sought."""
        if self.best:
            return x
        most = self.missed(self.space.films(self.space.values(x[None])))[0].max()
        return np.append(x, np.clip((1 - most / _COMMON) / 2, 0, 1))

    def from_start(self, x: Array) -> Descent:
        """Maximise from a film."""
        # A common share is a share of the bounds, and may itself be close to 0.
        return maximise(self, self.started(x), _DESCENT if self.best else replace(
            _DESCENT, unit=1.0))

    def starts(self) -> Array:
        """Choose the best of random films, (starts, variables)."""
        x, films = self.space.random
        missed = np.maximum(self.missed(films).max(1), -np.inf if not self.best else 0.0)
        merit = -_PRICE * missed
        if self.best:
            aims = self.aims(films)
            merit += aims / np.nanmax(np.abs(aims), initial=1e-300)
        order = np.argsort(np.where(np.isfinite(merit), -merit, np.inf))
        return np.asarray(x[order[: min(_STARTS, int(np.isfinite(merit).sum()))]])

    def found(self, starts: Array) -> Descent | None:
        """Find the best end from several starts; None where no start has its states."""
        ends = [end for start in starts if (end := self.from_start(start)).here is not None]
        return max(ends, key=lambda end: (end.status != "infeasible", value_of(end)), default=None)


def common_share(end: Descent) -> float:
    """Compute the share by which a film keeps all bounds, where their common share was sought.

    A search that ended before its limits claims a larger share than it keeps.
    """
    assert end.here is not None
    return end.here.value - end.here.violation


def value_of(end: Descent) -> float:
    """Compute the value of an end, for comparison with ends of the same violation."""
    assert end.here is not None
    return end.here.value if end.status != "infeasible" else -end.here.violation
