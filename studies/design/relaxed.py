"""Relaxed bounds: a bound's reachable value with all others kept, its gain, and the film's ends.

A film that just keeps a relaxed bound is limited by other bounds, by the end of a number's range,
or by the edge of the known reduced films.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from tympan.base.arrays import Array
from tympan.base.points import drawn_points
from tympan.studies.design.scatter import ScatteredFilms, kept_by_most
from tympan.studies.design.search import KEPT, Search
from tympan.studies.design.space import DesignSpace
from tympan.studies.tolerance.result import Chance
from tympan.studies.wanted import TENSION, Bound

#: Relative change of a bound, or of a range's end, for which the gain is computed.
RELAXED = 0.01
#: Number of designs to try for the value that an unreachable bound can have instead.
_EASED = 3
#: Random films for finding the value that most films reach.
_DRAWN = 512
#: Other random films for the final value.
_JUDGED = 2048
#: Distance of the neighbours that show the edge of the known films, as a share of the ranges.
_NEIGHBOUR = 0.02
#: Largest distance of a number from an end at which it counts as there, as a share of its range.
_AT_END = 1e-3

#: End of a number: of the given range, or of the known reduced films.
NumberEnd = Literal["range", "known"]


@dataclass(frozen=True)
class Ends:
    """Ends at which a film is: ``numbers`` by key, and whether all its neighbours are known."""

    numbers: Mapping[str, NumberEnd]
    known: bool


@dataclass(frozen=True)
class Relaxed:
    """A weaker ``bound`` with which all bounds are kept, and the ``ends`` of its film."""

    bound: Bound
    ends: Ends


@dataclass(frozen=True, eq=False)
class Attained:
    """Value of a bound's quantity that films about a design reach, at shares x of the ranges."""

    value: float
    x: Array


def ends_at(space: DesignSpace, x: Array) -> Ends:
    """Find the ends of ranges at which a film is, at shares x, and whether its neighbours exist."""
    size = len(space.variables)
    x, numbers = x[:size], dict[str, NumberEnd]()
    around = np.clip(x + _NEIGHBOUR * np.concatenate([np.eye(size), -np.eye(size)]), 0, 1)
    there = space.films(space.values(around)).sound
    for number, (own, asked) in enumerate(zip(space.variables, space.asked, strict=True)):
        up, down = there[number], there[size + number]
        if x[number] < _AT_END or x[number] > 1 - _AT_END:
            outer = (own.low <= asked.low if x[number] < _AT_END else own.high >= asked.high)
            numbers[asked.key] = "range" if outer else "known"
        elif not (up and down):
            numbers[asked.key] = "known"
    return Ends(numbers, bool(there.all()))


def gain_by_relaxing(search: Search, bound: Bound, values: Array, price: float) -> float | None:
    """Compute the aim's gain where a bound is relaxed by 1 %, from the price of a share of it.

    None where the bound cannot be relaxed: a film must bear its voltage in any case.
    """
    weaker = bound.relaxed_by(RELAXED)
    if weaker is None:
        return None
    if bound.name == TENSION:
        return price * _tension_eased(search, weaker, values)
    # The margin is a share of the bound, so the film without scatter moves with the bound.
    shift = search.shifts.get(bound.key, 0.0)
    return price * RELAXED * (1 + shift if bound.least else 1 - shift)


def _tension_eased(search: Search, weaker: Bound, values: Array) -> float:
    """Compute by how much the missed share falls at a relaxed margin to the loss of tension."""
    space = search.space
    bounds = {**space.requirements.bounds, weaker.key: weaker}
    eased = replace(space, requirements=replace(space.requirements, bounds=bounds))
    before, after = (float(weaker.misses(each.films(values[None]))[0]) for each in (space, eased))
    return before - after


def attained(search: Search, bound: Bound, x: Array, off: Mapping[str, float], scatters: bool
             ) -> Attained | None:
    """Find the best value of a bound's quantity for films that keep all other bounds.

    ``x`` is the nearest film; ``off`` holds the errors of reduced films against finite elements, as
    shares of the bounds. Where a number scatters, each value is found from random films about its
    design.
    """
    others = {key: other for key, other in search.bounds.items() if key != bound.key}
    alone = replace(search, bounds=others, best=bound.name, least=not bound.least,
                    shifts={key: off.get(key, 0.0) for key in others})
    x = x[: len(search.space.variables)]
    if not scatters:
        ended = alone.found(np.concatenate([x[None], alone.starts()]))
        return None if ended is None else _told(search, bound, ended.x, off, None)
    points = drawn_points(search.space.inputs, _DRAWN, 1)

    def told(design: Array) -> Attained | None:
        return _told(search, bound, design, off, points)

    by_margins = filter(None, map(told, _by_margins(alone, bound, x, off, points)))
    best = max(by_margins, key=lambda each: each.value if bound.least else -each.value,
               default=None)
    if best is None:  # the second method takes longer
        best = next(filter(None, map(told, _by_most(alone, bound, x, off))), None)
    return best and _told(search, bound, best.x, off, drawn_points(search.space.inputs, _JUDGED, 2))


def _by_margins(alone: Search, bound: Bound, x: Array, off: Mapping[str, float], points: Array
                ) -> Iterator[Array]:
    """Yield the design, then others with a high quantity and margins for all other bounds."""
    yield x
    if not bound.quantity.scatters:
        return
    space, starts = alone.space, np.concatenate([x[None], alone.starts()])
    share = space.requirements.share
    for _ in range(_EASED - 1):
        films = ScatteredFilms.of(alone, space.values(x), points)
        # Each of the other bounds may be missed by half of the films that may fail.
        shifts = films.shifts(space.values(x), (1 - share) / 2)
        ended = replace(alone, shifts={key: shifts.get(key, 0.0) + off.get(key, 0.0)
                                       for key in alone.bounds}).found(starts)
        if ended is None or ended.status == "infeasible":
            return
        x, starts = ended.x, ended.x[None]
        yield x


def _by_most(alone: Search, bound: Bound, x: Array, off: Mapping[str, float]) -> Iterator[Array]:
    """Yield designs that maximise a bound's quantity while most copies keep all other bounds."""
    share = alone.space.requirements.share
    # The other bounds may be missed by half of the films that may fail, then by all of these.
    for most in ((1 + share) / 2, share) if bound.quantity.scatters else (share,):
        found = kept_by_most(replace(alone, shifts={}), off, most, x)
        if found is not None:
            yield found[1].x


def _told(search: Search, bound: Bound, x: Array, off: Mapping[str, float], points: Array | None
          ) -> Attained | None:
    """Find the value that films about a design reach; None if they miss other bounds."""
    space, share = search.space, search.space.requirements.share
    values = space.values(x[: len(space.variables)])
    bare = replace(search, shifts={})
    films = space.films(values[None])
    missed = dict(zip(search.bounds, bare.missed(films)[0].tolist(), strict=True))
    nominal = [key for key, other in search.bounds.items() if key != bound.key
               and (points is None or not other.quantity.scatters)]
    if not all(missed[key] + off.get(key, 0.0) <= 2 * KEPT for key in nominal):
        return None
    value: float | None = float(bound.quantity.of(films)[0])
    if points is not None:
        scattered = ScatteredFilms.of(bare, values, points)
        if bound.quantity.scatters:
            value = scattered.attained(bound, off, share)
        elif Chance.of(scattered.kept(off)).high < share:
            return None
    if value is None or not np.isfinite(value):
        return None
    # By finite elements the value is worse by the error of the reduced films.
    sign = 1 if bound.least else -1
    return Attained(value - sign * off.get(bound.key, 0.0) * bound.value, x)
