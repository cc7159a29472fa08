"""Load ramp in adaptive steps, and the reason why it ends if not at an equilibrium."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from tympan.fem.equilibrium.arc_segment import PathPoint
from tympan.fem.equilibrium.constraints import difference, length
from tympan.fem.equilibrium.newton import EXHAUSTED, LIGHTER, STRAINED, Solution, newton
from tympan.fem.equilibrium.path_following import PathSettings, follow_branch
from tympan.fem.equilibrium.subspace import FULL
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load, State
from tympan.fem.roots import root_between

#: Largest distance from the prediction of a step, as a share of its motion. Up to a limit point the
#: distance is at most half: the motion is at most twice the prediction.
_SURPRISE = 0.6
#: Least share of a step's motion that the rate at its end must explain. It explains 1/3 for a film
#: that stiffens with the cube of its motion.
_EXPLAINED = 0.2
#: Motion, relative to the frame, below which these tests are omitted: such a step passes no limit
#: point that matters. Set by trial.
UNNOTICED = 1e-4

#: Smallest damping factor of Newton's method within a step. A step that needs a smaller one is
#: halved. Set by trial.
_DAMPED = 0.05
#: Longest correction within a step, relative to the frame: no film moves so far in one step.
_ASTRAY = 1.0

#: Largest share of the work that residual tension may do in a film slack when mounted. Up to this
#: share it changes the deflection by some 1 %. Beyond it, residual tension soon holds the plate
#: alone.
_RESIDUAL_SHARE = 0.1

Status = Literal["equilibrium", "no_equilibrium", "not_converged"]

#: Function of a state that is positive until an event happens.
StateMargin = Callable[[State], float]

#: Message for a film that is slack when mounted and still slack under the named loads.
SLACK = ("the film is slack when mounted, and still {}: it has no definite shape; prestretch or "
         "load it more")
_UNFOLLOWED = "the path could not be followed to the load: the film strains without bound"

#: Step, relative to the load, within which a film that would be stiff even if wrinkled does not
#: thin.
_SMALL_STEP = 0.5

#: Accuracy of the load at which a film begins to thin without bound, relative to the step that
#: contains it. It is far below the discretisation error of a mesh.
_SHARP = 1e-6
#: Accuracy of a prediction of that load, relative to the step. The step ends twice this distance
#: beyond the prediction, so that its end is on the other side.
_NEAR = 1e-3
#: Largest number of equilibria in the search for that load. Every sixth one halves the interval,
#: which makes some ten halvings.
_CLOSING = 60

#: Largest number of iterations from beyond that load. If more are needed, the search starts from
#: before it.
_SOON = 5


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of a search for an equilibrium.

    ``solution`` is the equilibrium, or the last one before the ramp ended. With status
    "no_equilibrium" the film has no equilibrium at the target. ``limit`` is then the largest U²
    [V²], force [N] or pressure [Pa] that has one on this path, and ``limited`` names which load.
    ``critical`` is the point of the branch at the limit. The load has a maximum there, or the film
    ``thins``: wrinkled, it has no stable width. ``snapped``: a mechanism made the plate jump on the
    way.
    """

    status: Status
    solution: Solution
    advice: str = ""
    limit: float | None = None
    limited: Load | None = None
    critical: PathPoint | None = None
    thins: bool = False
    snapped: bool = False

    @property
    def state(self) -> State:
        """State of the solution."""
        return self.solution.state


def in_words(value: float, load: Load) -> str:
    """Format a load for people: force [N], pressure [Pa], or U² [V²] as its voltage."""
    if load == "voltage":
        return f"{np.sqrt(max(value, 0.0)) / 1e3:.4g} kV across it"
    unit = "Pa of gas pressure" if load == "pressure" else "N on the plate"
    return f"{value:.4g} {unit}"


