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
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from tympan.geometry.errors import InputError
from tympan.studies.design.quantities import QUANTITIES, TENSION, misses
from tympan.studies.design.search import Search, around
from tympan.studies.design.space import DesignSpace, FamilyFilms
from tympan.studies.design.sqp import Descent, DescentSettings, Linearisation, maximise

Array = NDArray[Any]

#: What a film without equilibrium misses of the margin to the loss of tension: more than any.
_LOST = 10.0
#: Share of a bound that the worst film must reach for its ratio to the nominal one to say anything.
_LITTLE = 0.05
#: Fewest films from which others are judged that have no equilibrium.
_FEWEST = 16
#: Films drawn about a design that is sought by the share of them that keep all bounds.
_DRAWN = 512
#: Of these, films next to the one that just that share does better than: they tell the slope.
_NEXT = 32
#: Random designs that may be better starts than the one that is known.
_LOOKED_AT = 6
#: Films about each of these.
_FEW = 128

#: The miss of 512 films is smooth to some 1e-3; at most a dozen steps of a second each.
_DESCENT = DescentSettings(step=2e-3, gain=1e-4, residual=3e-2, violation=1e-3, iterations=12,
                           near=1.0)


@dataclass(frozen=True, eq=False)
class ScatteredFilms:
    """Films about designs, by what share they miss each bound that scatters: (films, bounds).

    A film without equilibrium has lost its tension; it is not said to miss other bounds.
    ``search``: without margins and other bounds.
    """

    search: Search
    films: FamilyFilms
    missed: Array

    @classmethod
    def of(cls, search: Search, designs: Array, points: Array) -> ScatteredFilms:
        """Films about designs of some values, at points from :func:`drawn`."""
        films = search.space.scattered(designs, points)
        bounds = {key: bound for key, bound in search.bounds.items() if QUANTITIES[key].scatters}
        bare = replace(search, bounds=bounds, shifts={})
        missed = bare.missed(films)
        lost = ~np.isfinite(missed).all(1)
        missed[lost] = -np.inf
        missed[lost, list(bounds).index(TENSION)] = _LOST
        return cls(bare, films, missed)

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
        for number, key in enumerate(self.keys):
            worst = exceeded(self.missed[:, number], failing)
            change = worst - float(nominal[number])
            reached = 1 - worst if QUANTITIES[key].gain else 1 + worst
            found[key] = change / reached if key != TENSION and reached > _LITTLE else change
        return found

    def guessed(self, values: Array, others: Array) -> Array:
        """Shares by which copies of other designs would miss each bound, if all scatter alike.

        Of the design of some ``values`` these copies are; ``others``: what other designs miss
        without scatter, (designs, bounds). Shape (bounds, designs, films).
        """
        nominal = self.search.missed(self.search.space.films(values[None]))[0]
        found = []
        for key, copies, own, other in zip(self.keys, self.missed.T, nominal, others.T,
                                           strict=True):
            sign = -1.0 if QUANTITIES[key].gain else 1.0
            if key == TENSION:
                found.append(np.add.outer(other, copies - own))
            else:  # in proportion to the quantity itself
                ratio = (1 + sign * copies) / (1 + sign * own)
                found.append(sign * (np.multiply.outer(1 + sign * other, ratio) - 1))
        return np.array(found)

    def kept(self, off: Mapping[str, float]) -> NDArray[np.bool_]:
        """Mask of films that keep all bounds, reduced films being ``off`` by so much, (films,)."""
        return np.asarray((self.missed + self._errors(off) <= 0).all(1))

    def worst(self, off: Mapping[str, float]) -> Array:
        """Largest share by which each film misses a bound, (films,)."""
        return np.asarray((self.missed + self._errors(off)).max(1))

    def worst_bounds(self, off: Mapping[str, float]) -> NDArray[np.int64]:
        """Number of the bound of which that is, (films,)."""
        return np.asarray((self.missed + self._errors(off)).argmax(1))

    def _errors(self, off: Mapping[str, float]) -> Array:
        return np.array([off.get(key, 0.0) for key in self.keys])

    def attained(self, key: str, off: Mapping[str, float], share: float) -> float | None:
        """Value of a quantity that the share of the films reach which keep all other bounds."""
        others = [name != key for name in self.keys]
        kept = ((self.missed + self._errors(off)) <= 0)[:, others].all(1)
        quantity = QUANTITIES[key]
        values = np.where(kept, quantity.of(self.films), -np.inf if quantity.gain else np.inf)
        value = of_share(values, share, gain=quantity.gain)
        return value if np.isfinite(value) else None


