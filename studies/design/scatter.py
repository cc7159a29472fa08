"""Margins that make a bound kept by most films, not by the film without scatter alone.

The bounds of the film without scatter are shifted by what separates it from the film that the share
of all films do not fall short of. The search is repeated with these, as the shifts change with the
film (sequential optimisation and reliability assessment: Du, Chen, J. Mech. Des. 126, 2004).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from tympan.studies.design.quantities import QUANTITIES, TENSION, misses
from tympan.studies.design.search import Search
from tympan.studies.design.space import FamilyFilms

Array = NDArray[Any]

#: What stands for a film without equilibrium among shares missed: more than any.
_LOST = 10.0
#: Share of a bound that the worst film must reach for its ratio to the nominal one to say anything.
_LITTLE = 0.05


@dataclass(frozen=True, eq=False)
class ScatteredFilms:
    """Films about one, by what share they miss each bound: (films, bounds).

    ``nominal``: the film without scatter, (bounds,).
    """

    films: FamilyFilms
    missed: Array
    nominal: Array
    keys: tuple[str, ...]

    @classmethod
    def of(cls, search: Search, values: Array, count: int, seed: int) -> ScatteredFilms:
        """So many films, a power of two, about the one of some values."""
        space = search.space
        sequence = qmc.Sobol(space.inputs, seed=np.random.default_rng(seed))
        films = space.scattered(values, sequence.random_base2(int(np.log2(count))))
        bare = Search(space, search.bounds, search.best)
        missed = bare.missed(films)
        nominal = bare.missed(space.films(values[None]))[0]
        same = [key for key, bound in enumerate(search.bounds) if not QUANTITIES[bound].scatters]
        missed[:, same] = nominal[same]
        return cls(films, np.where(np.isfinite(missed), missed, _LOST), nominal,
                   tuple(search.bounds))

    def shifts(self, failing: float) -> dict[str, float]:
        """Shares by which the film without scatter must keep each bound the more.

        So that this share of the films fails each of them. A quantity scatters in proportion to
        itself: where its worst film shall be at the bound, it is the ratio of both that is kept.
        """
        worst = np.quantile(self.missed, 1 - failing, axis=0)
        change = worst - self.nominal
        for number, key in enumerate(self.keys):
            reached = 1 - worst[number] if QUANTITIES[key].gain else 1 + worst[number]
            if key != TENSION and reached > _LITTLE:
                change[number] /= reached
        return dict(zip(self.keys, change.tolist(), strict=True))

    def kept(self, off: Mapping[str, float]) -> NDArray[np.bool_]:
        """Mask of films that keep all bounds, reduced films being ``off`` by so much, (films,)."""
        errors = np.array([off.get(key, 0.0) for key in self.keys])
        scatters = np.array([QUANTITIES[key].scatters for key in self.keys])
        return np.asarray(((self.missed + errors <= 0) | ~scatters).all(1))


def missed_exactly(search: Search, film: Any) -> Array:
    """Share by which a film of finite elements misses each bound, (bounds,)."""
    return np.array([float(misses(key, bound, film)[0]) for key, bound in search.bounds.items()])
