"""A step of a reduced film in time: in balance at all of its stages at once.

It is collocated at the stages of Radau's rule (:mod:`tympan.fem.transient.collocation`): film,
branches (:mod:`tympan.fem.film.staged_memory`) and plate meet their equations at all of them, and
Newton's method solves for all at once, by one tangent as long as that does. So a step is long, and
the points of all of its stages share each call of NumPy, which is what such a small film costs.
Where the loads jump the state at once after it is a stage of the step that begins there. The error
of a step is told from the highest coefficients of the polynomial that it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from scipy.linalg.lapack import dgetrf, dgetrs

from tympan.base.arrays import Array
from tympan.fem.film.memory import Memory
from tympan.fem.film.staged_memory import StagedFlow
from tympan.fem.membrane.biases import acting
from tympan.studies.films.driven_film import PHASES, DrivenFilm, ReducedMoment
from tympan.studies.films.film import ITERATIONS, FilmLoads, NoBalance, require_stable
from tympan.studies.films.sampling import by_voltages

#: How much the last two coefficients of q in a step count as its error. Where a signal swings
#: between stages the last may be nothing, so that the one before counts a little.
_TAILS = np.diag([1.0, 0.2])
#: Errors this many times too large after one correction are not corrected further: the step is
#: refused in any case.
_HOPELESS = 1.5

#: What may be left after the last correction, over a step's error: little, so that errors are those
#: of the rule. A tenth of it made times 2 % longer.
_LEFT = 0.03

#: A tangent serves again where corrections fall at least so fast.
_SLOW = 0.4


@dataclass(frozen=True, eq=False)
class CollocatedStep:
    """A step of a motion from a moment, to some ``times`` [s] of its stages."""

    motion: DrivenFilm
    moment: ReducedMoment
    piece: int
    times: Array
    jump: FilmLoads | None = None

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.times[-1]) - self.moment.time

    @cached_property
    def stages(self) -> Array:
        """Times [s] at which it is solved for: after a ``jump`` of the loads its start, too."""
        return self.times if self.jump is None else np.concatenate(([self.moment.time], self.times))

    @cached_property
    def squared(self) -> Array:
        """U² at the stages [V²]."""
        return np.asarray(self.motion.signal.within(self.piece, self.stages) ** 2)

    def solved(self, guess: Array) -> StepSolution:
        """Solve for q at the stages; not to the last digit where its error is far too large.

        Raises
        ------
        NoBalance
            Where there is none that is stable.
        """
        motion, q, size, tangent = self.motion, guess, np.inf, None
        film, flow, (constant, slope) = motion.tabulated, self.flow, self._drive
        every = np.arange(len(self.stages))
        for _ in range(ITERATIONS):
            fresh = tangent is None
            _, push, bend = acting(motion.biases, q[..., 0])
            if tangent is None:
                pull, stiffness, flow = film.staged_pull(q, self.squared, flow)
                stiffness[..., :, 0, :, 0] += slope
                stiffness[..., every, 0, every, 0] += bend
                tangent = factorised(stiffness)
            else:
                pull, flow = film.staged_forces(q, self.squared, flow)
            pull[..., 0] += q[..., 0] @ slope.T - constant + push
            change, before = tangent(pull), size
            size = float(np.maximum.reduce(np.abs(change), None)) / motion.gap
            if not size < 1:
                break
            q = q - change
            if self._settled(size, before, fresh):
                self._require_stable(stiffness)
                return StepSolution(self, q, flow, self._error(q))
            if fresh and (error := self._error(q)) > _HOPELESS * motion.error:
                return StepSolution(self, q, flow, error)
            if size > _SLOW * before:
                tangent = None
        raise NoBalance

    @cached_property
    def flow(self) -> StagedFlow:
        """Flow of the branches, before anything is known of C at the stages."""
        moment, motion, rule = self.moment, self.motion, self.motion.rule
        return StagedFlow.of(moment.memory, motion.tabulated.strain(moment.q), self.duration,
                             rule.matrix if self.jump is None else rule.from_start)

    def _settled(self, size: float, before: float, fresh: bool) -> bool:
        """Whether little is left after a correction, relative to the gap, and the one before it.

        Of a fresh tangent's its square, of others as large a share as they are of those before.
        """
        little = _LEFT * self.motion.closeness
        square = fresh and not self.moment.memory.flows
        return (square and size < self.motion.last) or size**2 < little * before < np.inf

    def _require_stable(self, stiffness: Array) -> None:
        # What inertia or a damper lead need not be stable by itself.
        led = int(self.motion.leads)
        for stage in (-1,) if self.jump is None else (0, -1):
            require_stable(stiffness[..., stage, led:, stage, led:])

    @cached_property
    def _drive(self) -> tuple[Array, Array]:
        """c and K of the force K y - c [N] that damper and inertia put against the heaves.

        Shapes (..., stages) and (stages, stages).
        """
        motion, moment = self.motion, self.moment
        force = np.asarray(motion.force)[..., None]
        if not motion.leads:
            return force, np.zeros((len(self.stages), len(self.stages)))
        rate = motion.rule.inverse / self.duration
        moving = motion.damper * rate + (motion.mass or 0.0) * rate @ rate
        flown = np.multiply.outer(moment.heave, np.ones(len(rate))) @ moving.T
        if motion.mass is not None:
            flown = flown + motion.mass * np.multiply.outer(moment.velocity, rate.sum(1))
        return flown + force, moving

    def _error(self, q: Array) -> float:
        """Error of q at the stages, relative to the gap."""
        if self.jump is None:
            q = np.concatenate([self.moment.q[..., None, :], q], -2)
        motion, tail = self.motion, np.abs(_TAILS @ (self.motion.rule.tail @ q))
        closer = 1.0 if motion.mass is None else PHASES
        return closer * float(np.maximum.reduce(tail, None)) / motion.gap


@dataclass(frozen=True, eq=False)
class StepSolution:
    """A step that is made: q at its stages, the branches' flow."""

    step: CollocatedStep
    q: Array
    flow: StagedFlow
    error: float

    @property
    def start(self) -> ReducedMoment:
        """State where it begins, after the loads jumped if they do."""
        step = self.step
        if step.jump is None:
            return step.moment
        return replace(step.moment, q=self.q[..., 0, :], loads=step.jump)

    @property
    def moments(self) -> list[ReducedMoment]:
        """Moments at the stages, without the start."""
        motion, step = self.step.motion, self.step
        velocities = np.zeros(self.q.shape[:-1])
        if motion.mass is not None:
            moved = self.q[..., 0] - np.asarray(step.moment.heave)[..., None]
            velocities = moved @ motion.rule.inverse.T / step.duration
        first = len(step.stages) - len(step.times)
        return [ReducedMoment(time, self.q[..., stage, :],
                              FilmLoads(motion.force, step.squared[..., stage], motion.biases),
                              partial(self._memory, stage), velocities[..., stage])
                for stage, time in enumerate(step.times.tolist(), first)]

    def _memory(self, stage: int) -> Memory:
        return self._memories[stage]

    @cached_property
    def _memories(self) -> list[Memory]:
        return self.flow.after(self.step.motion.tabulated.strain(self.q))

    @property
    def _states(self) -> Array:
        """q at the start and at the stages."""
        if self.step.jump is not None:
            return self.q
        return np.concatenate([self.step.moment.q[..., None, :], self.q], -2)

    def beyond(self, times: Array) -> Array:
        """q at the stages of the step that follows, by this step's polynomial."""
        share = (times[-1] - self.step.times[-1]) / self.step.duration
        return np.asarray(self.step.motion.rule.beyond(float(share)) @ self._states)

    def at_voltages(self, step: CollocatedStep) -> Array:
        """q at the stages of the step that follows, by how it went with U², U⁴ and time here.

        Where the voltage swings, that leads further than a polynomial of time alone.
        """
        here, squared = self.step, self.step.squared
        if here.jump is None:
            first = np.asarray(here.moment.loads.voltage_squared)[..., None]
            squared = np.concatenate([first, squared], -1)
        before, later = ((times - here.times[-1]) / here.duration
                         for times in (np.append(here.moment.time, here.times), step.times))
        return by_voltages(before, squared, self._states, later, step.squared)


def factorised(stiffness: Array) -> Callable[[Array], Array]:
    """Solver of right sides, (..., stages, shapes), by a matrix over stages and shapes.

    Raises
    ------
    NoBalance
        Where it is singular.
    """
    *runs, stages, count = stiffness.shape[:-2]
    size = stages * count
    matrix = stiffness.reshape(*runs, size, size)
    # By LAPACK itself: NumPy has no factors to solve by again, and costs a small system more.
    factors = [dgetrf(each.T) for each in matrix.reshape(-1, size, size)]
    if any(singular for *_, singular in factors):
        raise NoBalance

    def solve(pull: Array) -> Array:
        rights = zip(factors, pull.reshape(-1, size), strict=True)
        changes = [dgetrs(both, pivots, right, trans=1)[0] for (both, pivots, _), right in rights]
        return np.array(changes).reshape(pull.shape)

    return solve
