"""The voltages at which many films of a family first meet a limit, and which.

As U² rises, the least tension, the square of the film's least stiffness and what the largest field
leaves of the strength fall smoothly, to 0 at a loss of tension, at pull-in, at breakdown. So each
limit is foreseen from the last three states, and the next state is taken most of the way to it.

At a pull-in U² has its maximum. Near it a film moves with the root of what U² lacks of that, and so
do the other margins: they fall ever faster, but need not reach 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tympan.base.arrays import AnyArray, Mask
from tympan.fem.results.limit_states import (
    BREAKDOWN,
    INSTABILITY,
    LIMIT_STATES,
    PULL_IN,
    TENSION,
    LimitState,
)

#: What is met beside limit states: the film leaves the range of stretches that its law is made for.
LAW_RANGE = "law_range"
#: Kinds that end the way of a film; it goes on beyond others.
ENDS = (TENSION.kind, PULL_IN.kind)
#: Kinds that films meet in themselves. They have no margin: a film is firm and within its law's
#: range, or not.
WITHIN = (INSTABILITY.kind, LAW_RANGE)


def kinds() -> tuple[str, ...]:
    """Kinds that films of a family may meet first: limit states, and the end of the law's range."""
    return (*ENDS, BREAKDOWN.kind, *(state.kind for state in strained()), *WITHIN)


def strained() -> list[LimitState]:
    """Further limit states whose margins follow from the films' stretches and stresses."""
    return [state for state in LIMIT_STATES.values()
            if state.strained and state.kind not in ENDS]


#: Part of the range of U² of the first state above the lowest.
_FIRST = 0.25
#: Part of the way to a foreseen pull-in at which the next state is: beyond it there is none. States
#: of other kinds are at the limit that is foreseen.
_ON = 0.93
#: How near to a state a limit is foreseen at last, relative in U².
_NEAR = 1e-2
#: Most states of a film.
_MOST = 14


def label_of(kind: str) -> str:
    """Name of one of :func:`kinds` for people."""
    return "the end of the law's range" if kind == LAW_RANGE else str(LIMIT_STATES[kind].label)


@dataclass(frozen=True, eq=False)
class FirstLimits:
    """Voltages [V] of films' first limits, and their :func:`kinds`, (films,).

    Voltages are infinite where none is met within the family's voltages, nan where there is no
    state at the lowest of these; the kind is then what is wrong with that state, a pull-in where
    there is none.
    """

    voltage: AnyArray
    kind: AnyArray


@dataclass(frozen=True, eq=False)
class FilmMargins:
    """States q of films at some U²: margins by their kinds, (films,), nan without a state.

    ``firm``: whether the film is firm there and its law holds; ``lawful``: whether its law does.
    """

    by_kind: Mapping[str, AnyArray]
    firm: Mask
    lawful: Mask
    q: AnyArray

    @cached_property
    def values(self) -> AnyArray:
        """Margins in columns, (films, margins)."""
        return np.stack([*self.by_kind.values()], 1)

    @property
    def names(self) -> AnyArray:
        """Kinds of the columns."""
        return np.array([*self.by_kind], dtype=object)


#: States of some films, by their numbers, at a U² of each, near states q where these are given.
Find = Callable[[AnyArray, AnyArray, AnyArray | None], FilmMargins]


