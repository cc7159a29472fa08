"""Relaxed bounds: what one may be with all others kept, what that gains, and at which end it is.

A film that just keeps a relaxed bound is stopped by other bounds, by the end of a number's range,
or by the edge of what reduced films know.
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

#: Change of a bound or of a range's end of which is told what it gains.
RELAXED = 0.01
#: Designs of which is looked at what a bound that cannot be kept may be instead.
_EASED = 3
#: Films by which it is sought what most films reach.
_DRAWN = 512
#: Other films by which that is told.
_JUDGED = 2048
#: Distance of the neighbours by which the edge of what is known is seen, as a share of the ranges.
_NEIGHBOUR = 0.02
#: How near to an end of its range a number is at it, as a share of the range.
_AT_END = 1e-3

#: End of a number: of the range that was asked for, or of what reduced films know.
NumberEnd = Literal["range", "known"]


@dataclass(frozen=True)
class Ends:
    """Ends at which a film is: ``numbers`` by their keys, and whether reduced films go on there."""

    numbers: Mapping[str, NumberEnd]
    known: bool


@dataclass(frozen=True)
class Relaxed:
    """A weaker ``bound`` with which all bounds are kept, and the ``ends`` of the film that does."""

    bound: Bound
    ends: Ends


@dataclass(frozen=True, eq=False)
class Attained:
    """Value of a bound's quantity that films about a design reach, at shares x of the ranges."""

    value: float
    x: Array


def ends_at(space: DesignSpace, x: Array) -> Ends:
    """Ends of ranges at which a film is, at shares x of them, and whether all around are films."""
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


def gain_of(search: Search, bound: Bound, values: Array, price: float) -> float | None:
    """Gain of the aim where a bound is relaxed by 1 %, from the price of a share of it.

    None where it cannot be relaxed: a film must bear its voltage, whatever is asked for.
    """
    weaker = bound.relaxed_by(RELAXED)
    if weaker is None:
        return None
    if bound.name == TENSION:
        return price * _tension_eased(search, weaker, values)
    # With a margin the film without scatter is beyond the bound by a share, and falls with it.
    shift = search.shifts.get(bound.key, 0.0)
    return price * RELAXED * (1 + shift if bound.least else 1 - shift)


def _tension_eased(search: Search, weaker: Bound, values: Array) -> float:
    """Fall of the share missed where the margin to the loss of tension is relaxed."""
    space = search.space
    bounds = {**space.requirements.bounds, weaker.key: weaker}
    eased = replace(space, requirements=replace(space.requirements, bounds=bounds))
    before, after = (float(weaker.misses(each.films(values[None]))[0]) for each in (space, eased))
    return before - after


def attained(search: Search, bound: Bound, x: Array, off: Mapping[str, float], scatters: bool
             ) -> Attained | None:
    """The best value of a bound's quantity that films reach which keep all other bounds.

    ``x``: the nearest film; reduced films are ``off`` finite elements by shares of the bounds. Each
    value is counted of films that are drawn about its design, where any scatter.
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
    if best is None:  # the second way is the longer one
        best = next(filter(None, map(told, _by_most(alone, bound, x, off))), None)
    return best and _told(search, bound, best.x, off, drawn_points(search.space.inputs, _JUDGED, 2))


def _by_margins(alone: Search, bound: Bound, x: Array, off: Mapping[str, float], points: Array
                ) -> Iterator[Array]:
    """The design, and others with much of a bound's quantity and margins for all other bounds."""
    yield x
    if not bound.quantity.scatters:
        return
    space, starts = alone.space, np.concatenate([x[None], alone.starts()])
    share = space.requirements.share
    for _ in range(_EASED - 1):
        films = ScatteredFilms.of(alone, space.values(x), points)
        # Half of the films that may fail do so by each of the other bounds.
        shifts = films.shifts(space.values(x), (1 - share) / 2)
        ended = replace(alone, shifts={key: shifts.get(key, 0.0) + off.get(key, 0.0)
                                       for key in alone.bounds}).found(starts)
        if ended is None or ended.status == "infeasible":
            return
        x, starts = ended.x, ended.x[None]
        yield x


def _by_most(alone: Search, bound: Bound, x: Array, off: Mapping[str, float]) -> Iterator[Array]:
    """Designs with most of a bound's quantity of which most copies keep all other bounds."""
    share = alone.space.requirements.share
    # Half of the films that may fail do so by the other bounds, or all of them.
    for most in ((1 + share) / 2, share) if bound.quantity.scatters else (share,):
        found = kept_by_most(replace(alone, shifts={}), off, most, x)
        if found is not None:
            yield found[1].x


def _told(search: Search, bound: Bound, x: Array, off: Mapping[str, float], points: Array | None
          ) -> Attained | None:
    """Value of a bound's quantity that films about a design reach; None if others are missed."""
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
    # Finite elements have less of it by what reduced films are off.
    sign = 1 if bound.least else -1
    return Attained(value - sign * off.get(bound.key, 0.0) * bound.value, x)
