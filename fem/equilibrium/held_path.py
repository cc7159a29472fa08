"""Equilibria at many deflections of a held plate, and equilibria under a load between them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.equilibrium.constraints import difference, length
from tympan.fem.equilibrium.held import held
from tympan.fem.equilibrium.newton import Solution, newton, simplified_newton, tangent_at
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import UNNOTICED
from tympan.fem.equilibrium.span import GivenDeflection, Span
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.roots import cubic_roots

#: Largest number of deflections in one step; the cubic of the step must be accurate at all of them.
#: Set by trial.
_LONGEST = 12
#: Largest number of iterations of an easy step; the next step then has more deflections.
_EASY = 2
#: Largest distance from the predicted state, as a share of the step's motion. A solution further
#: away is on another branch.
_SURPRISE = 0.3
#: Distance below which two equilibria are the same one, relative to their interval. Rounding may
#: move an equilibrium a little past an end of its interval.
BESIDE = 1e-6

_HELD = GivenDeflection()


@dataclass(frozen=True, eq=False)
class HeldSpan:
    """A step of a held plate: its ``span`` and the equilibria within it, in order.

    Both ends have their own tangents; the ``inner`` equilibria have the tangent of the end.
    ``stopped``: the plate was not followed all the way, and the span ends where it stopped.
    """

    span: Span
    inner: tuple[Solution, ...] = ()
    stopped: bool = False

    @property
    def solutions(self) -> tuple[Solution, ...]:
        """Equilibria of the step without the first."""
        return (*self.inner, self.span.end)

    @cached_property
    def forces(self) -> tuple[Array, Array, Array]:
        """Deflections [m], the forces that hold the plate [N], and their slopes [N/m].

        The slopes are those of the polynomial through all forces and both ends' slopes.
        """
        states = [solution.state for solution in (self.span.start, *self.solutions)]
        places = np.array([self.span.model.deflection(state) for state in states])
        forces = np.array([state.force for state in states])
        ends = np.array([held_stiffness(each) for each in (self.span.start, self.span.end)])
        if len(places) == 2:
            return places, forces, ends
        scale = places[-1] - places[0]
        t = (places - places[0]) / scale
        powers = np.arange(len(places) + 2)
        rise = powers * t[:, None] ** np.maximum(powers - 1, 0)
        matrix = np.vstack([t[:, None] ** powers, rise[[0, -1]]])
        factors = np.linalg.solve(matrix, np.concatenate([forces, scale * ends]))
        return places, forces, np.array([ends[0], *(rise[1:-1] @ factors) / scale, ends[1]])


@dataclass(frozen=True, eq=False)
class HeldInterval:
    """Two neighbouring deflections of a held plate [m], and the film between them.

    ``excess``: force that holds the plate minus the force of its load [N], at both ends.
    ``slopes``: derivatives of the excess [N/m], at both ends. ``foretold``: function that predicts
    the state at a deflection.
    """

    low: float
    high: float
    excess: Array
    slopes: Array
    foretold: Callable[[float], State]


def crossings(model: Model, intervals: Iterable[HeldInterval], force: float, settings: PathSettings,
              beyond: float = BESIDE) -> Iterator[Solution]:
    """Yield equilibria under a force [N], where the held plate needs exactly this force.

    Newton's method starts at the roots of each interval's cubic. Equilibria found before are
    omitted. Equilibria outside the interval by more than ``beyond`` times its length are omitted,
    too.
    """
    found: list[float] = []
    for interval in intervals:
        span = interval.high - interval.low
        for share in cubic_roots(interval.excess, span * interval.slopes, BESIDE):
            guess = interval.foretold(interval.low + share * span).under(force=force)
            solution = newton(model, guess, settings=settings.newton)
            if not solution.converged:
                continue
            place = model.deflection(solution.state)
            known = any(abs(place - other) <= BESIDE * abs(span) for other in found)
            if not known and -beyond <= (place - interval.low) / span <= 1 + beyond:
                found.append(place)
                yield solution


def held_stiffness(solution: Solution) -> float:
    """Compute the slope of the force that holds the plate [N/m]."""
    assert solution.tangent is not None
    return float(solution.tangent.along()[1]["force"])


def held_path(model: Model, deflections: Sequence[float], start: Solution,
              settings: PathSettings = PathSettings()) -> Iterator[HeldSpan]:
    """Yield steps through deflections of the plate [m] from a held start, at its voltage.

    The path passes every limit point of the load. It ends before a deflection that cannot be
    reached; the end of the last step is the last equilibrium.
    """
    last = with_tangent(model, start, settings)
    span: Span | None = None
    number, stride = 0, 1
    while number < len(deflections):
        ahead = deflections[number : number + stride]
        step = _step(model, span, last, ahead, settings)
        if step is None and stride > 1:
            stride //= 2
            continue
        if step is None:
            step = _creep(model, last, ahead[0], settings)
            if step is None:
                return
        span, last, number = step.span, step.span.end, number + len(ahead)
        stride = min(2 * stride, _LONGEST) if last.iterations <= _EASY else max(1, stride // 2)
        yield step
        if step.stopped:
            return


def with_tangent(model: Model, solution: Solution, settings: PathSettings = PathSettings()
                 ) -> Solution:
    """Give a solution of a held plate the tangent at its own state.

    The tangent that Newton's method leaves belongs to an earlier iterate.
    """
    solution.release()
    target = model.deflection(solution.state)
    tangent = tangent_at(model, solution.state, _HELD.free(model), _HELD.constraints(target))[0]
    return solution if tangent is None else replace(solution, tangent=tangent, _responses={})


def _step(model: Model, span: Span | None, last: Solution, ahead: Sequence[float],
          settings: PathSettings) -> HeldSpan | None:
    """Make a step to the last of some deflections; None if one of them is not found."""
    end = _next(model, span, last, ahead[-1], settings)
    if end is None:
        return None
    step = Span(model, last, end, _HELD, settings.newton)
    inner = [step.at(value) for value in ahead[:-1]]
    return HeldSpan(step, tuple(each for each in inner if each)) if all(inner) else None


def _next(model: Model, span: Span | None, last: Solution, value: float, settings: PathSettings
          ) -> Solution | None:
    """Solve for the equilibrium with its tangent, predicted by the last span; None if not found.

    Without a last span the slope at its end predicts the equilibrium.
    """
    span = span or Span(model, last, last, _HELD)
    guess = span.foretold(value)
    given = _HELD.free(model), _HELD.constraints(value), settings.newton
    solution = simplified_newton(model, guess, *given, last.tangent)
    if solution is None:
        last.release()
        solution = newton(model, guess, *given)
        # Newton's method needed one tangent more than corrections alone.
        solution = replace(solution, iterations=solution.iterations + _EASY)
    if not solution.converged:
        return None
    missed, gone = (length(model, difference(model, solution.state, state))
                    for state in (guess, last.state))
    if missed > _SURPRISE * gone + UNNOTICED:
        return None
    return with_tangent(model, solution, settings)


def _creep(model: Model, last: Solution, value: float, settings: PathSettings) -> HeldSpan | None:
    """Step to a deflection, or as close as shorter steps reach; None if none succeeds."""
    voltage = max(last.state.voltage_squared, 0.0) ** 0.5
    outcome = held(model, value, voltage, last, settings)
    if outcome.solution is last:
        return None
    end = with_tangent(model, outcome.solution, settings)
    return HeldSpan(Span(model, last, end, _HELD, settings.newton),
                    stopped=outcome.status != "equilibrium")
