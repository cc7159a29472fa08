"""Time steps through the pieces of a signal; an error estimate controls their length.

A :class:`Mover` is the moving system: a finite-element film, a reduced film, or many of these at
once. It makes one step and estimates its error. The control of the steps' length, and the handling
of a failed step, are the same for all and are defined here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol, TypeVar

from tympan.fem.transient.ends import Stopped

#: Least ratio of a step to the one before: an error estimate far from its target is unreliable.
_SHRINK = 0.2
#: Largest ratio of a step to the one before, for the same reason.
_GROWTH = 5.0

#: Error that replaces zero, to avoid a division by 0.
_NO_ERROR = 1e-300

Moment_co = TypeVar("Moment_co", covariant=True)


@dataclass(frozen=True)
class StepControl:
    """Control of the steps' lengths by their errors.

    ``error``: largest error of a step. ``order``: power of a step's length with which its error
    grows. ``safety``: ratio of a step's length to the longest that its error would allow, so that
    few steps are rejected. ``shortest``: length, relative to the first step in a piece, below which
    the motion is not continued.
    """

    error: float
    order: int
    safety: float
    shortest: float

    def next(self, duration: float, error: float) -> float:
        """Compute the length of the next step from a duration [s] and its error.

        Examples
        --------
        >>> StepControl(1e-4, 3, 0.85, 1e-5).next(2.0, 1e-4)
        1.7
        >>> StepControl(1e-4, 3, 0.85, 1e-5).next(2.0, float("inf"))
        0.4
        """
        change: float = self.safety * (self.error / max(error, _NO_ERROR)) ** (1 / self.order)
        return duration * min(max(change, _SHRINK), _GROWTH)


class Mover(Protocol[Moment_co]):
    """Interface of a moving film for the stepper."""

    @property
    def control(self) -> StepControl:
        """Control of the steps' lengths."""

    @property
    def time(self) -> float:
        """Time reached [s]."""

    @property
    def gone(self) -> bool:
        """Whether the plate has moved further than any film that holds it."""

    def enter(self, piece: int, begin: float, end: float
              ) -> tuple[Sequence[Moment_co], float | None]:
        """Enter a piece of the signal; return its first moments and the first step's length [s].

        If the length is None, the steps continue as in the piece before.
        """

    def attempt(self, duration: float, end: float | None) -> float:
        """Try a step of a duration [s] and return its error; infinite if it fails.

        A step to the ``end`` of a piece ends exactly there.
        """

    def accept(self) -> Sequence[Moment_co]:
        """Accept the last attempted step; return its moments."""

    def recover(self, shortest: bool) -> Sequence[Moment_co]:
        """Discard the last attempted step; return the moments of an alternative.

        ``shortest``: no shorter step will be tried.

        Raises
        ------
        Stopped
            If there is no alternative.
        """


def moments(mover: Mover[Moment_co], breaks: Sequence[float]) -> Iterator[Moment_co]:
    """Yield moments through a signal with breaks [s]; a piece's first time occurs twice.

    Raises
    ------
    Stopped
        If the film has no equilibrium any more, or the plate has pulled in.
    """
    control, step = mover.control, 0.0
    for piece, (begin, end) in enumerate(pairwise(breaks)):
        entered, first = mover.enter(piece, begin, end)
        yield from entered
        first = step if first is None else first
        step = first
        while mover.time < end:
            rest = end - mover.time
            duration = rest if step >= rest else min(step, rest / 2)
            error = mover.attempt(duration, end if duration == rest else None)
            step = control.next(duration, error)
            if error <= control.error:
                yield from mover.accept()
                if mover.gone:
                    raise Stopped("pull_in", mover.time)
                continue
            shortest = duration < control.shortest * first
            yield from mover.recover(shortest)
            if shortest:
                step = control.next(first, control.error)
