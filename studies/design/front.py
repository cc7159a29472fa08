"""Films between the best of two quantities: each is best for a given value of the other.

All films keep the bounds with the margins of the best film. A bound on the second quantity moves
from its value where the first is best to its own best value (the method of constraints: Haimes,
Lasdon, Wismer, IEEE Trans. Syst. Man Cybern. 1, 1971).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.design.result import DesignFront, FrontFilm
from tympan.studies.design.search import Search
from tympan.studies.design.sqp import Descent
from tympan.studies.wanted import QUANTITIES, Bound

#: Number of films of a front, its ends included.
_FILMS = 9
#: Share of the way to the best of the second quantity at which the front ends. At the best itself
#: the search did not maximise the first quantity.
_NEARLY = 0.999


def front(search: Search, x: Array, pair: tuple[str, str]) -> DesignFront | None:
    """Find films between two quantities, near one at shares x; None if no film keeps the bounds."""
    first, second = pair
    starts = np.concatenate([x[None], search.starts()])
    ends = [replace(search, best=key, least=None).found(starts) for key in pair]
    if not all(_kept(end) for end in ends):
        return None
    places = [end.x for end in ends if end is not None]
    low, high = (_values(search, place, pair)[1] for place in places)
    found = [places[0]]
    for level in low + (high - low) * np.append(np.linspace(0, 1, _FILMS)[1:-1], _NEARLY):
        bound = Bound(second, float(level), bool(QUANTITIES[second].gain))
        bounded = replace(search, best=first, least=None,
                          bounds={**search.bounds, bound.key: bound},
                          shifts={**search.shifts, bound.key: 0.0})
        end = bounded.found(np.array([found[-1], places[1]]))
        if end is not None and _kept(end):
            found.append(end.x)
    keys = [each.key for each in search.space.variables]
    return DesignFront(
        first=first, second=second, first_unit=QUANTITIES[first].unit,
        second_unit=QUANTITIES[second].unit, films=tuple(FrontFilm(
            first=values[0], second=values[1],
            numbers=dict(zip(keys, search.space.values(place).tolist(), strict=True)))
            for place in found for values in [_values(search, place, pair)]))


def _kept(end: Descent | None) -> bool:
    return end is not None and end.here is not None and end.status != "infeasible"


def _values(search: Search, x: Array, pair: tuple[str, str]) -> tuple[float, float]:
    films = search.space.films(search.space.values(x[None]))
    first, second = (float(QUANTITIES[key].of(films)[0]) for key in pair)
    return first, second
