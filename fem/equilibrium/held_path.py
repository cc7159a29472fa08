"""Equilibria at many deflections of a held plate, and those that a load has between them."""

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

#: Most deflections that one step leads over: a cubic must be near those between. Set by trial.
_LONGEST = 12
#: Iterations up to which a step was easy, so that the next one leads over more deflections.
_EASY = 2
#: A step may miss what was foretold by this share of its motion: else it is on another branch.
_SURPRISE = 0.3
#: Distance below which two equilibria are one, relative to their interval: rounding puts the same
#: one a little before or beyond an end of it.
BESIDE = 1e-6

_HELD = GivenDeflection()


@dataclass(frozen=True, eq=False)
class HeldSpan:
    """A step of a held plate: a ``span`` and the equilibria found within it, in order.

    Both ends have tangents of their own; equilibria between have that of the end. A plate that was
    not followed all the way was ``stopped`` at the end.
    """

    span: Span
    inner: tuple[Solution, ...] = ()
    stopped: bool = False

    @property
    def solutions(self) -> tuple[Solution, ...]:
        """Its equilibria without the first."""
        return (*self.inner, self.span.end)

    @cached_property
    def forces(self) -> tuple[Array, Array, Array]:
        """Deflections [m] of all, the forces that hold them [N], and the slopes of these [N/m].

        Slopes are those of the polynomial through the forces and both ends' slopes.
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
    """Two deflections of a held plate [m] next to each other, and the film between them.

    ``excess``: force that holds the plate over that of its load [N], and ``slopes`` of that [N/m],
    at both ends; ``foretold``: the state that is expected at a deflection.
    """

    low: float
    high: float
    excess: Array
    slopes: Array
    foretold: Callable[[float], State]


def crossings(model: Model, intervals: Iterable[HeldInterval], force: float, settings: PathSettings,
              beyond: float = BESIDE) -> Iterator[Solution]:
    """Equilibria under a force [N] where the force of a held plate crosses that of its load.

    Newton's method begins at the roots of each interval's cubic. An equilibrium that was found
    before is left out, and so is one ``beyond`` the interval by more than so many times its length.
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
    """Slope of the force that holds the plate [N/m]."""
    assert solution.tangent is not None
    return float(solution.tangent.along()[1]["force"])


def held_path(model: Model, deflections: Sequence[float], start: Solution,
              settings: PathSettings = PathSettings()) -> Iterator[HeldSpan]:
    """Steps through deflections of the plate [m] from one at which it is held, at its voltage.

    They pass every limit point of the load. The path ends before a deflection that is not reached:
    what lies there is asked of the end of the last step.
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
    """A solution of a held plate with the tangent of its own state, which Newton's is not."""
    solution.release()
    target = model.deflection(solution.state)
    tangent = tangent_at(model, solution.state, _HELD.free(model), _HELD.constraints(target))[0]
    return solution if tangent is None else replace(solution, tangent=tangent, _responses={})


def _step(model: Model, span: Span | None, last: Solution, ahead: Sequence[float],
          settings: PathSettings) -> HeldSpan | None:
    """A step to the last of some deflections; None if that, or one on the way, is not found."""
    end = _next(model, span, last, ahead[-1], settings)
    if end is None:
        return None
    step = Span(model, last, end, _HELD, settings.newton)
    inner = [step.at(value) for value in ahead[:-1]]
    return HeldSpan(step, tuple(each for each in inner if each)) if all(inner) else None


def _next(model: Model, span: Span | None, last: Solution, value: float, settings: PathSettings
          ) -> Solution | None:
    """The equilibrium that the last span leads on to, or the slope at its end, with its tangent."""
    span = span or Span(model, last, last, _HELD)
    guess = span.foretold(value)
    given = _HELD.free(model), _HELD.constraints(value), settings.newton
    solution = simplified_newton(model, guess, *given, last.tangent)
    if solution is None:
        last.release()
        solution = newton(model, guess, *given)
        # It took a tangent more than by corrections alone.
        solution = replace(solution, iterations=solution.iterations + _EASY)
    if not solution.converged:
        return None
    missed, gone = (length(model, difference(model, solution.state, state))
                    for state in (guess, last.state))
    if missed > _SURPRISE * gone + UNNOTICED:
        return None
    return with_tangent(model, solution, settings)


def _creep(model: Model, last: Solution, value: float, settings: PathSettings) -> HeldSpan | None:
    """A step to a deflection, or as near to it as shorter ones lead; None if they lead nowhere."""
    voltage = max(last.state.voltage_squared, 0.0) ** 0.5
    outcome = held(model, value, voltage, last, settings)
    if outcome.solution is last:
        return None
    end = with_tangent(model, outcome.solution, settings)
    return HeldSpan(Span(model, last, end, _HELD, settings.newton),
                    stopped=outcome.status != "equilibrium")
