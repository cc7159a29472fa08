"""A branch between two of its points and a little beyond, predicted from their directions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tympan.fem.equilibrium.constraints import difference, length, product
from tympan.fem.equilibrium.newton import Solution, moved
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State

#: A motion of film and plate, and the change of load that belongs to it.
Change = tuple[Parts, float]


@dataclass(frozen=True, eq=False)
class PathPoint:
    """An equilibrium on a branch.

    ``direction``: unit motion of film and plate along the branch. ``rate``: change of the load per
    unit of arc length, zero at a limit point and negative beyond it.
    """

    solution: Solution
    direction: Parts
    rate: float

    @property
    def state(self) -> State:
        """State of the equilibrium."""
        return self.solution.state


@dataclass(frozen=True, eq=False)
class Segment:
    """A branch as a polynomial in the ``step`` along the direction of the point ``before``.

    It is Hermite's cubic through this point and ``after`` with their directions; without ``after``
    the line along the direction.
    """

    model: Model
    load: Load
    before: PathPoint
    after: PathPoint | None = None

    @cached_property
    def span(self) -> float:
        """Step from end to end."""
        return product(self.model, self.before.direction, self._whole[0])

    def at(self, step: float) -> PathPoint:
        """Predict the point at a step; its solution has no tangent."""
        motion, change = self._combined(*self._weights(step))
        direction, rate = self._combined(*self._slopes(step))
        scale = length(self.model, direction) or 1.0
        state = moved(self.model, self.before.state, motion, 1.0, {self.load: change})
        return PathPoint(Solution(state, False, 0, None),
                         (direction[0] / scale, direction[1] / scale), rate / scale)

    def _weights(self, step: float) -> tuple[float, ...]:
        if self.after is None:
            return (step,)
        t = step / self.span
        return (step * (1 - t) ** 2, t * t * (3 - 2 * t), -self.span * t * t * (1 - t))

    def _slopes(self, step: float) -> tuple[float, ...]:
        """Differentiate the weights by the step."""
        if self.after is None:
            return (1.0,)
        t = step / self.span
        return ((1 - t) * (1 - 3 * t), 6 * t * (1 - t) / self.span, t * (3 * t - 2))

    def _combined(self, *weights: float) -> Change:
        """Combine the changes along ``before``, from end to end, and along ``after``."""
        changes: list[Change] = [(self.before.direction, self.before.rate)]
        if self.after is not None:
            changes += [self._whole, self._last]
        return _sum(zip(weights, changes, strict=True))

    @cached_property
    def _whole(self) -> Change:
        assert self.after is not None
        start, end = self.before.state, self.after.state
        return (difference(self.model, end, start), end.load(self.load) - start.load(self.load))

    @cached_property
    def _last(self) -> Change:
        """Motion and change of load at the end per unit of step."""
        assert self.after is not None
        film, plate = self.after.direction
        scale = product(self.model, self.before.direction, self.after.direction)
        return (film / scale, plate / scale), self.after.rate / scale


def _sum(terms: Iterable[tuple[float, Change]]) -> Change:
    """Add changes times weights."""
    factors, changes = zip(*terms, strict=True)
    film, plate, load = (sum(np.multiply(factor, part) for factor, part in
                             zip(factors, parts, strict=True))
                         for parts in zip(*((*motion, load) for motion, load in changes),
                                          strict=True))
    return (film, plate), float(load)
