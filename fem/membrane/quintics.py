"""A force along one deflection as quintics between places with a known force and slope.

Energy, force and stiffness of one piece are derivatives of one another, and so over all pieces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Self

import numpy as np

from tympan.base.arrays import AnyArray

#: Largest error of a cubic through both ends in their middle, relative to the forces, for which the
#: quintic through all three is accepted. Where a cubic, with four numbers, has this error, a
#: quintic, with six, has its power of 3/2.
CUBIC = 1e-9
#: Most halvings of a step: a wrinkling film has forces that no polynomial follows closer, and a
#: film that becomes unstable does so within a 250th of a step.
HALVINGS = 8
#: Pieces that a range of deflections is divided into before pieces are halved.
_PIECES = 32

#: Inverse of the values and slopes at 0, 1/2 and 1 of the powers up to the fifth.
_QUINTIC = np.linalg.inv(np.array([
    *([place**power for power in range(6)] for place in (0.0, 0.5, 1.0)),
    *([power * place ** max(power - 1, 0) for power in range(6)] for place in (0.0, 0.5, 1.0))]))

#: A place [m], the force [N] and the stiffness [N/m] there.
Known = tuple[float, float, float]
#: A piece of a curve: its first end, its middle and its last end.
QuinticPiece = tuple[Known, Known, Known]


def cubic_miss(first: Known, middle: Known, last: Known) -> float:
    """Compute the error of the cubic of both ends for the force in their middle, relative."""
    span = last[0] - first[0]
    value = (first[1] + last[1]) / 2 + span * (first[2] - last[2]) / 8
    scale = max(abs(each[1]) for each in (first, middle, last)) + abs(span * middle[2])
    return abs(value - middle[1]) / scale if scale else 0.0


def powers_of(first: Known, middle: Known, last: Known) -> AnyArray:
    """Fit powers of the share of the way from the first to the last place, (6,)."""
    span = last[0] - first[0]
    _, forces, stiffnesses = zip(first, middle, last, strict=True)
    return _QUINTIC @ [*forces, *(span * stiffness for stiffness in stiffnesses)]


def values(powers: Any, share: Any, span: Any) -> tuple[Any, Any, Any]:
    """Evaluate energy from the piece's start [J], force [N] and stiffness [N/m] at a share of it.

    ``powers`` (6, …) and ``span`` [m] both broadcast with the share.
    """
    energy, force, slope = 0.0 * share, 0.0 * share, 0.0 * share
    for power in range(5, -1, -1):
        slope = slope * share + force
        force = force * share + powers[power]
        energy = energy * share + powers[power] / (power + 1)
    return span * energy * share, force, slope / span


@dataclass(frozen=True, eq=False)
class QuinticCurve:
    """A force between ``breaks`` [m], ascending; ``powers`` (6, pieces), ``stored`` (pieces,) [J].

    It takes arrays of deflections, and is nan beyond its ends.
    """

    breaks: AnyArray
    powers: AnyArray
    stored: AnyArray

    @classmethod
    def of(cls, force: Callable[[float], Sequence[float]], low: float, high: float,
           kinks: Sequence[float] = (), through: float = 0.0) -> Self | None:
        """Fit the curve of a mechanism between two deflections [m], as far as it exists.

        ``force`` computes energy, force and stiffness, nan where there is none. Force and stiffness
        are smooth between ``kinks`` [m] and do not jump there. If it has several parts, the one
        ``through`` a deflection [m] is taken; None where there is none.
        """
        def known(place: float) -> Known:
            _, push, stiffness = force(place)
            return place, float(push), float(stiffness)

        within = [kink for kink in kinks if low < kink < high]
        places = np.unique([*np.linspace(low, high, _PIECES + 1), *within, through])
        pieces = [piece for first, last in pairwise(map(known, places.tolist()))
                  for piece in _halved(known, first, last, HALVINGS)]
        runs: list[list[QuinticPiece]] = [[]]
        for piece in pieces:
            if runs[-1] and runs[-1][-1][-1] is not piece[0]:
                runs.append([])
            runs[-1].append(piece)
        for run in filter(None, runs):
            bounds = [piece[0][0] for piece in run] + [run[-1][-1][0]]
            if bounds[0] <= through <= bounds[-1]:
                break
        else:
            return None
        breaks = np.array(bounds)
        powers = np.array([powers_of(*piece) for piece in run]).T
        spans = np.diff(breaks)
        ends = np.cumsum(values(powers, np.ones(len(spans)), spans)[0])
        stored = np.append(0.0, ends[:-1])
        made = cls(breaks, powers, stored)
        missing = force(through)[0] - made.derivatives(through)[0]
        return cls(breaks, powers, stored + missing)

    def derivatives(self, deflection: Any) -> tuple[Any, Any, Any]:
        """Evaluate energy [J], force [N] and stiffness [N/m] at deflections [m]."""
        at = np.real(deflection)
        number = np.clip(np.searchsorted(self.breaks, at, "right") - 1, 0, len(self.stored) - 1)
        low, span = self.breaks[number], np.diff(self.breaks)[number]
        there = np.where((at >= self.breaks[0]) & (at <= self.breaks[-1]), 0.0, np.nan)
        energy, force, stiffness = values(self.powers[:, number], (deflection - low) / span, span)
        return self.stored[number] + energy + there, force + there, stiffness + there


def _halved(known: Callable[[float], Known], first: Known, last: Known, halvings: int
            ) -> Iterator[QuinticPiece]:
    """Halve an interval into pieces, each with its middle, where the force exists."""
    middle = known((first[0] + last[0]) / 2)
    whole = np.isfinite([*first, *middle, *last]).all()
    if whole and (not halvings or cubic_miss(first, middle, last) <= CUBIC):
        yield first, middle, last
    elif halvings:
        yield from _halved(known, first, middle, halvings - 1)
        yield from _halved(known, middle, last, halvings - 1)
