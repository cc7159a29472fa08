"""Limit states: what can happen to a film on the way to its end, each registered once.

A limit state has a margin along a branch, the place where it begins, its one label and its mark.
Whatever lists limits asks :data:`LIMIT_STATES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.fields import Registry
from tympan.fem.results.fields import Fields


class BranchPoint(Protocol):
    """A film at a point of a branch, as limit states look at it."""

    @property
    def fields(self) -> Fields:
        """Fields at the nodes of every element."""

    @property
    def pressed(self) -> Fields:
        """The same of a film that would not wrinkle."""

    @property
    def firmness(self) -> AnyArray:
        """Least stiffness within the film's plane there [Pa]."""

    @property
    def rough_firmness(self) -> AnyArray:
        """The same by each element's own strain."""

    @property
    def growth(self) -> float:
        """Growth of the load along the branch, 0 at a limit point and negative beyond it."""

    @property
    def given_way(self) -> float:
        """-1 where the film moves by itself before the load's limit point, 0 beyond it, else 1."""

    @property
    def thinning(self) -> AnyArray:
        """Thickness a little further along the branch over that here, at the nodes."""


@dataclass(frozen=True)
class Sign:
    """A number that is positive before a limit state and negative after it.

    ``of_state``: no tangent is needed for it. ``local``: it is the least value of the limit
    state's ``field``.
    """

    value: Callable[[BranchPoint], float]
    of_state: bool = True
    local: bool = True


@dataclass(frozen=True)
class LimitState:
    """One kind of limit.

    ``kind`` is its key in JSON, CSV and Python, ``meaning`` what is said of that key. ``label`` is
    the one name of it that people read, on the terminal, in pages, pictures and messages; it
    contains the words of the key. ``field``: at the nodes of every element, least where it begins;
    ``by_element`` the same by each element alone, whose jumps say how certain it is. ``signs``: it
    happens where the first of them changes; a snap, which has none, is a limit point beyond which
    the plate comes to rest again. ``marker`` is matplotlib's. ``falling``: it is met as the voltage
    falls, once it was beyond another. ``strained``: its field is one of principal stretches and
    stresses alone, so that reduced films have it too.

    Raises
    ------
    ValueError
        When the label lacks the key's words: nobody could match the two.
    """

    kind: str
    label: str
    meaning: str
    field: Callable[[BranchPoint], AnyArray]
    by_element: Callable[[BranchPoint], AnyArray]
    signs: tuple[Sign, ...]
    marker: str
    falling: bool = False
    strained: bool = False

    def __post_init__(self) -> None:
        if self.word not in self.label:
            raise ValueError(f"the label {self.label!r} must contain {self.word!r}")

    @property
    def local(self) -> bool:
        """Whether it begins at one place, by the least value of its field."""
        return any(sign.local for sign in self.signs)

    @property
    def word(self) -> str:
        """Words of the key as people write them."""
        return self.kind.replace("_", "-")

    def at(self, where: str) -> str:
        """Statement that it happens at a load, in words: "pull-in at 3 kV"."""
        return f"{self.label} at {where}"


#: All limit states by kind, the most severe last.
LIMIT_STATES: Registry[LimitState] = Registry("kind")

P = TypeVar("P", bound=BranchPoint)


def begun(point: BranchPoint) -> list[LimitState]:
    """Local limit states that a film is beyond at a point."""
    return [state for state in LIMIT_STATES.values()
            if state.local and not state.field(point).min() > 0]


def passed(before: P, after: P, where: Callable[[Sign], P | None]
           ) -> Iterator[tuple[LimitState, Sign, P]]:
    """Limit states that a film passes between two points of a branch, each with the point there.

    ``where`` finds the point between them at which a sign changes, on the stepper's own segment;
    None where it does not. The first sign of a limit state that is found stands for it.
    """
    for state in LIMIT_STATES.values():
        for sign in state.signs:
            if sign.value(before) * sign.value(after) >= 0:
                continue
            point = where(sign)
            if point is not None:
                yield state, sign, point
                break


def least(field: Callable[[BranchPoint], AnyArray]) -> Sign:
    """Sign of the least value of a field at the nodes of every element."""
    return Sign(lambda point: float(field(point).min()))


def _tension(point: BranchPoint) -> AnyArray:
    return point.pressed.stress_2


def _strength_left(point: BranchPoint) -> AnyArray:
    return np.asarray(1 - point.fields.breakdown_share)


def _thinning(point: BranchPoint) -> AnyArray:
    return point.thinning


def _firmness(point: BranchPoint) -> AnyArray:
    return point.firmness


SNAP_THROUGH: LimitState = LIMIT_STATES.register(LimitState(
    "snap_through", "snap-through",
    "where a mechanism of the rig makes the plate jump to another stable equilibrium",
    _thinning, _thinning, (), ">"))

SNAP_BACK: LimitState = LIMIT_STATES.register(LimitState(
    "snap_back", "snap-back",
    "where it jumps back as the voltage falls; none where it stays there without voltage",
    _thinning, _thinning, (), "<", falling=True))

TENSION: LimitState = LIMIT_STATES.register(LimitState(
    "tension", "loss of tension", "first loss of tension",
    _tension, _tension, (least(_tension),), "s", strained=True))

BREAKDOWN: LimitState = LIMIT_STATES.register(LimitState(
    "breakdown", "breakdown", "first breakdown",
    _strength_left, _strength_left, (least(_strength_left),), "X"))

INSTABILITY: LimitState = LIMIT_STATES.register(LimitState(
    "instability", "instability",
    "instability of the film itself, before the plate's pull-in",
    _firmness, lambda point: point.rough_firmness,
    (least(_firmness), Sign(lambda point: point.given_way, of_state=False, local=False)), "D"))

PULL_IN: LimitState = LIMIT_STATES.register(LimitState(
    "pull_in", "pull-in", "pull-in of the plate",
    _thinning, _thinning, (Sign(lambda point: point.growth, of_state=False, local=False),), "x"))
