"""Limit states that a film can reach on its path, each registered once.

A limit state has a margin along a branch, the place where it begins, one label and one marker. All
code that lists limit states uses :data:`LIMIT_STATES`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.fields import Registry
from tympan.fem.membrane.state import Needs
from tympan.fem.results.fields import Fields


class BranchPoint(Protocol):
    """Interface of a film at a point of a branch, for limit states."""

    @property
    def fields(self) -> Fields:
        """Fields at the nodes of every element."""

    @property
    def pressed(self) -> Fields:
        """Fields at the nodes of every element, of a film that cannot wrinkle."""

    @property
    def least_stress(self) -> float:
        """Least of the smaller principal stresses of :attr:`pressed` [Pa]."""

    @property
    def firmness(self) -> AnyArray:
        """Least stiffness in the film's plane at each node [Pa]."""

    @property
    def rough_firmness(self) -> AnyArray:
        """Least stiffness in the film's plane [Pa], from each element's own strain."""

    @property
    def growth(self) -> float:
        """Change of the load along the branch: 0 at a limit point, negative beyond it."""

    @property
    def given_way(self) -> float:
        """-1 if the film loses stability before the load's limit point, 0 beyond it, else 1."""

    @property
    def thinning(self) -> AnyArray:
        """Thickness a little further along the branch, relative to that here, at the nodes."""


@dataclass(frozen=True)
class Sign:
    """Number that is positive before a limit state and negative after it.

    ``needs``: what it needs of a point. ``local``: it is the least value of the limit state's
    ``field``.
    """

    value: Callable[[BranchPoint], float]
    needs: Needs = "state"
    local: bool = True


@dataclass(frozen=True)
class LimitState:
    """One type of limit.

    ``kind`` is its key in JSON, CSV and Python; ``meaning`` describes this key. ``label`` is its
    only name for people: on the terminal, in pages, pictures and messages. It contains the words of
    the key. ``marker`` is matplotlib's.

    ``field``: margin at the nodes of every element; the limit begins where it is least.
    ``by_element``: the same margin from each element alone; the jumps between elements show its
    uncertainty. ``signs``: the limit is reached where the first of them changes. A snap has no
    sign: it is a limit point beyond which the plate comes to a new equilibrium.

    ``falling``: the limit is reached while the voltage falls, after it exceeded another limit.
    ``strained``: the field depends only on principal stretches and stresses, so that reduced films
    have it, too.

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
        """Whether the limit begins at one place, where its field is least."""
        return any(sign.local for sign in self.signs)

    @property
    def word(self) -> str:
        """Words of the key as people write them."""
        return self.kind.replace("_", "-")

    def at(self, where: str) -> str:
        """State in words that the limit is reached at a load: "pull-in at 3 kV"."""
        return f"{self.label} at {where}"


#: All limit states by kind, the most severe last.
LIMIT_STATES: Registry[LimitState] = Registry("kind")

P = TypeVar("P", bound=BranchPoint)


def begun(point: BranchPoint) -> list[LimitState]:
    """List local limit states that a film has exceeded at a point."""
    return [state for state in LIMIT_STATES.values()
            if state.local and not state.field(point).min() > 0]


def passed(before: P, after: P, where: Callable[[Sign], P | None]
           ) -> Iterator[tuple[LimitState, Sign, P]]:
    """Yield limit states that a film reaches between two points of a branch, with their points.

    ``where`` finds the point between them at which a sign changes, on the stepper's own segment;
    None if it does not change. The first sign found represents the limit state.
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
    """Create the sign of a field's least value at the nodes of every element."""
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
    _tension, _tension, (Sign(lambda point: point.least_stress),), "s", strained=True))

BREAKDOWN: LimitState = LIMIT_STATES.register(LimitState(
    "breakdown", "breakdown", "first breakdown",
    _strength_left, _strength_left, (least(_strength_left),), "X"))

INSTABILITY: LimitState = LIMIT_STATES.register(LimitState(
    "instability", "instability",
    "instability of the film itself, before the plate's pull-in",
    _firmness, lambda point: point.rough_firmness,
    (least(_firmness), Sign(lambda point: point.given_way, needs="tangent", local=False)), "D"))

PULL_IN: LimitState = LIMIT_STATES.register(LimitState(
    "pull_in", "pull-in", "pull-in of the plate",
    _thinning, _thinning, (Sign(lambda point: point.growth, needs="direction", local=False),), "x"))
