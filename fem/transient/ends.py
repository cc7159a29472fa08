"""Events that end a motion before its signal does, with one message for each type."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

#: Type of end, as results name it.
EndKind = Literal["drawn_in", "pull_in", "thinning"]

#: Reason why a motion ended: its signal ended, or an earlier event.
MotionStatus = Literal["done", EndKind]

#: Message of each type of end; {time} is the time [s] of the end.
MESSAGES: dict[EndKind, str] = {
    "drawn_in": "the film is drawn in after {time:.4g} s: a step overshoots what a slow ramp may "
                "reach; lower the voltage",
    "pull_in": "pull-in after {time:.4g} s; lower the voltage",
    "thinning": "the film thins without bound after {time:.4g} s; lower the voltage",
}

#: Message if a mechanism ends before the film does.
_MECHANISM = "{why}, after {time:.4g} s"

#: Message of a film that loses its tension; this does not end its motion.
SLACK = ("loss of tension from {time:.4g} s on: the film wrinkles, and its branches resist "
         "compression")

_Moment = TypeVar("_Moment")


class Stopped(ArithmeticError):
    """Error: the motion cannot continue beyond a ``time`` [s].

    The film leaves a lumped model's range (``drawn_in``), has no equilibrium any more
    (``pull_in``), or thins without bound (``thinning``). ``why``: message about a mechanism that
    ends there.
    """

    def __init__(self, kind: EndKind, time: float, why: str = "") -> None:
        super().__init__((_MECHANISM if why else MESSAGES[kind]).format(time=time, why=why))
        self.kind, self.time, self.why = kind, time, why


def status_of(stopped: Stopped | None) -> MotionStatus:
    """Name the reason why a motion ended; ``done`` if it reached its signal's end."""
    return "done" if stopped is None else stopped.kind


@dataclass(eq=False)
class Followed(Generic[_Moment]):
    """Moments of a motion; after the last one, ``stopped`` is the event that ended it, or None."""

    moments: Iterable[_Moment]
    stopped: Stopped | None = None

    def __iter__(self) -> Iterator[_Moment]:
        try:
            yield from self.moments
        except Stopped as ending:
            self.stopped = ending
