"""Continuation of branches of equilibria by arc length, through and beyond limit points."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from tympan.fem.equilibrium.arc_segment import PathPoint, Segment
from tympan.fem.equilibrium.constraints import Constraint, arc_length, difference, length, product
from tympan.fem.equilibrium.newton import (
    NewtonSettings,
    Solution,
    moved,
    newton,
    simplified_newton,
    tangent_at,
)
from tympan.fem.equilibrium.subspace import FULL, Subspace
from tympan.fem.membrane.model import Model, Parts
from tympan.fem.membrane.state import Load, Needs, State
from tympan.fem.roots import NoValueHere, root_between

#: Accuracy of the point where a function vanishes, relative to the frame. A stiff film hardly
#: moves: where it is 1e-7 from a point, its voltage may be 1e-3 off.
_SHARP = 1e-9

#: Accuracy of that point, relative to its distance from the previous one. Loads are printed with a
#: relative accuracy of 1e-3.
_SHARP_SHARE = 1e-6

#: Largest distance of two neighbouring points on one branch, relative to their difference in arc
#: length. A curved branch makes this ratio little more than 1. For points on two different branches
#: the ratio grows without bound as steps get shorter.
_APART = 30.0

#: Largest ratio of a step to the one before it.
_LONGER = 2.0
#: Least ratio of a step to the one before it, unless the step itself fails.
_SHORTER = 0.3
#: Turn that a step aims at, over the largest one.
_TURNED = 0.6
#: Largest number of iterations, and smallest damping factor, of a taut film's step that is longer
#: than the usual first one. A film that wrinkles needs more iterations and damping.
_FEW = 5
_DAMPED = 0.3
#: Accuracy of a predicted loss of tension, relative to the step.
_SOON = 1e-2
#: Least share of the step of a wrinkled film that is left: its margin jumps, so that predictions
#: may be too near.
_LEAST = 0.07
#: Largest margin in a search for a root [Pa]: it is infinite where the film is firm.
_FAR = 1e12
#: Distance beyond a predicted loss of tension at which a step ends, relative to the step: the point
#: is on the other side of it then.
_PAST = 0.05

#: Distance of a tangent's state from the equilibrium, relative to the frame, that changes nothing.
_STILL = 1e-9
#: Error of a rate by the tangent of another state, over the change of the rate along the step,
#: relative to the other state's distance over the step. A margin for curved branches.
_OFF = 10.0

#: Largest number of predictions of a root, each of which is corrected.
_CLOSING = 8
#: Largest distance of a corrected point from its prediction, relative to that from the point
#: before: one that is further away may be on another branch.
_ASIDE = 0.01
#: Accuracy of the first prediction, which is corrected, over the distance of the two points.
_ROUGH = 1e-4
#: Largest distance of a root by a secant, over the secant's interval: the function may jump.
_SECANT = 5.0
#: Interval of a secant, over the distance of the points around it.
_NEARBY = 1e-3
#: Ratio of the steps from a point in the search for a root near it.
_WIDER = 30.0

#: Positions between two points, as shares of the interval, at which further points are tried in
#: turn. These points are closer to the one that is searched.
_SHARES = (0.5, 0.25, 0.75, 0.5, 0.25, 0.75, 0.5)

#: Number of halvings of a step to find the last point before a fold. The load of that point is then
#: accurate to 1e-4 of the step's change of load.
_HALVINGS = 14


@dataclass(frozen=True)
class ArcSettings:
    """Settings of the steps along a branch; lengths are relative to the frame's half extent.

    ``first``, ``longest`` and ``shortest``: step lengths. ``loose``: the longest one of a film that
    has lost tension and wrinkles, whose margins jump. ``turn``: largest angle between the
    directions at both ends of a step [rad]. ``points``: largest number of points.
    """

    first: float = 5e-3
    longest: float = 0.05
    shortest: float = 5e-5
    loose: float = 0.015
    turn: float = 0.3
    points: int = 500


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
        before: PathPoint | None = None
        for _ in range(self.arc.points):
            if point is None:
                return
            yield point
            longest = self.model.loading.step(self.model.deflection(point.state))
            step = min(step, max(longest / self.model.size, self.arc.shortest))
            ahead = _Ahead(self, point, before)
            step = max(ahead.short(step, self.arc), self.arc.shortest)
            tried = step
            while step >= self.arc.shortest:
                following = ahead.solved(step)
                if following is not None:
                    cosine = product(self.model, point.direction, following.direction)
                    turn = float(np.arccos(np.clip(cosine, -1, 1)))
                    if turn <= self.arc.turn:
                        break
                step /= 2
            else:
                return
            longer = np.clip(_TURNED * self.arc.turn / max(turn, _STILL), _SHORTER, _LONGER)
            # A step as long as one that failed would fail again.
            longer = min(float(longer), 1.0) if step < tried else float(longer)
            step = min(step * longer, self.arc.longest)
            # Near a limit point only the point's own tangent gives the sign of the rate.
            off = _OFF * self._off(following.solution) / length(
                self.model, self.motion(point, following))
            beside = abs(following.rate) < off * abs(following.rate - point.rate)
            before, point = point, self.renewed(following) if beside else following

    def at(self, point: PathPoint, step: float, near: PathPoint | None = None,
           ) -> PathPoint | None:
        """Find the point at a distance along another point's direction; None if Newton fails.

        Newton's method starts from a point ``near`` it; the default is ``point`` itself.
        """
        near = near or point
        further = step - product(self.model, point.direction, self.motion(point, near))
        further /= product(self.model, point.direction, near.direction)
        guess = moved(self.model, near.state, near.direction, further,
                      {self.load: near.rate})
        point.solution.release()
        near.solution.release()
        return self.solved(guess, arc_length(point.state, point.direction, step))

    def between(self, before: PathPoint, after: PathPoint) -> Between:
        """Prepare searches between two successive points."""
        return Between(self, before, after)

    def where(self, before: PathPoint, after: PathPoint,
              value: Callable[[PathPoint], float], needs: Needs = "tangent") -> PathPoint | None:
        """Find the point between two others where a function vanishes, as :meth:`Between.where`."""
        return self.between(before, after).where(value, needs)

    def renewed(self, point: PathPoint) -> PathPoint:
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
        tangent = at_loads.tangent
        if not at_loads.converged or tangent is None:
            return None
        if tangent.state is not start and self._off(at_loads) > _STILL:
            at_loads.release()
            tangent, _ = tangent_at(self.model, at_loads.state, subspace=self.subspace)
            if tangent is None:
                return None
        film, plate = self.model.by_load(at_loads.state, self.load)
        motion, _ = tangent.correct((sense * film, sense * plate), [])
        if not length(self.model, motion):  # a load that moves nothing
            tangent.release()
            return None
        # The first point is not solved again with the load free, so its load equals the start's
        # load exactly.
        direction = self._unit(motion)[0]
        equation = arc_length(at_loads.state, direction, 0.0)(self.model, at_loads.state)
        try:
            bordered = tangent.bordered((self.load,), (equation,))
            return self._point(replace(at_loads, tangent=bordered))
        except np.linalg.LinAlgError:
            return None

    def _off(self, solution: Solution) -> float:
        """Measure how far an equilibrium is from the state of its tangent.

        The distance is relative to the frame, or to the load where the load is further off.
        """
        assert solution.tangent is not None
        state, start = solution.state, solution.tangent.state
        load, begun = state.load(self.load), start.load(self.load)
        return max(length(self.model, difference(self.model, state, start)),
                   abs(load - begun) / (abs(load) or 1.0))

    def solved(self, guess: State, arc: Constraint) -> PathPoint | None:
        solution = newton(self.model, guess, (self.load,), (arc,), self.newton, self.subspace)
        return self._point(solution) if solution.converged else None

    def _point(self, solution: Solution) -> PathPoint:
        assert solution.tangent is not None
        motion, loads = solution.tangent.along()
        direction, scale = self._unit(motion)
        return PathPoint(solution, direction, loads[self.load] / scale)

    def motion(self, start: PathPoint, end: PathPoint) -> Parts:
        return difference(self.model, end.state, start.state)

    def _unit(self, motion: Parts) -> tuple[Parts, float]:
        scale = length(self.model, motion)
        return (motion[0] / scale, motion[1] / scale), scale


@dataclass(frozen=True, eq=False)
class _Ahead:
    """A branch beyond a point, extrapolated from the point before it."""

    branch: Branch
    point: PathPoint
    before: PathPoint | None

    @cached_property
    def _segment(self) -> Segment:
        branch = self.branch
        if self.before is None:
            return Segment(branch.model, branch.load, self.point)
        return Segment(branch.model, branch.load, self.before, self.point)

    def at(self, step: float) -> PathPoint:
        """Predict the point at a step along the direction at the last point."""
        if self.before is None:
            return self._segment.at(step)
        cosine = product(self.branch.model, self.before.direction, self.point.direction)
        return self._segment.at(self._segment.span + step * cosine)

    @cached_property
    def taut(self) -> bool:
        """Whether the film has its tension at the last point."""
        model = self.branch.model
        with np.errstate(all="ignore"):
            return not model.wrinkles or model.least_tension(self.point.state) > 0

    def short(self, step: float, arc: ArcSettings) -> float:
        """Shorten a step to end a little beyond where the film is predicted to lose its tension.

        A film that has lost it takes the short steps of a wrinkled one, from the first one on, and
        ends one a little beyond where it is predicted to thin.
        """
        model, least = self.branch.model, min(step, ArcSettings.first)
        if not model.wrinkles:
            return step
        margin, ahead = model.least_tension, self
        with np.errstate(all="ignore"):
            if not self.taut:
                if self.before is not None and margin(self.before.state) > 0:
                    step = min(step, arc.first, ArcSettings.first)
                    ahead = replace(self, before=None)  # no cubic leads across the loss of tension
                step = min(step, arc.loose)
                margin, least = model.thinning_margin, _LEAST * step
            root = root_between(lambda at: min(margin(ahead.at(at).state), _FAR), 0.0, step,
                                xtol=_SOON * step)
        return step if root is None else min(step, max((1 + _PAST) * root, least))

    def solved(self, step: float) -> PathPoint | None:
        """Find the point at a step; None if Newton's method fails from the prediction.

        A long step of a taut film that Newton's method finds hard is better halved.
        """
        self.point.solution.release()
        branch, arc = self.branch, arc_length(self.point.state, self.point.direction, step)
        if self.taut and step > ArcSettings.first:
            newton = branch.newton
            branch = replace(branch, newton=replace(
                newton, iterations=min(newton.iterations, _FEW),
                damping=max(newton.damping, _DAMPED)))
        return branch.solved(self.at(step).state, arc)


@dataclass(frozen=True, eq=False)
class Between:
    """A branch between two successive points, for searches that share the points that they solve.

    ``found``: equilibria on the way by their step from ``before``, without tangents of their own.
    """

    branch: Branch
    before: PathPoint
    after: PathPoint
    found: dict[float, PathPoint] = field(default_factory=dict)
    _renewed: dict[float, PathPoint] = field(default_factory=dict)

    def where(self, value: Callable[[PathPoint], float], needs: Needs = "tangent"
              ) -> PathPoint | None:
        """Find the point where a function vanishes; None without sign change.

        If the function is the rate, the result is a limit point and its direction is the critical
        mode. ``needs``: what the function needs of a point. If Newton's method fails from both
        points, it starts from further points between them.

        A film without a plate may lose its stability in many motions at once. Newton's method may
        then fail near the point, and the nearest point found is returned. If the sign changes only
        because the two points are on different branches, the last point before the change is
        returned. The function does not vanish there.
        """
        if needs != "tangent" and (step := self._predicted(value, needs)) is not None:
            if step not in self._renewed:
                # Its own direction makes later cubics that end here accurate.
                self._renewed[step] = self.found[step] = self.branch.renewed(self.found[step])
            return self._renewed[step]
        return _Search(self.branch, self.before, value, needs == "state").where(self.after)

    def _predicted(self, value: Callable[[PathPoint], float], needs: Needs) -> float | None:
        """Find its step by cubics between the points around it, each prediction solved.

        The search ends where the next prediction is next to the last one. None if that is not the
        case soon.
        """
        ends = {0.0: self.before, self.step(self.after): self.after, **self.found}
        values = {step: value(point) for step, point in ends.items()}
        begun = values[0.0]
        last: float | None = None
        for _ in range(_CLOSING):
            passed = [step for step in ends if step and values[step] * begun <= 0]
            if not passed:
                return None
            high = min(passed)
            low = max(step for step in ends if step < high)
            near = min((low, high), key=lambda step: abs(values[step])) if last is None else last
            following = self._root(ends[low], ends[high], value, near == high,
                                   near=last is not None or bool(self.found))
            if following is None:
                return None
            last = self.step(following)
            close = min(self.found, key=lambda step: abs(step - last), default=np.inf)
            if abs(close - last) <= _SHARP + _SHARP_SHARE * max(ends):
                return close
            if (point := self._solved(following, last, needs)) is None:
                return None
            self.found[last] = ends[last] = point
            values[last] = value(point)
        return None

    def beside(self, point: PathPoint, aside: float) -> tuple[PathPoint, PathPoint]:
        """Predict the points at a distance on both sides of one; the ends where they are nearer."""
        step, whole = self.step(point), self.step(self.after)
        model, load = self.branch.model, self.branch.load
        first = (self.before if step <= aside else
                 Segment(model, load, self.before, point).at(step - aside))
        last = (self.after if whole - step <= aside else
                Segment(model, load, point, self.after).at(aside))
        return first, last

    def step(self, point: PathPoint) -> float:
        """Compute the step from ``before`` to a point."""
        return product(self.branch.model, self.before.direction,
                       self.branch.motion(self.before, point))

    def _root(self, low: PathPoint, high: PathPoint, value: Callable[[PathPoint], float],
              late: bool, near: bool) -> PathPoint | None:
        """Find the point at which a function vanishes on the cubic between two points.

        The search begins at the first point, or ``late`` at the second one. ``near``: it is near
        there; otherwise it is found roughly.
        """
        segment = Segment(self.branch.model, self.branch.load, low, high)
        sharp = _SHARP + _SHARP_SHARE * abs(segment.span)

        def at(step: float) -> float:
            return value(segment.at(step))

        start, end = (segment.span, 0.0) if late else (0.0, segment.span)
        if not near:
            root = root_between(at, start, end, xtol=max(sharp, _ROUGH * abs(segment.span)))
            return None if root is None else segment.at(root)
        begun, step = at(start), sharp
        if begun:
            aside = _NEARBY * (end - start)
            change = at(start + aside) - begun
            share = -begun / change if change else np.inf
            if 0 <= share <= _SECANT:
                return segment.at(start + share * aside)
        while step < abs(segment.span):
            place = start + np.sign(end - start) * step
            if at(place) * begun <= 0:
                break
            start, step = place, _WIDER * step
        else:
            place = end
        root = root_between(at, start, place, xtol=sharp)
        return None if root is None else segment.at(root)

    def _solved(self, guess: PathPoint, step: float, needs: Needs) -> PathPoint | None:
        """Solve for the point near a prediction; None if that is not near enough.

        If the state alone is needed, its direction may be that of the prediction. Otherwise it has
        a tangent of its own.
        """
        branch, model = self.branch, self.branch.model
        arc = arc_length(self.before.state, self.before.direction, step)
        solution = None if needs != "state" else simplified_newton(
            model, guess.state, (branch.load,), (arc,), branch.newton, self.after.solution.tangent)
        point = None if solution is None else replace(guess, solution=solution)
        if point is None:
            self.after.solution.release()
            point = branch.solved(guess.state, arc)
        if point is None:
            return None
        missed, gone = (length(model, difference(model, point.state, state))
                        for state in (guess.state, self.before.state))
        if missed > _ASIDE * gone:
            return None
        if needs == "direction":
            point = self._renewed[step] = branch.renewed(point)
        return point


@dataclass(frozen=True, eq=False)
class _Search:
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

    def where(self, after: PathPoint) -> PathPoint | None:
        """Find the point by solving for equilibria alone."""
        branch = self.branch
        end = product(branch.model, self.before.direction, branch.motion(self.before, after))
        self.put(0.0, self.before)
        self.put(end, after)
        root = self.root(0.0, end)
        if root is None:
            around = self.closer()
            if around is None:
                return None
            root = self.root(*around)
        if root is None:
            film_alone = branch.model.specimen.plate is None
            return branch.renewed(self.least() if film_alone else self.points[self.last()])
        return branch.renewed(self.points[self.on_branch(root)])

    def put(self, step: float, point: PathPoint) -> None:
        """Store a point and its value; renew its tangent if the value needs the tangent."""
        point = point if self.of_state else self.branch.renewed(point)
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
                       self.branch.motion(self.points[low], self.points[high]))
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
