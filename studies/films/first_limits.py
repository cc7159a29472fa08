"""First limits of many films of a family: their voltages and their kinds.

As U² rises, three margins decrease smoothly. The least tension is 0 at loss of tension. The square
of the film's least stiffness is 0 at pull-in. The margin of the largest field below the strength is
0 at breakdown. Each limit is therefore predicted from the last three states, and the next state is
taken most of the way to it.

At a pull-in U² has its maximum. Near it a film moves with the root of the difference of U² to the
maximum, and so do the other margins. They decrease ever faster, but need not reach 0.
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

#: Further kind: the film leaves the range of stretches for which its law is made.
LAW_RANGE = "law_range"
#: Kinds that end the path of a film; it continues beyond other kinds.
ENDS = (TENSION.kind, PULL_IN.kind)
#: Kinds without margin: a film is stable in its plane and within its law's range, or it is not.
WITHIN = (INSTABILITY.kind, LAW_RANGE)


def kinds() -> tuple[str, ...]:
    """List the kinds that films of a family may reach first: limit states, and the law's range."""
    return (*ENDS, BREAKDOWN.kind, *(state.kind for state in strained()), *WITHIN)


def strained() -> list[LimitState]:
    """List further limit states whose margins follow from stretches and stresses alone."""
    return [state for state in LIMIT_STATES.values()
            if state.strained and state.kind not in ENDS]


#: First state above the lowest, as a share of the range of U².
_FIRST = 0.25
#: Share of the way to a predicted pull-in at which the next state is taken: beyond the pull-in
#: there is none. For other kinds the next state is at the predicted limit.
_ON = 0.93
#: Relative distance in U² from a state to its predicted limit at which the search ends.
_NEAR = 1e-2
#: Largest number of states of a film.
_MOST = 14


def label_of(kind: str) -> str:
    """Name one of :func:`kinds` for people."""
    return "the end of the law's range" if kind == LAW_RANGE else str(LIMIT_STATES[kind].label)


@dataclass(frozen=True, eq=False)
class FirstLimits:
    """Voltages [V] of films' first limits, and their :func:`kinds`, (films,).

    A voltage is infinite if no limit is reached within the family's voltages, and nan if there is
    no valid state at the lowest of these. The kind is then the limit that this state exceeds; it is
    pull-in if there is no state.
    """

    voltage: AnyArray
    kind: AnyArray


@dataclass(frozen=True, eq=False)
class FilmMargins:
    """States q of films at a U² of each; margins by their kinds, (films,), nan without a state.

    ``firm``: whether the film is stable in its plane and within its law's range. ``lawful``:
    whether it is within its law's range.
    """

    by_kind: Mapping[str, AnyArray]
    firm: Mask
    lawful: Mask
    q: AnyArray

    @cached_property
    def values(self) -> AnyArray:
        """Margins as columns, (films, margins)."""
        return np.stack([*self.by_kind.values()], 1)

    @property
    def names(self) -> AnyArray:
        """Kinds of the columns."""
        return np.array([*self.by_kind], dtype=object)


#: Function that finds states of some films, by their numbers, at a U² of each, near given states q
#: if any.
Find = Callable[[AnyArray, AnyArray, AnyArray | None], FilmMargins]


def first_limits(find: Find, count: int, low: float, high: float) -> FirstLimits:
    """Find the first limits of ``count`` films between U² of ``low`` and ``high``."""
    start = find(np.arange(count), np.full(count, low), None)
    names = start.names
    pulls_in = names == PULL_IN.kind
    sound, kind = _reasons(start)
    some = np.flatnonzero(sound)
    voltage = np.full(count, np.nan)
    below, beyond = np.full(count, low), np.full(count, np.inf)
    met = np.full(count, PULL_IN.kind, dtype=object)
    # U², margins and q of the last three states, the last one first.
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
        # A limit that is reached before its prediction is between two states.
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
    """Compute the mask of states before all limits, and the kind that each other one exceeds."""
    there, positive = np.isfinite(found.values).all(1), (found.values > 0).all(1)
    infirm = np.where(found.lawful, *WITHIN).astype(object)
    met = np.where(there, found.names[found.values.argmin(1)], PULL_IN.kind)
    return positive & found.firm, np.where(positive, infirm, met)


def _carried(x: AnyArray, q: AnyArray, tried: AnyArray, some: AnyArray) -> AnyArray:
    """Extrapolate states q of some films linearly along the last two to another U²."""
    with np.errstate(all="ignore"):
        rate = (q[0, some] - q[1, some]) / (x[0, some] - x[1, some])[:, None]
    step = (tried[some] - x[0, some])[:, None]
    return np.asarray(q[0, some] + step * np.where(np.isfinite(rate), rate, 0.0))


def _ahead(x: AnyArray, margins: AnyArray, pulls_in: Mask) -> AnyArray:
    """Predict the distance in U² to where margins are 0, (films, margins).

    It is infinite beyond a pull-in. ``pulls_in``: mask of the pull-in's margin.
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
    """Predict the distance in x to zero margins, (films, margins), by the last three's parabola."""
    last, before, first = margins
    with np.errstate(all="ignore"):
        slope = (last - before) / (x[0] - x[1])[:, None]
        bend = (slope - (before - first) / (x[1] - x[2])[:, None]) / (x[0] - x[2])[:, None]
        bend = np.where(np.isfinite(bend), bend, 0.0)
        slope = slope + bend * (x[0] - x[1])[:, None]
        root = np.sqrt(np.maximum(slope**2 - 4 * bend * last, 0.0)) - slope
        return np.asarray(np.where(root > 0, 2 * last / root, np.inf))