def first_limits(find: Find, count: int, low: float, high: float) -> FirstLimits:
    """First limits of so many films between U² of ``low`` and ``high``."""
    start = find(np.arange(count), np.full(count, low), None)
    names = start.names
    pulls_in = names == PULL_IN.kind
    sound, kind = _reasons(start)
    some = np.flatnonzero(sound)
    voltage = np.full(count, np.nan)
    below, beyond = np.full(count, low), np.full(count, np.inf)
    met = np.full(count, PULL_IN.kind, dtype=object)
    # U², margins and states of the last three that there are, the last one first.
    x = np.full((3, count), low)
    margins, q = np.array([start.values] * 3), np.array([start.q] * 3)
    tried = np.full(count, low + _FIRST * (high - low))
    for _ in range(_MOST):
        found = find(some, tried[some], _carried(x, q, tried, some))
        there, (sound, reason) = np.isfinite(found.values).all(1), _reasons(found)
        on = some[there]
        for kept, new in ((x, tried[on]), (margins, found.values[there]), (q, found.q[there])):
            kept[1:, on], kept[0, on] = kept[:2, on], new
        below[some[sound]], beyond[some[~sound]] = tried[some[sound]], tried[some[~sound]]
        met[some[~sound]] = reason[~sound]
        ahead = _ahead(x[:, some], margins[:, some], pulls_in)
        foreseen = x[0, some] + ahead.min(1)
        # What is met before it was foreseen is between two states.
        inside = (foreseen > below[some]) & (foreseen < beyond[some])
        middle = np.where(np.isfinite(beyond[some]), (below[some] + beyond[some]) / 2, high)
        kind[some] = np.where(inside, names[ahead.argmin(1)], met[some])
        end = np.where(inside, foreseen, middle)
        voltage[some] = np.sqrt(end)
        near = np.where(inside, np.abs(end - x[0, some]), beyond[some] - below[some])
        ready = (near < _NEAR * end) | (below[some] >= high)
        next_to = x[0, some] + (np.where(pulls_in, _ON, 1.0) * ahead).min(1)
        tried[some] = np.minimum(np.where(inside, next_to, end), high)
        some = some[~ready]
        if not len(some):
            break
    voltage[below >= high] = np.inf
    return FirstLimits(voltage, kind)


def _reasons(found: FilmMargins) -> tuple[Mask, AnyArray]:
    """Mask of states before all limits, and the kind that the others are beyond."""
    there, positive = np.isfinite(found.values).all(1), (found.values > 0).all(1)
    infirm = np.where(found.lawful, *WITHIN).astype(object)
    met = np.where(there, found.names[found.values.argmin(1)], PULL_IN.kind)
    return positive & found.firm, np.where(positive, infirm, met)


def _carried(x: AnyArray, q: AnyArray, tried: AnyArray, some: AnyArray) -> AnyArray:
    """States q of some films carried on along the last two to another U²."""
    with np.errstate(all="ignore"):
        rate = (q[0, some] - q[1, some]) / (x[0, some] - x[1, some])[:, None]
    step = (tried[some] - x[0, some])[:, None]
    return np.asarray(q[0, some] + step * np.where(np.isfinite(rate), rate, 0.0))


def _ahead(x: AnyArray, margins: AnyArray, pulls_in: Mask) -> AnyArray:
    """Distance in U² to where margins are 0, (films, margins): infinite beyond a pull-in.

    ``pulls_in``: a mask of the margin of pull-in.
    """
    most = _root(x, margins[..., pulls_in])[:, 0]
    with np.errstate(all="ignore"):
        left = np.sqrt(x[0] + most - x)
        ahead, to_most = _root(np.where(np.isfinite(left), -left, x), margins), left[0, :, None]
        bent = np.where(ahead < to_most, ahead * (2 * to_most - ahead), np.inf)
    ahead = np.where(np.isfinite(most)[:, None], bent, ahead)
    ahead[:, pulls_in] = most[:, None]
    return ahead


def _root(x: AnyArray, margins: AnyArray) -> AnyArray:
    """Distance in x to where margins are 0, (films, margins), by the parabola of the last three."""
    last, before, first = margins
    with np.errstate(all="ignore"):
        slope = (last - before) / (x[0] - x[1])[:, None]
        bend = (slope - (before - first) / (x[1] - x[2])[:, None]) / (x[0] - x[2])[:, None]
        bend = np.where(np.isfinite(bend), bend, 0.0)
        slope = slope + bend * (x[0] - x[1])[:, None]
        root = np.sqrt(np.maximum(slope**2 - 4 * bend * last, 0.0)) - slope
        return np.asarray(np.where(root > 0, 2 * last / root, np.inf))
