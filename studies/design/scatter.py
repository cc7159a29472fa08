"""Margins that make a bound kept by most films, and the design most of whose films keep all bounds.

The bounds of the film without scatter are shifted by what separates it from the film that the share
of all films do not fall short of. The search is repeated with these, as the shifts change with the
film (sequential optimisation and reliability assessment: Du, Chen, J. Mech. Des. 126, 2004). Such
shifts let each bound be missed equally often. Where no film keeps the bounds with them, others may:
:class:`KeptByMost` looks at each film's worst bound, and at the share of the films that keep it.
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

#: What a film without equilibrium misses of the margin to the loss of tension.
_LOST = 10.0
#: Share missed from which on that is the reason: more than any, less than what errors leave of it.
_NONE = 5.0
#: Share of a bound that the worst film must reach for its ratio to the nominal one to say anything.
_LITTLE = 0.05
#: Fewest films from which others are judged that have no equilibrium.
_FEWEST = 16
#: Films drawn about a design that is sought by the share of them that keep all bounds.
_DRAWN = 512
#: Of these, films next to the one that just the share does better than: they tell the slope.
_NEXT = 32
#: Random designs that may be better starts than the one that is known.
_LOOKED_AT = 15
#: Films about each of these.
_FEW = 128

#: Designs on a way at most.
_ROUNDS = 8
#: Share of the ranges by which a way goes no further.
_STILL = 2e-3

#: The miss of 512 films is smooth to some 1e-3.
_DESCENT = DescentSettings(step=1e-3, gain=1e-5, residual=3e-2, violation=KEPT, iterations=15)


@dataclass(frozen=True, eq=False)
class ScatteredFilms:
    """Films about designs, by what share they miss each bound that scatters: (films, bounds).

    A film without equilibrium has lost its tension; it is not said to miss other bounds.
    ``search``: without margins and other bounds.
    """

    search: Search
    films: LoadedFilms
    missed: Array

    @classmethod
    def of(cls, search: Search, designs: Array, points: Array) -> ScatteredFilms:
        """Films about designs of some values, at points (films, inputs) from 0 to 1."""
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
        """Shares by which the film without scatter, of some values, must keep each bound the more.

        So that this share of the films fails each of them. A quantity scatters in proportion to
        itself: where its worst film shall be at the bound, it is the ratio of both that is kept.
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
        """Misses of copies by that of the design: rates and constants, (bounds, films) each.

        If those of another design scattered as these about the design of some ``values``: in
        proportion to the quantity itself.
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
        """Mask of films that keep all bounds ``but`` one, (films,).

        Reduced films are ``off`` by so much.
        """
        others = [key != but for key in self.keys]
        return np.asarray((self.missed + self._errors(off) <= 0)[:, others].all(1))

    def kept_each(self, off: Mapping[str, float]) -> dict[str, Mask]:
        """Masks of films that keep each bound.

        One that does not bear its voltage keeps none but the margin to a limit that it does not
        meet.
        """
        kept = self.missed + self._errors(off) <= 0
        taut = kept[:, self.keys.index(TENSION)]
        bears = {TENSION: np.ones_like(taut), BREAKDOWN: taut}
        return {key: np.asarray(kept[:, number] & bears.get(key, ~self.lost))
                for number, key in enumerate(self.keys)}

    def worst(self, off: Mapping[str, float]) -> Array:
        """Largest share by which each film misses a bound, (films,)."""
        return np.asarray((self.missed + self._errors(off)).max(1))

    def _errors(self, off: Mapping[str, float]) -> Array:
        return np.array([off.get(key, 0.0) for key in self.keys])

    def attained(self, bound: Bound, off: Mapping[str, float], share: float) -> float | None:
        """Value of a bound's quantity that the share of the films reach which keep all others."""
        kept = self.kept(off, but=bound.key)
        values = np.where(kept, bound.quantity.of(self.films), -np.inf if bound.least else np.inf)
        value = of_share(values, share, gain=bound.least)
        return value if np.isfinite(value) else None


