"""Branches of equilibria followed by their arc length, through limit points and beyond."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from tympan.fem.equilibrium.constraints import Constraint, arc_length, difference, length, product
from tympan.fem.equilibrium.newton import NewtonSettings, Solution, moved, newton, tangent_at
from tympan.fem.equilibrium.subspace import FULL, Subspace
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, State
from tympan.fem.roots import NoValueHere, root_between

#: Error of the place where a function vanishes, relative to the frame: far below a mesh's own.
_SHARP = 1e-7

#: The same, relative to that place's distance from the point before: loads are told to 1e-3.
_SHARP_SHARE = 1e-6

#: How many times as far apart as their steps two neighbours on one branch may be. A turn of the
#: branch makes it little more than 1; on two branches it grows without bound as steps get shorter.
_APART = 30.0

#: Where between two points, in turn, others are tried that are nearer to what is looked for.
_SHARES = (0.5, 0.25, 0.75, 0.5, 0.25, 0.75, 0.5)

#: Halvings of a step to the last point before a fold: its load is told to 1e-4 of a step's.
_HALVINGS = 14


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
            longest = self.model.loading.step(self.model.deflection(point.state))
            step = min(step, max(longest / self.model.size, self.arc.shortest))
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
        further = step - product(self.model, point.direction, self._motion(point, near))
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
        at once, and with it the way to that point: then the nearest one that is found. Where the
        sign changes since the two are on different branches, the last point before that is given,
        at which the function does not vanish.
        """
        search = _Between(self, before, value, of_state)
        end = product(self.model, before.direction, self._motion(before, after))
        search.put(0.0, before)
        search.put(end, after)
        root = search.root(0.0, end)
        if root is None:
            around = search.closer()
            if around is None:
                return None
            root = search.root(*around)
        if root is None:
            film_alone = self.model.specimen.plate is None
            return self._renewed(search.least() if film_alone else search.points[search.last()])
        return self._renewed(search.points[search.on_branch(root)])

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

    def _motion(self, start: PathPoint, end: PathPoint) -> Parts:
        return difference(self.model, end.state, start.state)

    def _unit(self, motion: Parts) -> tuple[Parts, float]:
        scale = length(self.model, motion)
        return (motion[0] / scale, motion[1] / scale), scale


@dataclass(frozen=True, eq=False)
class _Between:
    """Points tried beside one of a branch, by their step from it, where a function vanishes."""

    branch: Branch
    before: PathPoint
    value: Callable[[PathPoint], float]
    of_state: bool
    points: dict[float, PathPoint] = field(default_factory=dict)
    values: dict[float, float] = field(default_factory=dict)

    def put(self, step: float, point: PathPoint) -> None:
        """Keep a point with its value, and with its own tangent if the value looks at that."""
        point = point if self.of_state else self.branch._renewed(point)
        self.points[step], self.values[step] = point, self.value(point)
        point.solution.release()

    def at(self, step: float) -> float:
        """The value at a step; :class:`NoValueHere` if no point is found there.

        Where Newton's method goes astray from one start, it may not from another. Those before the
        place come first: beyond it the film may be on another branch, with no way back.
        """
        if step not in self.points:
            starts = sorted(self.points, key=lambda near: (self.passed(near), abs(near - step)))
            found = (self.branch.at(self.before, step, self.points[near]) for near in starts)
            point = next((point for point in found if point is not None), None)
            if point is None:
                raise NoValueHere
            self.put(step, point)
        return self.values[step]

    def passed(self, step: float) -> bool:
        """Whether a point is beyond the place: its value has not the sign of the first."""
        return step != 0 and not self.values[step] * self.values[0.0] > 0

    def around(self) -> tuple[float, float] | None:
        """The last step before the place and the first beyond it; None without change of sign."""
        passed = {step for step in self.points if self.passed(step)}
        return (max(self.points.keys() - passed), min(passed)) if passed else None

    def root(self, low: float, high: float) -> float | None:
        """The step between two at which the function vanishes, if it has values on the way."""
        return root_between(self.at, low, high, xtol=_SHARP, rtol=_SHARP_SHARE)

    def closer(self) -> tuple[float, float] | None:
        """The steps around the place, once others are tried between them that are nearer to it.

        Each is a start from which Newton's method may find the next.
        """
        for share in _SHARES:
            if (ends := self.around()) is None:
                return None
            with suppress(NoValueHere):
                self.at(ends[0] + share * (ends[1] - ends[0]))
        return self.around()

    def last(self) -> float:
        """The last step before the place that is on the branch of the first point, by halving.

        A short fold ends the branch where the film gives way in one place: beyond it no point is
        found, or one of another branch.
        """
        low, high = 0.0, min(step for step in self.points if self.passed(step))
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            point = self.branch.at(self.before, middle, self.points[low])
            if point is not None:
                self.put(middle, point)
            passed = middle not in self.points or self.passed(middle)
            if passed or self._strayed(low, middle):
                high = middle
            else:
                low = middle
        return low

    def _strayed(self, low: float, high: float) -> bool:
        """Whether the points of two steps are further apart than those of one branch."""
        apart = length(self.branch.model,
                       self.branch._motion(self.points[low], self.points[high]))
        return apart > _APART * (high - low + _SHARP)

    def least(self) -> PathPoint:
        """The point of the smallest value."""
        return self.points[min(self.values, key=lambda step: abs(self.values[step]))]

    def on_branch(self, root: float) -> float:
        """The step of the place; the last before it if those around it are on different branches.

        Points of one branch are no further apart than their steps are.
        """
        ends = self.around()
        if ends is None:
            return root
        low, high = ends
        return low if self._strayed(low, high) else root
