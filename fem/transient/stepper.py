"""Steps in time through the pieces of a signal, each as long as its error allows.

A :class:`Mover` is what moves: a film by finite elements, a reduced film, many of these at once. It
makes one step and says how large its error is. How long each step is, and what happens after a step
that failed, is the same for all and stands here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol, TypeVar

from tympan.fem.transient.ends import Stopped

#: A step is at least this share of the one before, as an error estimate far from its aim says
#: little.
_SHRINK = 0.2
#: A step is at most this many times as long as the one before, for the same reason.
_GROWTH = 5.0

#: An error that is none, so that nothing is divided by 0.
_NO_ERROR = 1e-300

Moment_co = TypeVar("Moment_co", covariant=True)


@dataclass(frozen=True)
class StepControl:
    """Lengths of steps by their errors.

    ``error``: the largest that a step may have; ``order``: the power of a step's length that its
    error grows with; ``safety``: a step's length over the longest that its error would allow, so
    that few are refused; ``shortest``: length over that of the first step in a piece below which
    the film is not followed any more.
    """

    error: float
    order: int
    safety: float
    shortest: float

    def next(self, duration: float, error: float) -> float:
        """Length of the step after one of a duration [s] with an error [s].

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
    """A film in motion, and where it is: what a stepper asks of it."""

    @property
    def control(self) -> StepControl:
        """Control of its steps' lengths."""

    @property
    def time(self) -> float:
        """Time it has reached [s]."""

    @property
    def gone(self) -> bool:
        """Whether it has moved further than any film that holds its plate."""

    def enter(self, piece: int, begin: float, end: float
              ) -> tuple[Sequence[Moment_co], float | None]:
        """Enter a piece of the signal; answer its first moments, and a first step's length [s].

        Without a length the steps go on as in the piece before.
        """

    def attempt(self, duration: float, end: float | None) -> float:
        """Error of a step of a duration [s]; infinite where it finds no balance.

        A step to the ``end`` of a piece ends there to the last digit.
        """

    def accept(self) -> Sequence[Moment_co]:
        """Go on from the step that was attempted last; answer its moments."""

    def recover(self, shortest: bool) -> Sequence[Moment_co]:
        """Go on without the step that was attempted last; answer the moments of another way.

        ``shortest``: no shorter step is tried.

        Raises
        ------
        Stopped
            Where there is no other way.
        """


def moments(mover: Mover[Moment_co], breaks: Sequence[float]) -> Iterator[Moment_co]:
    """Moments through a signal with breaks [s]; where a piece begins its time stands twice.

    Raises
    ------
    Stopped
        Where the film has no equilibrium any more, or the plate is gone.
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
