"""Equilibria between two of a path, whatever is given along it: a load, or the plate's place."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

from tympan.fem.equilibrium.constraints import Constraint, difference, held_plate, length
from tympan.fem.equilibrium.newton import NewtonSettings, Solution, moved, simplified_newton
from tympan.fem.equilibrium.ramp import UNNOTICED
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State

#: By what share of its motion an equilibrium may miss the cubic through those around it.
_ASIDE = 0.01


class Given(Protocol):
    """A quantity that is given along a path, and what follows from it."""

    def free(self, model: Model) -> tuple[Load, ...]:
        """Loads that follow."""

    def constraints(self, value: float) -> tuple[Constraint, ...]:
        """An equation for each of these."""

    def value(self, model: Model, state: State) -> float:
        """Value of this quantity in a state."""

    def applied(self, state: State, value: float) -> State:
        """The state, with the value where that is a load."""

    def slope(self, model: Model, solution: Solution) -> tuple[Parts, dict[Load, float]]:
        """Motion, and change of the loads that follow, per unit of it."""


@dataclass(frozen=True)
class GivenLoad:
    """A load, such as U² [V²]; nothing follows but the motion."""

    load: Load

    def free(self, model: Model) -> tuple[Load, ...]:
        return ()

    def constraints(self, value: float) -> tuple[Constraint, ...]:
        return ()

    def value(self, model: Model, state: State) -> float:
        return state.load(self.load)

    def applied(self, state: State, value: float) -> State:
        return state.under(**{self.load: value})

    def slope(self, model: Model, solution: Solution) -> tuple[Parts, dict[Load, float]]:
        return solution.rate(model, self.load), {}


@dataclass(frozen=True)
class GivenDeflection:
    """The deflection of the plate [m]; the force that holds it there follows."""

    def free(self, model: Model) -> tuple[Load, ...]:
        return (model.pushed_by,)

    def constraints(self, value: float) -> tuple[Constraint, ...]:
        return (held_plate(value),)

    def value(self, model: Model, state: State) -> float:
        return model.deflection(state)

    def applied(self, state: State, value: float) -> State:
        return state

    def slope(self, model: Model, solution: Solution) -> tuple[Parts, dict[Load, float]]:
        assert solution.tangent is not None
        return solution.tangent.along()


@dataclass(frozen=True, eq=False)
class Span:
    """Two equilibria of a path of a model so near that a cubic leads from the one to the other.

    That is Hermite's, through both by what is ``given``, with their slopes.
    """

    model: Model
    start: Solution
    end: Solution
    given: Given
    newton: NewtonSettings = field(default_factory=NewtonSettings)

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Values that are given at both ends."""
        first, last = (self.given.value(self.model, solution.state)
                       for solution in (self.start, self.end))
        return first, last

    @cached_property
    def _slopes(self) -> tuple[tuple[Parts, dict[Load, float]], ...]:
        return tuple(self.given.slope(self.model, solution)
                     for solution in (self.start, self.end))

    @cached_property
    def _whole(self) -> Parts:
        return difference(self.model, self.end.state, self.start.state)

    def foretold(self, value: float) -> State:
        """State of the cubic at a value, or where it leads on beyond the end.

        A span of no length leads along its slope.
        """
        low, high = self.ends
        if low == high:
            motion, rates = self._slopes[0]
            state = moved(self.model, self.start.state, motion, value - low, rates)
            return self.given.applied(state, value)
        span, t = high - low, (value - low) / (high - low)
        (first, before), (last, after) = self._slopes
        weights = span * t * (1 - t) ** 2, t * t * (3 - 2 * t), -span * t * t * (1 - t)
        film, plate = (weights[0] * one + weights[1] * change + weights[2] * other
                       for one, change, other in zip(first, self._whole, last, strict=True))
        start, end = self.start.state, self.end.state
        loads = {load: weights[0] * before[load] + weights[2] * after[load]
                 + weights[1] * (end.load(load) - start.load(load)) for load in before}
        return self.given.applied(moved(self.model, start, (film, plate), 1.0, loads), value)

    def at(self, value: float) -> Solution | None:
        """The equilibrium at a value between the ends; None if not found.

        It is where the cubic is, but for a few corrections by both ends' tangents. A film slack
        when mounted may go slack on the way, and is not looked for.
        """
        model, ends = self.model, self.ends
        if model.slack_when_mounted or not min(ends) < value < max(ends):
            return None
        guess, free = self.foretold(value), self.given.free(model)
        second, first = None, self.start.tangent
        if first is not None and first.at_hand and first.free == free:
            second = first, (ends[1] - value) / (ends[1] - ends[0])
        solution = simplified_newton(model, guess, free, self.given.constraints(value),
                                     self.newton, self.end.tangent, second)
        if solution is None:
            return None
        # Of films in tension on both sides none is further.
        tense = min(end.thinning_margin(model) for end in (self.start, self.end)) == float("inf")
        if not tense and solution.thinning_margin(model) < 0:
            return None
        missed, gone = (length(model, difference(model, solution.state, state))
                        for state in (guess, self.start.state))
        return solution if missed <= _ASIDE * gone + UNNOTICED else None
