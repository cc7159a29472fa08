"""Where a plate that is let go comes to rest, by the forces on it at every heave."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Force and its derivative by the heave, at heaves, shape (..., states) each.
Balance = Callable[[Array], tuple[Array, Array]]

#: Places on the way between which a crossing is looked for.
_PLACES = 17
#: Halvings that leave nothing of a bracket, and a step of Newton's after which the next is nothing.
_HALVINGS, _SMALL = 60, 1e-9
#: A difference of heaves that is none [m].
_STAYS = 1e-10


def resting_place(balance: Balance, low: Array, high: Array) -> tuple[Array, Mask]:
    """Where plates let go at no heave first come to rest, and which of them do.

    ``balance`` is the force that holds the plate less the load [N]; ``low`` < 0 < ``high`` [m],
    shape (states,), say how far it is sought. Of a plate that nowhere rests, the heave at which the
    least force is missing: a limit point, or ``low`` or ``high``.
    """
    shares, far, way = np.linspace(0.0, 1.0, _PLACES)[:, None], high, np.ones_like(high)

    def along(share: Array) -> tuple[Array, Array]:
        force, rate = balance(share * far)
        return np.where(np.isnan(force), -np.inf, way * force), way * rate * far

    force, rate = along(shares)
    if np.any(force[0] > 0):
        way = np.where(force[0] > 0, -1.0, 1.0)
        far = np.where(force[0] > 0, low, high)
        force, rate = along(shares)
    crossed = force >= 0
    rests = np.asarray(crossed.any(axis=0))
    place = np.where(rests, crossed.argmax(0), force.argmax(0))
    before, after = shares[np.maximum(place - 1, 0), 0], shares[place, 0]
    last, rising = place == _PLACES - 1, rate >= 0
    limited = ~rests & np.where(last, ~rising[-1], rising[0] | (place > 0))
    if limited.any():
        def falling(share: Array) -> tuple[Array, Array]:
            tiny = 1e-5
            ahead, behind = along(share + tiny)[1], along(share - tiny)[1]
            return -along(share)[1], -(ahead - behind) / (2 * tiny)

        beyond = shares[np.minimum(place + 1, _PLACES - 1), 0]
        after = crossing(falling, np.where(limited, before, after),
                         np.where(limited, beyond, after), after)
        rests = rests | (limited & (along(after)[0] >= 0))
    before = np.where(rests, before, after)
    ends = np.take_along_axis(force, np.stack([np.maximum(place - 1, 0), place]), 0)
    with np.errstate(all="ignore"):
        secant = before + ends[0] / (ends[0] - ends[1]) * (after - before)
    return crossing(along, before, after, secant) * far, rests


def play(first: Array, last: Array, runs: Iterable[NDArray[np.int64]],
         begun: Array) -> tuple[NDArray[np.int64], Array]:
    """Of each state the one at whose heave a rubbing plate stands, and the way it came there.

    ``first`` and ``last`` are the heaves between which it stays where it is, shape (states,). The
    ``runs`` are states in their order; ``begun`` says which way the first came: 1 down, -1 up.
    """
    at, way = np.arange(len(first)), np.ones(len(first))
    for run in runs:
        heave, before = 0.0, -1
        for state, lower, upper in zip(run.tolist(), first[run].tolist(), last[run].tolist(),
                                       strict=True):
            if before < 0:
                way[state] = begun[state]
            elif heave < lower - _STAYS:
                way[state] = 1.0
            elif heave > upper + _STAYS:
                way[state] = -1.0
            else:
                at[state], way[state] = at[before], way[before]
                continue
            heave, before = (lower if way[state] > 0 else upper), state
    return at, way


def crossing(function: Balance, low: Array, high: Array, start: Array) -> Array:
    """Where functions that are not positive at ``low`` cross 0 below ``high``: Newton in brackets.

    ``function`` answers values and derivatives, shape (n,) each. It begins at ``start`` where that
    is between them.
    """
    lower, upper = low.copy(), high.copy()
    point = np.where((start >= low) & (start <= high), start, (low + high) / 2)
    with np.errstate(all="ignore"):
        for _ in range(_HALVINGS):
            value, slope = function(point)
            lower, upper = np.where(value < 0, point, lower), np.where(value < 0, upper, point)
            following = point - np.where(value == 0, 0.0, value / slope)
            inside = (following >= lower) & (following <= upper)
            following = np.where(inside, following, (lower + upper) / 2)
            moved, point = np.abs(following - point), following
            if not np.any(moved > _SMALL):
                break
    return point
