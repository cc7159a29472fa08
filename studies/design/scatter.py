"""Margins with which most films keep a bound, and the design most of whose films keep all bounds.

The bounds of the film without scatter are shifted by its difference from the film at the required
quantile. The search is repeated with these shifts, as they change with the film (sequential
optimisation and reliability assessment: Du, Chen, J. Mech. Des. 126, 2004). With such shifts each
bound is missed equally often. Where no film keeps the bounds with them, other films may keep them:
:class:`KeptByMost` evaluates each film's worst bound, and the share of the films that keep it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.stats import norm

from tympan.base.arrays import Array, Mask, Numbers
from tympan.base.points import drawn_points
from tympan.studies.design.search import KEPT, Search, value_of
from tympan.studies.design.sqp import (
    Descent,
    DescentSettings,
    DescentStatus,
    Linearisation,
    kkt,
    maximise,
)
from tympan.studies.films.population import LoadedFilms
from tympan.studies.wanted import BREAKDOWN, TENSION, Bound

#: Share of the margin to the loss of tension that a film without equilibrium misses.
_LOST = 10.0
#: Missed share above which a film has no equilibrium: larger than any other, with room for errors.
_NONE = 5.0
#: Smallest value of the worst film, over the bound, for which its ratio to the nominal is used.
_LITTLE = 0.05
#: Fewest films with equilibrium from which the films without equilibrium are estimated.
_FEWEST = 16
#: Random films about a design, where the share of them that keep all bounds is sought.
_DRAWN = 512
#: Number of random films next to the quantile, from which its slope is computed.
_NEXT = 32
#: Random designs that may be better starts than the known one.
_LOOKED_AT = 15
#: Films about each random design.
_FEW = 128

#: Most designs in one sequence.
_ROUNDS = 8
#: Change of the design, as a share of the ranges, below which a sequence ends.
_STILL = 2e-3

#: Settings of a search on the miss of 512 films, which is smooth to about 1e-3.
_DESCENT = DescentSettings(step=1e-3, gain=1e-5, residual=3e-2, violation=KEPT, iterations=15)


@dataclass(frozen=True, eq=False)
class ScatteredFilms:
    """Films about designs, with the share by which they miss each bound: (films, bounds).

    Only bounds that scatter are included. A film without equilibrium has lost its tension, and
    counts as missing no other bound. ``search`` has no margins and no other bounds.
    """

    search: Search
    films: LoadedFilms
    missed: Array

    @classmethod
    def of(cls, search: Search, designs: Array, points: Array) -> ScatteredFilms:
        """Draw films about designs of some values, at points (films, inputs) from 0 to 1."""
        films = search.space.scattered(designs, points)
        bounds = {key: bound for key, bound in search.bounds.items() if bound.quantity.scatters}
        bare = replace(search, bounds=bounds, shifts={})
        missed = bare.missed(films)
        lost = ~np.isfinite(missed).all(1)
        missed[lost] = -np.inf
        missed[lost, list(bounds).index(TENSION)] = _LOST
        return cls(bare, films, missed)

    @property
    def lost(self) -> Mask:
        """Mask of films that do not bear their voltage, or that times its margin, (films,)."""
        with np.errstate(invalid="ignore"):
            broken = self.films.breakdown[:, 1] > 1
        return np.asarray((self.missed[:, self.keys.index(TENSION)] > 0) | broken)

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the bounds."""
        return tuple(self.search.bounds)

    def shifts(self, values: Array, failing: float) -> dict[str, float]:
        """Find margins of the film without scatter so that a share of films fails each bound.

        The film has some ``values``; the share is ``failing``. A quantity scatters in proportion to
        itself: where its worst film must be at the bound, the ratio of both is kept.
        """
        nominal = self.search.missed(self.search.space.films(values[None]))[0]
        found = dict[str, float]()
        for number, (key, bound) in enumerate(self.search.bounds.items()):
            worst = exceeded(self.missed[:, number], failing)
            change = worst - float(nominal[number])
            reached = 1 - worst if bound.least else 1 + worst
            found[key] = change / reached if key != TENSION and reached > _LITTLE else change
        return found

    def lines(self, values: Array) -> tuple[Array, Array]:
        """Find copies' misses as lines in the design's miss: slopes and constants, (bounds, films).

        It is assumed that films of another design scatter as those about the design of some
        ``values``: in proportion to the quantity.
        """
        nominal = self.search.missed(self.search.space.films(values[None]))[0]
        rates, constants = np.ones_like(self.missed), self.missed - nominal
        for number, (key, bound) in enumerate(self.search.bounds.items()):
            if key == TENSION:
                continue
            sign = -1.0 if bound.least else 1.0
            copies = self.missed[:, number]
            there = np.isfinite(copies)
            ratio = (1 + sign * copies[there]) / (1 + sign * nominal[number])
            rates[:, number], constants[:, number] = 0.0, -np.inf
            rates[there, number], constants[there, number] = ratio, sign * (ratio - 1)
        return rates.T, constants.T

    def kept(self, off: Mapping[str, float], but: str = "") -> Mask:
        """Find the films that keep all bounds, or all ``but`` one: a mask, (films,).

        ``off`` holds the errors of reduced films.
        """
        others = [key != but for key in self.keys]
        return np.asarray((self.missed + self._errors(off) <= 0)[:, others].all(1))

    def kept_each(self, off: Mapping[str, float]) -> dict[str, Mask]:
        """Find the films that keep each bound: masks by key.

        A film that does not bear its voltage keeps no bound but the margin to a limit that it does
        not meet.
        """
        kept = self.missed + self._errors(off) <= 0
        taut = kept[:, self.keys.index(TENSION)]
        bears = {TENSION: np.ones_like(taut), BREAKDOWN: taut}
        return {key: np.asarray(kept[:, number] & bears.get(key, ~self.lost))
                for number, key in enumerate(self.keys)}

    def worst(self, off: Mapping[str, float]) -> Array:
        """Find the largest share by which each film misses a bound, (films,)."""
        return np.asarray((self.missed + self._errors(off)).max(1))

    def _errors(self, off: Mapping[str, float]) -> Array:
        return np.array([off.get(key, 0.0) for key in self.keys])

    def attained(self, bound: Bound, off: Mapping[str, float], share: float) -> float | None:
        """Find the value of a bound's quantity that a share of films reach and keep all others."""
        kept = self.kept(off, but=bound.key)
        values = np.where(kept, bound.quantity.of(self.films), -np.inf if bound.least else np.inf)
        value = of_share(values, share, gain=bound.least)
        return value if np.isfinite(value) else None


