"""Continuation of branches of equilibria by arc length, through and beyond limit points."""

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

#: Accuracy of the point where a function vanishes, relative to the frame. It is far below the
#: discretisation error of a mesh.
_SHARP = 1e-7

#: Accuracy of that point, relative to its distance from the previous one. Loads are printed with a
#: relative accuracy of 1e-3.
_SHARP_SHARE = 1e-6

#: Largest distance of two neighbouring points on one branch, relative to their difference in arc
#: length. A curved branch makes this ratio little more than 1. For points on two different branches
#: the ratio grows without bound as steps get shorter.
_APART = 30.0

#: Positions between two points, as shares of the interval, at which further points are tried in
#: turn. These points are closer to the one that is searched.
_SHARES = (0.5, 0.25, 0.75, 0.5, 0.25, 0.75, 0.5)

#: Number of halvings of a step to find the last point before a fold. The load of that point is then
#: accurate to 1e-4 of the step's change of load.
_HALVINGS = 14


@dataclass(frozen=True)
class ArcSettings:
    """Settings of the steps along a branch; lengths are relative to the frame's half extent.

    ``first``, ``longest`` and ``shortest``: step lengths. ``turn``: largest angle between the
    directions at both ends of a step [rad]. ``points``: largest number of points.
    """

    first: float = 5e-3
    longest: float = 0.05
    shortest: float = 5e-5
    turn: float = 0.3
    points: int = 500


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


@dataclass(frozen=True)
class Branch:
    """Equilibria of a model when one ``load`` is free and the others are given."""

    model: Model
    load: Load
    subspace: Subspace = FULL
    newton: NewtonSettings = field(default_factory=NewtonSettings)
    arc: ArcSettings = field(default_factory=ArcSettings)

    def points(self, start: State, sense: int = 1) -> Iterator[PathPoint]:
        """Yield points from an equilibrium on.

        At first the load increases (``sense`` 1) or decreases (−1). The iteration ends where no
        further step is possible, or at the largest number of points.
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
            # Near a limit point only the point's own tangent gives the sign of the rate.
            beside = abs(following.rate) < abs(following.rate - point.rate)
            point = self._renewed(following) if beside else following

    def at(self, point: PathPoint, step: float, near: PathPoint | None = None,
           ) -> PathPoint | None:
        """Find the point at a distance along another point's direction; None if Newton fails.

        Newton's method starts from a point ``near`` it; the default is ``point`` itself.
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
        """Find the point between two others where a function vanishes; None without sign change.

        If the function is the rate, the result is a limit point and its direction is the critical
        mode. A function ``of_state`` needs no tangent. If Newton's method fails from both points,
        it starts from further points between them.

        A film without a plate may lose its stability in many motions at once. Newton's method may
        then fail near the point, and the nearest point found is returned. If the sign changes only
        because the two points are on different branches, the last point before the change is
        returned. The function does not vanish there.
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
        """Compute the point's own tangent if possible: Newton's is too inaccurate at limits."""
        return self._along(point.solution, point.direction) or point

    def _along(self, solution: Solution, direction: Parts) -> PathPoint | None:
        """Convert an equilibrium to a point of the branch, given its approximate direction."""
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
        # The first point is not solved again with the load free, so its load equals the start's
        # load exactly.
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
    """Search for the point on a branch where a function vanishes.

    ``points`` and ``values`` contain the points tried so far and their values, by their step from
    ``before``.
    """

    branch: Branch
    before: PathPoint
    value: Callable[[PathPoint], float]
    of_state: bool
    points: dict[float, PathPoint] = field(default_factory=dict)
    values: dict[float, float] = field(default_factory=dict)

    def put(self, step: float, point: PathPoint) -> None:
        """Store a point and its value; renew its tangent if the value needs the tangent."""
        point = point if self.of_state else self.branch._renewed(point)
        self.points[step], self.values[step] = point, self.value(point)
        point.solution.release()

    def at(self, step: float) -> float:
        """Evaluate the function at a step; raise :class:`NoValueHere` if no point is found there.

        If Newton's method fails from one start, it may succeed from another. Starts before the sign
        change come first: beyond it the film may be on another branch, from which Newton's method
        does not return.
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
        """Check whether a point is beyond the sign change, that is, not of the first sign."""
        return step != 0 and not self.values[step] * self.values[0.0] > 0

    def around(self) -> tuple[float, float] | None:
        """Find the last step before the sign change and the first beyond it; None without one."""
        passed = {step for step in self.points if self.passed(step)}
        return (max(self.points.keys() - passed), min(passed)) if passed else None

    def root(self, low: float, high: float) -> float | None:
        """Find the step between two where the function vanishes; None if values are missing."""
        return root_between(self.at, low, high, xtol=_SHARP, rtol=_SHARP_SHARE)

    def closer(self) -> tuple[float, float] | None:
        """Try further points near the sign change and return the steps on both sides of it.

        Newton's method may find the next point from each of them. None without change of sign.
        """
        for share in _SHARES:
            if (ends := self.around()) is None:
                return None
            with suppress(NoValueHere):
                self.at(ends[0] + share * (ends[1] - ends[0]))
        return self.around()

    def last(self) -> float:
        """Find by halving the last step before the sign change on the first point's branch.

        A short fold ends the branch where the film loses its stiffness at one place. Beyond the
        fold no point is found, or a point of another branch.
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
        """Check whether two points are further apart than points of one branch."""
        apart = length(self.branch.model,
                       self.branch._motion(self.points[low], self.points[high]))
        return apart > _APART * (high - low + _SHARP)

    def least(self) -> PathPoint:
        """Find the point with the smallest absolute value."""
        return self.points[min(self.values, key=lambda step: abs(self.values[step]))]

    def on_branch(self, root: float) -> float:
        """Return the root, or the last step before it if its neighbours are on two branches.

        Points of one branch are about as far apart as their steps.
        """
        ends = self.around()
        if ends is None:
            return root
        low, high = ends
        return low if self._strayed(low, high) else root
