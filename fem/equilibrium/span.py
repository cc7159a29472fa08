"""Interpolation between two equilibria of a path, at a given load or plate deflection."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

from tympan.fem.equilibrium.constraints import Constraint, difference, held_plate, length
from tympan.fem.equilibrium.newton import NewtonSettings, Solution, moved, simplified_newton
from tympan.fem.equilibrium.ramp import UNNOTICED
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State

#: Largest distance of an equilibrium from the interpolating cubic, relative to its motion.
_ASIDE = 0.01


class Given(Protocol):
    """Interface of a quantity that is given along a path."""

    def free(self, model: Model) -> tuple[Load, ...]:
        """List the loads that are solved for."""

    def constraints(self, value: float) -> tuple[Constraint, ...]:
        """Build one equation for each of these loads."""

    def value(self, model: Model, state: State) -> float:
        """Compute the value of the quantity in a state."""

    def applied(self, state: State, value: float) -> State:
        """Set the value in a state, if the quantity is a load."""

    def slope(self, model: Model, solution: Solution) -> tuple[Parts, dict[Load, float]]:
        """Compute the motion and the change of the free loads per unit of the quantity."""


@dataclass(frozen=True)
class GivenLoad:
    """A given load, such as U² [V²]; only the motion is solved for."""

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
    """A given deflection of the plate [m]; the force that holds it is solved for."""

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
    """Two equilibria on a path that are close enough for a cubic between them.

    It is Hermite's cubic through both equilibria with their slopes, as a function of the ``given``
    quantity.
    """

    model: Model
    start: Solution
    end: Solution
    given: Given
    newton: NewtonSettings = field(default_factory=NewtonSettings)

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Values of the given quantity at both ends."""
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
        """Evaluate the cubic at a value; beyond the end, extrapolate it.

        A span of zero length is extrapolated along its slope.
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
        """Solve for the equilibrium at a value between the ends; None if not found.

        A few corrections with both ends' tangents lead from the cubic to the equilibrium. A film
        slack when mounted may go slack on the way; it is not searched.
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
        # If the films at both ends are in tension, this film is in tension, too.
        tense = min(end.thinning_margin(model) for end in (self.start, self.end)) == float("inf")
        if not tense and solution.thinning_margin(model) < 0:
            return None
        missed, gone = (length(model, difference(model, solution.state, state))
                        for state in (guess, self.start.state))
        return solution if missed <= _ASIDE * gone + UNNOTICED else None