@dataclass(frozen=True, eq=False)
class KeptByMost:
    """Designs as an objective: the share by which most of their films keep all bounds.

    This share is maximised, or, where the search optimises a quantity, must not be negative.
    ``share`` is the share of the films that counts as most. ``off`` holds the errors of reduced
    films against finite elements. Films are assumed to scatter like those about a design at shares
    ``about`` of the ranges; at that design this is exact.
    """

    search: Search
    off: Mapping[str, float]
    share: float
    about: Array

    @cached_property
    def _lines(self) -> tuple[Array, Array]:
        """Slopes and constants of the copies' misses in the miss of their design."""
        values = self.search.space.values(self.about)
        points = drawn_points(self.search.space.inputs, _DRAWN, 1)
        copies = ScatteredFilms.of(self.search, values, points)
        rates, constants = copies.lines(values)
        errors = [self.off.get(key, 0.0) for key in copies.keys]
        return rates, constants + np.reshape(errors, (-1, 1))

    @cached_property
    def _scatters(self) -> Mask:
        return np.array([bound.quantity.scatters for bound in self.search.bounds.values()])

    def at(self, x: Array) -> Linearisation | None:
        """Linearise at shares x of the ranges; None where there is no film."""
        common = [] if self.search.best else [0.5]
        bare = replace(self.search, shifts={}).at(np.append(x, common))
        if bare is None:
            return None
        scatters, slopes = self._scatters, bare.limit_slopes[:, : len(x)]
        rates, constants = self._lines
        missed = rates * bare.limits[scatters, None] + constants
        next_to = self._next_to(missed.max(0))
        worst = missed[:, next_to].argmax(0)
        # The slope of a quantile is the mean slope of the films next to it.
        slope = (rates[worst, next_to, None] * slopes[scatters][worst]).mean(0)
        miss = exceeded(missed.max(0), 1 - self.share)
        limits, slopes = bare.limits[~scatters], slopes[~scatters]
        if not self.search.best:
            return Linearisation(-miss, -slope, limits, slopes)
        return Linearisation(bare.value, bare.slope, np.append(limits, miss),
                             np.concatenate([slopes, slope[None]]))

    def _next_to(self, worst: Array) -> Numbers:
        """Find the numbers of the films next to the quantile of the share."""
        order = np.argsort(worst)
        order = order[worst[order] < _NONE]
        place = min(int(self.share * len(worst)), len(order) - 1)
        return order[max(place - _NEXT // 2, 0): place + _NEXT // 2]

    def likeliest(self) -> Array:
        """Choose the design, or a random design whose copies keep the bounds better, as a start.

        Of the random designs, only those are tried that would be best if all scattered alike.
        """
        space, bare = self.search.space, replace(self.search, shifts={})
        shares, films = space.random
        missed, (rates, constants) = bare.missed(films), self._lines
        guessed = missed[:, self._scatters, None] * rates + constants
        found = np.maximum(np.quantile(guessed.max(1), self.share, axis=1),
                           missed[:, ~self._scatters].max(1, initial=-np.inf))
        order = np.argsort(np.where(np.isfinite(found), found, np.inf))[:_LOOKED_AT]
        starts = np.concatenate([self.about[None], shares[order]])
        points = drawn_points(space.inputs, _FEW, 1)
        films_about = ScatteredFilms.of(self.search, space.values(starts), points)
        worst = films_about.worst(self.off).reshape(len(starts), -1)
        return np.asarray(starts[np.argmin([exceeded(each, 1 - self.share) for each in worst])])

    def ended(self, here: Linearisation) -> Descent:
        """Make the end of a search at the design, with its values there."""
        status: DescentStatus = "optimum" if here.violation <= KEPT else "infeasible"
        return Descent(status, self.about, here, kkt(self.about, here))

    def prices(self, end: Descent) -> Array:
        """Compute the cost of a share of each bound in the aim, (bounds,)."""
        assert end.multipliers is not None
        assert end.here is not None
        prices, limits = np.zeros(len(self._scatters)), end.multipliers.limits
        prices[~self._scatters] = limits[: int((~self._scatters).sum())]
        bare = replace(self.search, best="", shifts={}).at(np.append(end.x, 0.5))
        assert bare is not None
        rates, constants = self._lines
        missed = rates * bare.limits[self._scatters, None] + constants
        worst = missed[:, self._next_to(missed.max(0))].argmax(0)
        shares = np.bincount(worst, minlength=len(missed)) / len(worst)
        prices[self._scatters] = shares * (limits[-1] if self.search.best else 1.0)
        return prices


def kept_by_most(search: Search, off: Mapping[str, float], share: float, x: Array
                 ) -> tuple[KeptByMost, Descent] | None:
    """Find the best of successive designs from shares x, each found by films about the last one.

    None where a film without scatter has no states.
    """
    best: tuple[KeptByMost, Descent] | None = None
    for _ in range(_ROUNDS):
        most = KeptByMost(search, off, share, x)
        here = most.at(x)
        found = None if here is None else most.ended(here)
        if found is not None and (best is None or _rank(found) > _rank(best[1])):
            best = most, found
            # The share of a bound by which most films keep all bounds may itself be close to 0.
            end = maximise(most, x, _DESCENT if search.best else replace(_DESCENT, unit=1.0))
            x = x if end.here is None else end.x
        elif best is not None:  # films scatter differently there: halve the way
            x = (x + best[1].x) / 2
        if best is None or np.abs(x - best[1].x).max() < _STILL:
            break
    return best


def _rank(end: Descent) -> tuple[bool, float]:
    return end.status == "optimum", value_of(end)


def of_share(values: Array, share: float, *, gain: bool) -> float:
    """Find the value of a film that the share of the films reach: at least, a gain, or at most."""
    sign = -1.0 if gain else 1.0
    return sign * float(np.quantile(sign * values, share, method="inverted_cdf"))


def exceeded(missed: Array, failing: float) -> float:
    """Find the missed share that a share ``failing`` of the films exceed.

    Where more films have no equilibrium, it is estimated as if all films were normally distributed.
    Then it is above 0, and grows with the number of these films.
    """
    missed = missed[missed > -np.inf]
    there = np.sort(missed[missed < _NONE])
    lacking = (1 - failing) * (len(missed) - 1) + 1 - len(there)
    if lacking < 0 or len(there) < _FEWEST:
        return float(np.quantile(missed, 1 - failing)) if len(missed) else _LOST
    at = norm.ppf((np.arange(len(there)) + 0.5) / len(missed))
    slope, middle = np.polyfit(at, there, 1)
    estimate = middle + slope * norm.ppf(1 - failing)
    return float(max(estimate, there[-1], 0.0) + lacking / len(missed))


def missed_exactly(search: Search, film: Any) -> Array:
    """Compute the share by which a film of finite elements misses each bound, (bounds,)."""
    return np.array([float(bound.misses(film)[0]) for bound in search.bounds.values()])
