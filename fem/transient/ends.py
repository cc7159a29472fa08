"""Ends of a motion before its signal's: each kind once, with its one message."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

#: Kind of end, as results name it.
EndKind = Literal["drawn_in", "pull_in", "thinning"]

#: Why a motion ended: its signal did, or what the film did before.
MotionStatus = Literal["done", EndKind]

#: Message of each kind of end, for the time [s] it came after.
MESSAGES: dict[EndKind, str] = {
    "drawn_in": "the film is drawn in after {time:.4g} s: a step overshoots what a slow ramp may "
                "reach; lower the voltage",
    "pull_in": "pull-in after {time:.4g} s; lower the voltage",
    "thinning": "the film thins without bound after {time:.4g} s; lower the voltage",
}

#: Message where a mechanism ends before the film does.
_MECHANISM = "{why}, after {time:.4g} s"

#: Message of a film that loses its tension, which does not end its motion.
SLACK = ("loss of tension from {time:.4g} s on: the film wrinkles, and its branches resist "
         "compression")

_Moment = TypeVar("_Moment")


class Stopped(ArithmeticError):
    """The motion goes no further than a ``time`` [s].

    It leaves a lumped model's reach (``drawn_in``), has no equilibrium any more (``pull_in``), or
    the film thins without bound (``thinning``). ``why``: what else ends there, in words.
    """

    def __init__(self, kind: EndKind, time: float, why: str = "") -> None:
        super().__init__((_MECHANISM if why else MESSAGES[kind]).format(time=time, why=why))
        self.kind, self.time, self.why = kind, time, why


def status_of(stopped: Stopped | None) -> MotionStatus:
    """Why a motion ended: ``done`` where nothing stopped it before its signal's end."""
    return "done" if stopped is None else stopped.kind


@dataclass(eq=False)
class Followed(Generic[_Moment]):
    """Moments of a motion, one after the other; then what ``stopped`` it, None for nothing."""

    moments: Iterable[_Moment]
    stopped: Stopped | None = None

    def __iter__(self) -> Iterator[_Moment]:
        try:
            yield from self.moments
        except Stopped as ending:
            self.stopped = ending
