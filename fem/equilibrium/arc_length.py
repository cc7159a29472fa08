"""Branches of equilibria followed by their arc length, through limit points and beyond."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from tympan.fem.equilibrium.constraints import Constraint, arc_length, difference, length, product
from tympan.fem.equilibrium.newton import NewtonSettings, Solution, moved, newton, tangent_at
from tympan.fem.equilibrium.subspace import FULL, Subspace
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State
from tympan.fem.roots import NoValueHere, root_between

#: Where between two points, in turn, others are tried that are nearer to what is looked for.
_SHARES = (0.5, 0.25, 0.75, 0.5, 0.25, 0.75, 0.5)


@dataclass(frozen=True)
class ArcSettings:
    """Steps along a branch, relative to the frame's half extent.

    ``first``, ``longest`` and ``shortest`` step; ``turn``: largest angle between the directions at
    both ends of a step [rad]; ``points``: limit on their number.
    """

    first: float = 5e-3
    longest: float = 0.05
    shortest: float = 5e-5
    turn: float = 0.3
    points: int = 500


@dataclass(frozen=True, eq=False)
class PathPoint:
    """An equilibrium on a branch.

    ``direction``: unit motion of film and plate along it; ``rate``: change of the load per unit of
    arc length, zero at a limit point and negative beyond it.
    """

    solution: Solution
    direction: Parts
    rate: float

    @property
    def state(self) -> State:
        """The equilibrium."""
        return self.solution.state


@dataclass(frozen=True)
class Branch:
    """The equilibria of a model when one ``load`` is free and the others are given."""

    model: Model
    load: Load
    subspace: Subspace = FULL
    newton: NewtonSettings = field(default_factory=NewtonSettings)
    arc: ArcSettings = field(default_factory=ArcSettings)

    def points(self, start: State, sense: int = 1) -> Iterator[PathPoint]:
        """Points from an equilibrium on, the load growing at first (``sense`` 1) or falling (−1).

        Ends where no step can be made any more, or at the limit of points.
        """
        point, step = self._first(start, sense), self.arc.first
        for _ in range(self.arc.points):
            if point is None:
                return
            yield point
            while step >= self.arc.shortest:
                following = self.at(point, step)
                if following is not None:
                    cosine = product(self.model, point.direction, following.direction)
                    turn = float(np.arccos(np.clip(cosine, -1, 1)))
                    if turn <= self.arc.turn:
                        break
                step /= 2
            else:
                return
            step = min(1.6 * step if turn < self.arc.turn / 3 else step, self.arc.longest)
            # Beside a limit the sign of the rate is that of the point's own tangent alone.
            beside = abs(following.rate) < abs(following.rate - point.rate)
            point = self._renewed(following) if beside else following

    def at(self, point: PathPoint, step: float, near: PathPoint | None = None,
           ) -> PathPoint | None:
        """The point a length along the direction of another, if Newton finds it.

        It is looked for from a point ``near`` it, at first from the other itself.
        """
        near = near or point
        motion = difference(self.model, near.state, point.state)
        further = step - product(self.model, point.direction, motion)
        further /= product(self.model, point.direction, near.direction)
        guess = moved(self.model, near.state, near.direction, further,
                      {self.load: near.rate})
        point.solution.release()
        near.solution.release()
        return self._solved(guess, arc_length(point.state, point.direction, step))

    def where(self, before: PathPoint, after: PathPoint,
              value: Callable[[PathPoint], float], of_state: bool = False) -> PathPoint | None:
        """The point between two others where a function vanishes; None without change of sign.

        Where that is the rate, the point is a limit and its direction the critical mode. A function
        ``of_state`` looks at no tangent. Where Newton's method goes astray from both of them, it
        starts from others between them. A film without plate may lose its stability in many motions
        at once, and with it the way to that point: then the nearest one that is found.
        """
        motion = difference(self.model, after.state, before.state)
        end = product(self.model, before.direction, motion)
        points: dict[float, PathPoint] = {0.0: before, end: after}
        values: dict[float, float] = {}

        def passed(step: float) -> bool:
            return values.get(step, 0.0) * values.get(0.0, 0.0) < 0

        def at(step: float) -> float:
            if step not in points:
                # Beyond that place the film may be on another branch, with no way back from it.
                nearest = sorted(points, key=lambda near: (passed(near), abs(near - step)))
                points[step] = self._from_first(before, step, [points[near] for near in nearest])
            if not of_state:
                points[step] = self._renewed(points[step])
            values[step] = value(points[step])
            points[step].solution.release()
            return values[step]

        def between(low: float, high: float) -> float | None:
            return root_between(at, low, high, xtol=1e-7, rtol=1e-6)

        root = between(0.0, end)
        if root is not None:
            return self._renewed(points[root])
        around = self._closer(at, points, value)
        if around is None:
            return None
        root = between(*around)
        if root is None and not self.model.specimen.plate:
            root = min(points, key=lambda step: abs(value(points[step])))
        return None if root is None else self._renewed(points[root])

    def _from_first(self, before: PathPoint, step: float, starts: Sequence[PathPoint]) -> PathPoint:
        """The point a length from another, from the first of some starts that leads to it.

        Where Newton's method goes astray from one, it may not from the other side.
        """
        for start in starts:
            point = self.at(before, step, start)
            if point is not None:
                return point
        raise NoValueHere

    def _closer(self, at: Callable[[float], float], points: Mapping[float, PathPoint],
                value: Callable[[PathPoint], float]) -> tuple[float, float] | None:
        """Where a function changes its sign between two of the points, others found between them.

        Each is a start from which Newton's method may find what is nearer. None without a change.
        """
        sense = np.sign(value(points[0.0]))

        def around() -> tuple[float, float] | None:
            passed = {step for step, point in points.items() if sense * value(point) <= 0}
            return (max(points.keys() - passed), min(passed)) if passed else None

        for share in _SHARES:
            if (ends := around()) is None:
                return None
            with suppress(NoValueHere):
                at(ends[0] + share * (ends[1] - ends[0]))
        return around()

    def _renewed(self, point: PathPoint) -> PathPoint:
        """The point with its own tangent, if it has one: Newton's is too far off for limits."""
        return self._along(point.solution, point.direction) or point

    def _along(self, solution: Solution, direction: Parts) -> PathPoint | None:
        """An equilibrium as a point of the branch, which goes about in a direction there."""
        state = solution.state
        solution.release()
        tangent, _ = tangent_at(self.model, state, (self.load,),
                                (arc_length(state, direction, 0.0),), self.subspace)
        return None if tangent is None else self._point(replace(solution, tangent=tangent))

    def _first(self, start: State, sense: int) -> PathPoint | None:
        at_loads = newton(self.model, start, settings=self.newton, subspace=self.subspace)
        if not at_loads.converged or at_loads.tangent is None:
            return None
        film, plate = self.model.by_load(at_loads.state, self.load)
        motion, _ = at_loads.tangent.correct((sense * film, sense * plate), [])
        if not length(self.model, motion):  # a load that moves nothing
            at_loads.release()
            return None
        # Not solved again with the load free: the first point has the start's load to the last bit.
        return self._along(at_loads, self._unit(motion)[0])

    def _solved(self, guess: State, arc: Constraint) -> PathPoint | None:
        solution = newton(self.model, guess, (self.load,), (arc,), self.newton, self.subspace)
        return self._point(solution) if solution.converged else None

    def _point(self, solution: Solution) -> PathPoint:
        assert solution.tangent is not None
        motion, loads = solution.tangent.along()
        direction, scale = self._unit(motion)
        return PathPoint(solution, direction, loads[self.load] / scale)

    def _unit(self, motion: Parts) -> tuple[Parts, float]:
        scale = length(self.model, motion)
        return (motion[0] / scale, motion[1] / scale), scale