def without_mechanism(model: Model, deflection: float) -> str:
    """Write a message if a mechanism has no force at a deflection [m]; else an empty one."""
    laws = " and ".join(f'"{law}"' for law in model.loading.ended(deflection))
    return laws and (f"the mechanism {laws} of the rig ends on the way: it has no force at about "
                     f"{1e3 * deflection:.3g} mm, and nothing is extrapolated")


def still_slack(model: Model, state: State) -> bool:
    """Check whether a film slack when mounted still is: residual tension holds its plate."""
    return model.slack_when_mounted and model.residual_share(state) > _RESIDUAL_SHARE


@dataclass(frozen=True)
class LoadRamp:
    """Change of one load to a target; the other loads stay constant.

    ``ends``: whether to search for the limit if the target has no equilibrium.
    """

    model: Model
    load: Load
    target: float
    settings: PathSettings = field(default_factory=PathSettings)
    ends: bool = True

    def run(self, start: Solution) -> Outcome:
        """Increment the load while Newton converges to stable states.

        Then continue by arc length.
        """
        origin = start.state.load(self.load)
        if self.target == origin:
            return Outcome("equilibrium", start)
        if start.thinning_margin(self.model) < 0:
            return self._thins(start, self._point(start))
        solution, done, step = start, 0.0, self.settings.first
        before = abs(origin / (self.target - origin))
        while done < 1:
            value = self._short_of_thinning(
                solution, origin + min(1.0, done + step) * (self.target - origin))
            share = (value - origin) / (self.target - origin)
            trial, expected = self._step(solution, value)
            if expected:
                if self._slackened(start, trial):
                    return Outcome("not_converged", solution, SLACK.format("under its loads"))
                if trial.thinning_margin(self.model) >= 0:
                    solution, done, step = trial, share, 2 * step
                    continue
                if not self.ends:
                    return Outcome("no_equilibrium", solution)
                if (outcome := self._thinned(solution, trial)) is not None:
                    return outcome
            trial.release()
            if self.settings.exhausted:
                return self._given_up(solution)
            if (step := (share - done) / 2) < max(self.settings.handover * (before + done), 1e-12):
                if not self.ends:
                    return Outcome("no_equilibrium", solution)
                outcome = self._by_arc_length(start, solution)
                if outcome.advice == _UNFOLLOWED and trial.advice.startswith(STRAINED):
                    return replace(outcome, advice=f"{STRAINED} before the {self._word} is reached")
                return outcome
        return Outcome("equilibrium", solution)

    def _given_up(self, last: Solution) -> Outcome:
        """Report that the search has used all its work."""
        reached, target = (in_words(value, self.load)
                           for value in (last.state.load(self.load), self.target))
        return Outcome("not_converged", last, f"{EXHAUSTED}: it was given up at {reached} of "
                       f"{target}; {LIGHTER}")

    def natural(self, start: Solution) -> Solution | None:
        """Solve at the target in one step; None if that fails, or if the film thins or is slack."""
        if (self.target == start.state.load(self.load)
                or self._short_of_thinning(start, self.target) != self.target):
            return None
        trial, expected = self._step(start, self.target)
        if not expected or self._slackened(start, trial) or trial.thinning_margin(self.model) < 0:
            return None
        return trial

    def _slackened(self, start: Solution, now: Solution) -> bool:
        """Check whether a film has gone slack while its load decreased.

        A slack film may become taut again while its load increases.
        """
        before, after = (solution.state.load(self.load) for solution in (start, now))
        return abs(after) < abs(before) and still_slack(self.model, now.state)

    def _short_of_thinning(self, start: Solution, value: float) -> float:
        """Limit a load to where the film is predicted not to thin."""
        if not self.model.wrinkles:
            return value
        origin = start.state.load(self.load)
        far = start.thinning_margin(self.model) == np.inf
        if far and abs(value - origin) < _SMALL_STEP * abs(value):
            return value
        reached = self._foretold(start, self.model.thinning_margin, origin, value, _NEAR)
        return value if reached is None else reached + 2 * _NEAR * (value - origin)

    def _foretold(self, start: Solution, margin: StateMargin, low: float, high: float, sharp: float
                  ) -> float | None:
        """Predict the load between two at which a margin becomes zero; None if it does not.

        The prediction uses the rate at the start. ``sharp``: accuracy, relative to the difference
        of the loads.
        """
        def at(load: float) -> float:
            return margin(start.predicted(self.model, self.load, load))

        with np.errstate(all="ignore"):
            most = -at(high)
            if not most > 0 or at(low) < 0:
                return None
            return root_between(lambda load: min(at(load), most), low, high,
                                xtol=sharp * abs(high - low))

    def _at(self, start: Solution, value: float, iterations: int | None = None
            ) -> tuple[Solution, State]:
        """Solve for the equilibrium at another value of the load; return also the prediction."""
        guess, settings = start.predicted(self.model, self.load, value), self.settings.newton
        start.release()
        limited = replace(settings, damping=max(settings.damping, _DAMPED), longest=_ASTRAY,
                          iterations=iterations or settings.iterations)
        return newton(self.model, guess, settings=limited), guess

    def _step(self, start: Solution, value: float) -> tuple[Solution, bool]:
        """Solve at another value of the load; check that the result is stable and as predicted."""
        trial, guess = self._at(start, value)
        return trial, trial.converged and trial.stable and self._foreseen(start, guess, trial)

    def _thinned(self, before: Solution, after: Solution) -> Outcome | None:
        """Find where the film begins to thin between two equilibria; None if unclear."""
        ends = self._around(before, after, self.model.thinning_margin)
        return ends and self._thins(ends[0], self._point(ends[1]))

    def _around(self, before: Solution, after: Solution, margin: StateMargin
                ) -> tuple[Solution, Solution] | None:
        """Find the last equilibrium with a positive margin, and the one closest to zero margin.

        Each iteration goes from the closest equilibrium so far to the load where the rate there
        predicts a zero margin. It ends when that load is no further away than the accuracy. Every
        sixth iteration halves the interval, in case the predictions do not converge. If Newton's
        method fails from the closest equilibrium, it starts from the last one with a positive
        margin. None if that fails, too.
        """
        ends, margins = [before, after], [margin(before.state), margin(after.state)]
        strayed: Solution | None = None
        after.release()
        sharp = _SHARP * abs(before.state.load(self.load) - after.state.load(self.load))
        for count in range(1, _CLOSING + 1):
            low, high = (end.state.load(self.load) for end in ends)
            close = ends[abs(margins[1]) < abs(margins[0])]
            load = self._foretold(close, margin, low, high, _SHARP) if count % 6 else None
            if load is None:
                load = (low + high) / 2
            if abs(load - close.state.load(self.load)) <= sharp:
                break
            beyond = close not in (ends[0], strayed)
            solution = self._at(close if beyond else ends[0], load, _SOON if beyond else None)[0]
            solution.release()
            if beyond and not solution.converged:
                strayed = close
                solution = self._at(ends[0], load)[0]
                solution.release()
            if not solution.converged:
                return None
            remaining = margin(solution.state)
            ends[remaining < 0], margins[remaining < 0] = solution, remaining
        return ends[0], close

    def _tense(self, start: Solution, reached: Solution) -> Solution:
        """Find the equilibrium from which a branch is continued.

        This is ``reached``. A film that bears compression is continued from where it loses tension:
        smooth motions start there, since beyond it the soft waves depend on each step that was
        made.
        """
        tension = self.model.least_tension
        if self.model.wrinkles or tension(start.state) < 0 or tension(reached.state) > 0:
            return reached
        ends = self._around(start, reached, tension)
        return reached if ends is None else ends[1]

    def _point(self, solution: Solution) -> PathPoint | None:
        """Convert an equilibrium to a point of its branch; None if the load moves nothing."""
        film, plate = solution.rate(self.model, self.load)
        solution.release()
        scale = length(self.model, (film, plate))
        if not scale:
            return None
        scale *= np.sign(self.target - solution.state.load(self.load)) or 1.0
        return PathPoint(solution, (film / scale, plate / scale), 1 / scale)

    def _foreseen(self, last: Solution, guess: State, trial: Solution) -> bool:
        """Check whether a step ended near its prediction, so that it passed no limit point.

        Up to a limit point the motion grows like a square root, to at most twice the prediction,
        and ever faster. A plate that jumped to another branch moved further than predicted from
        either end.
        """
        back = trial.predicted(self.model, self.load, last.state.load(self.load))
        missed, gone, explained = (length(self.model, difference(self.model, trial.state, state))
                                   for state in (guess, last.state, back))
        return (missed <= _SURPRISE * gone + UNNOTICED
                and explained >= _EXPLAINED * gone - UNNOTICED)

    def _by_arc_length(self, origin: Solution, reached: Solution) -> Outcome:
        """Follow the branch from the last equilibrium to the target, a limit or thinning."""
        load, target, settings = self.load, self.target, self.settings
        start = self._tense(origin, reached)
        sense = 1 if target >= start.state.load(load) else -1
        stable = reached
        start.release()
        points = follow_branch(self.model, start.state, load, settings, sense)
        for (_, before), (branch, after) in pairwise(points):
            if self._slackened(start, after.solution):
                return Outcome("not_converged", stable, SLACK.format("under its loads"))
            if self._margin(after) < 0:
                thin = branch.where(before, after, self._margin, "state")
                if thin is None or sense * thin.rate < 0:
                    break
                if sense * thin.state.load(load) < sense * target:
                    return self._thins(stable, thin)
                after = thin
            if sense * after.rate < 0:
                critical = branch.where(before, after, lambda point: point.rate, "direction")
                if critical is None:
                    break
                if sense * critical.state.load(load) < sense * target:
                    return self._ended(stable, critical, "pull-in")
                after = critical  # the target is before this point or before the next one
            if sense * after.state.load(load) >= sense * target:
                return self._landed(stable, branch.where(
                    before, after, lambda point: point.state.load(load) - target, "state"))
            # Where the film alone loses its stiffness, the plate's stiffness has a pole: its sign
            # means nothing there.
            if not after.solution.stable and after.solution.wrinkling == 0:
                return self._ended(stable, after, "the film loses its stability")
            if abs(self.model.deflection(after.state)) > settings.reach * self.model.high:
                break
            if branch.subspace is FULL:
                stable = after.solution
        if settings.exhausted:
            return self._given_up(stable)
        return self._unfollowed(stable)

    def _margin(self, point: PathPoint) -> float:
        return min(self.model.thinning_margin(point.state), 1e12)

    def _landed(self, stable: Solution, reached: PathPoint | None) -> Outcome:
        """Solve for the equilibrium at the target, from the branch's point there."""
        if reached is not None:
            reached.solution.release()
            solution = newton(self.model, reached.state.under(**{self.load: self.target}),
                              settings=self.settings.newton)
            if solution.converged and solution.stable:
                return Outcome("equilibrium", solution)
            stable = replace(stable, advice=solution.advice)
        return self._unfollowed(stable)

    def _unfollowed(self, last: Solution) -> Outcome:
        """Report why the film or a mechanism cannot be followed to the target."""
        ahead = last.predicted(self.model, self.load, self.target)
        last.release()
        beyond = without_mechanism(self.model, self.model.deflection(ahead))
        return Outcome("not_converged", last, beyond or _UNFOLLOWED)

    def _thins(self, last: Solution, critical: PathPoint | None) -> Outcome:
        ended = self._ended(last, critical, "the film thins without bound")
        return replace(ended, thins=True)

    def _ended(self, last: Solution, critical: PathPoint | None, words: str) -> Outcome:
        state = last.state if critical is None else critical.state
        return Outcome("no_equilibrium", last, f"{words} before the {self._word} is reached",
                       state.load(self.load), self.load, critical)

    @property
    def _word(self) -> str:
        return "load" if self.load == "force" else self.load