@dataclass(frozen=True, eq=False)
class KeptByMost:
    """Designs as an objective: by what share most of their films keep all bounds.

    That share is to be largest, or, where the search has a quantity that is to be best, not below
    0. ``share`` of the films that are most; reduced films are ``off`` finite elements by so much.
    """

    search: Search
    off: Mapping[str, float]
    share: float

    @cached_property
    def points(self) -> Array:
        """Points of the films."""
        return drawn(self.search.space, _DRAWN, 1)

    def from_start(self, x: Array) -> Descent:
        """End of steps from a design at shares x of the ranges."""
        return maximise(self, x, _DESCENT)

    def likeliest(self, x: Array) -> Array:
        """Start at shares x, or at one of random designs whose copies keep the bounds better.

        A few of these are looked at: those that would be best if copies of all scattered as those
        of x do.
        """
        space, bare = self.search.space, replace(self.search, shifts={})
        copies = ScatteredFilms.of(self.search, space.values(x), self.points)
        shares, films = space.random
        missed = bare.missed(films)
        scatters = np.array([QUANTITIES[key].scatters for key in bare.bounds])
        with np.errstate(invalid="ignore"):
            guessed = copies.guessed(space.values(x), missed[:, scatters]).max(0)
            found = np.maximum(np.quantile(guessed, self.share, axis=1),
                               missed[:, ~scatters].max(1, initial=-np.inf))
        order = np.argsort(np.where(np.isfinite(found), found, np.inf))[:_LOOKED_AT]
        starts = np.concatenate([x[None], shares[order]])
        points = self.points[:: len(self.points) // _FEW]
        worst = ScatteredFilms.of(self.search, space.values(starts), points).worst(self.off)
        return np.asarray(starts[np.argmin([exceeded(each, 1 - self.share) for each
                                            in worst.reshape(len(starts), -1)])])

    def at(self, x: Array, renew: bool = False) -> Linearisation | None:
        """Values and slopes at shares x of the ranges."""
        common = [] if self.search.best else [0.5]
        bare = replace(self.search, shifts={}).at(np.append(x, common))
        try:
            miss, slope, _ = self.missed(x)
        except InputError:
            return None
        if bare is None or not np.isfinite(slope).all():
            return None
        same = [not QUANTITIES[key].scatters for key in self.search.bounds]
        limits, slopes = bare.limits[same], bare.limit_slopes[same, : len(x)]
        if not self.search.best:
            return Linearisation(-miss, -slope, limits, slopes)
        return Linearisation(bare.value, bare.slope, np.append(limits, miss),
                             np.concatenate([slopes, slope[None]]))

    def held(self, x: Array) -> tuple[float, Array]:
        """Nothing is."""
        return 0.0, np.zeros(len(x))

    def missed(self, x: Array) -> tuple[float, Array, dict[str, float]]:
        """Share that most films do not miss any bound by; its slope; whose bound's it is.

        The slope of a quantile is the mean of those of the films next to it. ``bounds``: by key the
        share of these films of which it is the worst.
        """
        space, size = self.search.space, len(x)
        films = ScatteredFilms.of(self.search, space.values(x), self.points)
        worst = films.worst(self.off)
        order = np.argsort(worst)
        order = order[worst[order] < _LOST]
        place = min(int(self.share * len(worst)), len(order) - 1)
        following = order[max(place - _NEXT // 2, 0): place + _NEXT // 2]
        ahead, behind = around(x)
        places = space.values(np.concatenate([ahead, behind]))
        moved = ScatteredFilms.of(self.search, places, self.points[following]).worst(self.off)
        moved = np.where(moved < _LOST, moved, np.nan).reshape(2, size, -1)
        change = (moved[0] - moved[1]) / (ahead - behind).diagonal()[:, None]
        there = np.isfinite(change)
        slope = np.where(there, change, 0.0).sum(1) / np.maximum(there.sum(1), 1)
        bounds = films.worst_bounds(self.off)[following]
        return (exceeded(worst, 1 - self.share), slope,
                {key: float((bounds == number).mean()) for number, key in enumerate(films.keys)})

    def prices(self, end: Descent) -> Array:
        """Cost of a share of each bound, in the aim, (bounds,)."""
        assert end.multipliers is not None
        limits, found = end.multipliers.limits.tolist(), []
        price = limits.pop() if self.search.best else 1.0
        _, _, weights = self.missed(end.x)
        for key in self.search.bounds:
            found.append(price * weights[key] if QUANTITIES[key].scatters else limits.pop(0))
        return np.array(found)


def drawn(space: DesignSpace, count: int, seed: int) -> Array:
    """Points (films, inputs) of so many films, a power of two."""
    sequence = qmc.Sobol(space.inputs, seed=np.random.default_rng(seed))
    return np.asarray(sequence.random_base2(int(np.log2(count))))


def of_share(values: Array, share: float, *, gain: bool) -> float:
    """Value that the share of the films reach: at least, a gain, or at most; that of some film."""
    sign = -1.0 if gain else 1.0
    return sign * float(np.quantile(sign * values, share, method="inverted_cdf"))


def exceeded(missed: Array, failing: float) -> float:
    """Share missed that this share of the films exceed.

    Where more have no equilibrium, it is estimated as if all were distributed normally.
    """
    missed = missed[missed > -np.inf]
    there = np.sort(missed[missed < _LOST])
    if len(there) > (1 - failing) * (len(missed) - 1) + 1 or len(there) < _FEWEST:
        return float(np.quantile(missed, 1 - failing)) if len(missed) else _LOST
    at = norm.ppf((np.arange(len(there)) + 0.5) / len(missed))
    slope, middle = np.polyfit(at, there, 1)
    return float(middle + slope * norm.ppf(1 - failing))


def missed_exactly(search: Search, film: Any) -> Array:
    """Share by which a film of finite elements misses each bound, (bounds,)."""
    return np.array([float(misses(key, bound, film)[0]) for key, bound in search.bounds.items()])
