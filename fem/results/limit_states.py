"""Limit states: what can happen to a film on the way to its end, each registered once.

A limit state has a margin along a branch, the place where it begins, and its words and mark.
Whatever lists limits asks :data:`LIMIT_STATES`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.fem.results.fields import Fields
from tympan.geometry.fields import Registry

Array = NDArray[Any]


class BranchPoint(Protocol):
    """A film at a point of a branch, as limit states look at it."""

    @property
    def fields(self) -> Fields:
        """Fields at the nodes of every element."""

    @property
    def pressed(self) -> Fields:
        """The same of a film that would not wrinkle."""

    @property
    def firmness(self) -> Array:
        """Least stiffness within the film's plane there [Pa]."""

    @property
    def rough_firmness(self) -> Array:
        """The same by each element's own strain."""

    @property
    def growth(self) -> float:
        """Growth of the load along the branch, 0 at a limit point and negative beyond it."""

    @property
    def given_way(self) -> float:
        """-1 where the film moves by itself before the load's limit point, 0 beyond it, else 1."""

    @property
    def thinning(self) -> Array:
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

    ``kind`` is its key in results, ``event`` its name along a path. ``field``: at the nodes of
    every element, least where it begins; ``by_element`` the same by each element alone, whose jumps
    say how certain it is. ``signs``: it happens where the first of them changes; a snap, which has
    none, is a limit point beyond which the plate comes to rest again. ``verb`` is said of the film,
    ``noun`` stands alone, ``sentence`` holds a voltage, ``legend`` is for the picture of a path;
    ``marker`` is matplotlib's. ``falling``: it is met as the voltage falls, once it was beyond
    another.
    """

    kind: str
    event: str
    field: Callable[[BranchPoint], Array]
    by_element: Callable[[BranchPoint], Array]
    signs: tuple[Sign, ...]
    verb: str
    noun: str
    sentence: str
    marker: str
    legend: str
    falling: bool = False


#: All limit states by kind, the most severe last.
LIMIT_STATES: Registry[LimitState] = Registry("kind")


def _least(field: Callable[[BranchPoint], Array]) -> Sign:
    return Sign(lambda point: float(field(point).min()))


def _tension(point: BranchPoint) -> Array:
    return point.pressed.stress_2


def _strength_left(point: BranchPoint) -> Array:
    return np.asarray(1 - point.fields.breakdown_share)


def _thinning(point: BranchPoint) -> Array:
    return point.thinning


def _firmness(point: BranchPoint) -> Array:
    return point.firmness


SNAP_THROUGH: LimitState = LIMIT_STATES.register(LimitState(
    "snap_through", "snap-through", _thinning, _thinning, (),
    verb="snaps through", noun="snap-through", sentence="snaps through at {}",
    legend="plate snaps through", marker=">"))

SNAP_BACK: LimitState = LIMIT_STATES.register(LimitState(
    "snap_back", "snap-back", _thinning, _thinning, (),
    verb="snaps back", noun="snap-back as the voltage falls", sentence="snaps back at {}",
    legend="plate snaps back", marker="<", falling=True))

TENSION: LimitState = LIMIT_STATES.register(LimitState(
    "tension", "tension lost", _tension, _tension, (_least(_tension),),
    verb="loses tension", noun="the first loss of tension", sentence="loses tension from {} on",
    legend="tension lost from here", marker="s"))

BREAKDOWN: LimitState = LIMIT_STATES.register(LimitState(
    "breakdown", "breakdown", _strength_left, _strength_left, (_least(_strength_left),),
    verb="breaks down", noun="breakdown", sentence="would break down from {} on",
    legend="field reaches the film's strength", marker="X"))

INSTABILITY: LimitState = LIMIT_STATES.register(LimitState(
    "instability", "instability", _firmness, lambda point: point.rough_firmness,
    (_least(_firmness), Sign(lambda point: point.given_way, of_state=False, local=False)),
    verb="gives way", noun="the film's own instability", sentence="gives way in itself at {}",
    legend="film gives way in itself", marker="D"))

PULL_IN: LimitState = LIMIT_STATES.register(LimitState(
    "pull_in", "limit", _thinning, _thinning,
    (Sign(lambda point: point.growth, of_state=False, local=False),),
    verb="pulls in", noun="pull-in", sentence="pulls in at {}", legend="limit point", marker="x"))