@dataclass(frozen=True, eq=False)
class KeptByMost:
    """Designs as an objective: by what share most of their films keep all bounds.

    That share is to be largest, or, where the search has a quantity that is to be best, not below
    0. ``share`` of the films that are most; reduced films are ``off`` finite elements by so much.
    Films scatter as those about a design at shares ``about`` of the ranges, where this is exact.
    """

    search: Search
    off: Mapping[str, float]
    share: float
    about: Array

    @cached_property
    def _lines(self) -> tuple[Array, Array]:
        """Misses of copies by that of their design."""
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
        """Values and slopes at shares x of the ranges."""
        common = [] if self.search.best else [0.5]
        bare = replace(self.search, shifts={}).at(np.append(x, common))
        if bare is None:
            return None
        scatters, slopes = self._scatters, bare.limit_slopes[:, : len(x)]
        rates, constants = self._lines
        missed = rates * bare.limits[scatters, None] + constants
        next_to = self._next_to(missed.max(0))
        worst = missed[:, next_to].argmax(0)
        # The slope of a quantile is the mean of those of the films next to it.
        slope = (rates[worst, next_to, None] * slopes[scatters][worst]).mean(0)
        miss = exceeded(missed.max(0), 1 - self.share)
        limits, slopes = bare.limits[~scatters], slopes[~scatters]
        if not self.search.best:
            return Linearisation(-miss, -slope, limits, slopes)
        return Linearisation(bare.value, bare.slope, np.append(limits, miss),
                             np.concatenate([slopes, slope[None]]))

    def _next_to(self, worst: Array) -> Numbers:
        """Numbers of the films next to the one that just the share does better than."""
        order = np.argsort(worst)
        order = order[worst[order] < _NONE]
        place = min(int(self.share * len(worst)), len(order) - 1)
        return order[max(place - _NEXT // 2, 0): place + _NEXT // 2]

    def likeliest(self) -> Array:
        """Start at the design, or at one of random ones whose copies keep the bounds better.

        A few of these are looked at: those that would be best if all scattered alike.
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
        """End of a search at the design, with its values there."""
        status: DescentStatus = "optimum" if here.violation <= KEPT else "infeasible"
        return Descent(status, self.about, here, kkt(self.about, here))

    def prices(self, end: Descent) -> Array:
        """Cost of a share of each bound, in the aim, (bounds,)."""
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
    """The best of designs on a way from shares x, each by films about the one before.

    None where a film without scatter has no states.
    """
    best: tuple[KeptByMost, Descent] | None = None
    for _ in range(_ROUNDS):
        most = KeptByMost(search, off, share, x)
        here = most.at(x)
        found = None if here is None else most.ended(here)
        if found is not None and (best is None or _rank(found) > _rank(best[1])):
            best = most, found
            # The share of a bound by which most films keep all may be next to nothing itself.
            end = maximise(most, x, _DESCENT if search.best else replace(_DESCENT, unit=1.0))
            x = x if end.here is None else end.x
        elif best is not None:  # films scatter otherwise there: half the way
            x = (x + best[1].x) / 2
        if best is None or np.abs(x - best[1].x).max() < _STILL:
            break
    return best


def _rank(end: Descent) -> tuple[bool, float]:
    return end.status == "optimum", value_of(end)


def of_share(values: Array, share: float, *, gain: bool) -> float:
    """Value that the share of the films reach: at least, a gain, or at most; that of some film."""
    sign = -1.0 if gain else 1.0
    return sign * float(np.quantile(sign * values, share, method="inverted_cdf"))


def exceeded(missed: Array, failing: float) -> float:
    """Share missed that this share of the films exceed.

    Where more have no equilibrium, it is estimated as if all were distributed normally; it is then
    above 0, and the more of them there are.
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
    """Share by which a film of finite elements misses each bound, (bounds,)."""
    return np.array([float(bound.misses(film)[0]) for bound in search.bounds.values()])
