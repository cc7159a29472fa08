"""Time step of a reduced film that is in equilibrium at all of its stages.

The stages are those of Radau's rule (:mod:`tympan.fem.transient.collocation`). Film, branches
(:mod:`tympan.fem.film.staged_memory`), plate and circuit (:mod:`tympan.studies.films.charging`)
satisfy their equations at all stages. Newton's method solves for all stages together, with one
tangent as long as the corrections decrease. This allows long steps, and all stages share each call
of NumPy, which is the main cost of so small a film. If the loads jump, the state immediately after
the jump is one more stage of the step that starts there. The highest coefficients of a step's
polynomial estimate its error.
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
from tympan.studies.films.charging import Charging
from tympan.studies.films.driven_film import PHASES, DrivenFilm, ReducedMoment
from tympan.studies.films.film import ITERATIONS, FilmLoads, NoBalance, require_stable
from tympan.studies.films.sampling import by_voltages

#: Weights of the last two coefficients of a step's polynomial in its error. If a signal oscillates
#: between stages, the last coefficient may vanish; the one before it therefore has a small weight.
_TAILS = np.diag([1.0, 0.2])
#: Ratio of the error to the allowed one, after one correction, above which the corrections stop:
#: the step is rejected in any case.
_HOPELESS = 1.5

#: Largest error after the last correction, relative to the error of the step, so that the
#: collocation rule dominates the error. With a tenth of it motions took 2 % longer.
_LEFT = 0.03

#: Largest ratio of successive corrections for which a tangent is reused.
_SLOW = 0.4


@dataclass(frozen=True, eq=False)
class CollocatedStep:
    """A step of a motion from a moment through its stages, at ``times`` [s].

    ``jump``: loads after a jump at the start.
    """

    motion: DrivenFilm
    moment: ReducedMoment
    piece: int
    times: Array
    jump: FilmLoads | None = None

    @property
    def duration(self) -> float:
        """Duration of the step [s]."""
        return float(self.times[-1]) - self.moment.time

    @cached_property
    def stages(self) -> Array:
        """Times [s] that are solved for: the stages, and after a jump also the start."""
        return self.times if self.jump is None else np.concatenate(([self.moment.time], self.times))

    @cached_property
    def source(self) -> Array:
        """The source's voltage at the stages [V]."""
        return np.asarray(self.motion.signal.within(self.piece, self.stages))

    def squared(self, x: Array) -> Array:
        """Compute U² across the film at the stages [V²].

        It is the source's U², or that of x if the film charges through a resistance.
        """
        return self.source_squared if self.charging is None else self.charging.voltage(x) ** 2

    @cached_property
    def source_squared(self) -> Array:
        """U² of the source at the stages [V²]."""
        return np.asarray(self.source**2)

    @cached_property
    def charging(self) -> Charging | None:
        """Charging of the film in the step; None without a resistance."""
        if not self.motion.charges:
            return None
        return Charging(self.motion, self.moment, self.source, self.weights)

    @cached_property
    def weights(self) -> Array:
        """Weights of the stages' rates in each stage [s], shape (stages, stages)."""
        rule = self.motion.rule
        return self.duration * (rule.matrix if self.jump is None else rule.from_start)

    @cached_property
    def begin(self) -> Array:
        """Unknowns at the start, shape (..., unknowns)."""
        return self.motion.unknowns(self.moment)

    def solved(self, guess: Array) -> StepSolution:
        """Solve for the unknowns at the stages, shape (..., stages, unknowns), from a guess.

        The unknowns are those of :meth:`DrivenFilm.unknowns`. If the error of the step is far too
        large, the solution stops early.

        Raises
        ------
        NoBalance
            If there is no stable equilibrium.
        """
        motion, x, size, tangent = self.motion, guess, np.inf, None
        film, flow, (constant, slope) = motion.tabulated, self.flow, self._drive
        force = np.asarray(motion.force)[..., None]
        every, led = np.arange(len(self.stages)), motion.led
        square = slope.reshape(len(every) * led, len(every) * led)
        for _ in range(ITERATIONS):
            fresh = tangent is None
            q, squared = x[..., :film.count], self.squared(x)
            _, push, bend = acting(motion.biases, q[..., 0])
            if tangent is None:
                pull, stiffness, flow = film.staged_pull(q, squared, flow)
                stiffness[..., :, :led, :, :led] += slope
                stiffness[..., every, 0, every, 0] += bend
                matrix = stiffness
                if self.charging is not None:
                    matrix = self.charging.coupled(stiffness, x, pull, flow)
                tangent = factorised(matrix)
            else:
                pull, flow = film.staged_forces(q, squared, flow)
            pull[..., 0] += push - force
            if led:
                dragged = q[..., :led].reshape(*q.shape[:-2], -1) @ square.T
                pull[..., :led] += dragged.reshape(constant.shape) - constant
            if self.charging is not None:
                pull = np.concatenate([pull, self.charging.missing(x)[..., None]], -1)
            change, before = tangent(pull), size
            size = float(np.maximum.reduce(np.abs(change), None)) / motion.gap
            if not size < 1:
                break
            x = x - change
            if self._settled(size, before, fresh):
                self._require_stable(stiffness)
                return StepSolution(self, x, flow, self._error(x))
            if fresh and (error := self._error(x)) > _HOPELESS * motion.error:
                return StepSolution(self, x, flow, error)
            if size > _SLOW * before:
                tangent = None
        raise NoBalance

    @cached_property
    def flow(self) -> StagedFlow:
        """Flow of the branches, before C at the stages is known."""
        moment, motion, rule = self.moment, self.motion, self.motion.rule
        return StagedFlow.of(moment.memory, motion.tabulated.strain(moment.q), self.duration,
                             rule.matrix if self.jump is None else rule.from_start)

    def _settled(self, size: float, before: float, fresh: bool) -> bool:
        """Check whether a correction, relative to the gap, leaves a small error.

        The error after a correction with a new tangent is the square of the correction. With an old
        tangent it is the correction times its ratio to the one ``before``.
        """
        little = _LEFT * self.motion.closeness
        square = fresh and not self.moment.memory.flows and not self.motion.charges
        return (square and size < self.motion.last) or size**2 < little * before < np.inf

    def _require_stable(self, stiffness: Array) -> None:
        # Motions that inertia or a damper control need not be stable, nor does a film at given
        # charge.
        if self.motion.charges:
            return
        led = self.motion.led
        for stage in (-1,) if self.jump is None else (0, -1):
            require_stable(stiffness[..., stage, led:, stage, led:])

    @cached_property
    def _drive(self) -> tuple[Array, Array]:
        """c and K of the force K p - c [N] of damper and inertia against the plate's amplitudes.

        Shapes (..., stages, led) and (stages, led, stages, led).
        """
        motion, moment, led = self.motion, self.moment, self.motion.led
        if not led:
            count = len(self.stages)
            return np.zeros(0), np.zeros((count, 0, count, 0))
        rate = motion.rule.inverse / self.duration
        moving = np.multiply.outer(rate @ rate, motion.inertia)
        moving[..., 0, 0] += motion.damper * rate
        flown = (moment.q[..., None, None, :led] * moving.sum(1)).sum(-1)
        if motion.plate is not None:
            momentum = (moment.velocity + np.zeros(led)) @ motion.inertia
            flown = flown + rate.sum(1)[:, None] * momentum[..., None, :]
        return flown, np.ascontiguousarray(moving.swapaxes(1, 2))

    def states(self, x: Array) -> Array:
        """Collect the unknowns at the start and at the stages."""
        if self.jump is not None:
            return x
        return np.concatenate([self.begin[..., None, :], x], -2)

    def _error(self, x: Array) -> float:
        """Estimate the error of unknowns at the stages, relative to the gap."""
        motion = self.motion
        tail = np.abs(_TAILS @ (motion.rule.tail @ self.states(x)))
        closer = 1.0 if motion.plate is None else PHASES
        return closer * float(np.maximum.reduce(tail, None)) / motion.gap


@dataclass(frozen=True, eq=False)
class StepSolution:
    """A solved step: unknowns ``x`` at its stages, and the branches' flow."""

    step: CollocatedStep
    x: Array
    flow: StagedFlow
    error: float

    @property
    def q(self) -> Array:
        """Amplitudes q at the stages."""
        return self.x[..., :self.step.motion.film.count]

    @cached_property
    def squared(self) -> Array:
        """U² across the film at the stages [V²]."""
        return self.step.squared(self.x)

    @property
    def start(self) -> ReducedMoment:
        """State at the start, after a jump of the loads if there is one."""
        step = self.step
        if step.jump is None:
            return step.moment
        loads = replace(step.jump, voltage_squared=self.squared[..., 0])
        return replace(step.moment, q=self.q[..., 0, :], loads=loads)

    @property
    def moments(self) -> list[ReducedMoment]:
        """Moments at the stages, without the start."""
        motion, step = self.step.motion, self.step
        led = motion.led if motion.plate is not None else 0
        moved = self.q[..., :led] - step.moment.q[..., None, :led]
        velocities = motion.rule.inverse @ moved / step.duration if led else moved
        voltages = step.charging.voltage(self.x) if step.charging else np.zeros(self.q.shape[:-1])
        first = len(step.stages) - len(step.times)
        return [ReducedMoment(time, self.q[..., stage, :],
                              FilmLoads(motion.force, self.squared[..., stage], motion.biases),
                              partial(self._memory, stage), velocities[..., stage, :],
                              voltages[..., stage])
                for stage, time in enumerate(step.times.tolist(), first)]

    def _memory(self, stage: int) -> Memory:
        return self._memories[stage]

    @cached_property
    def _memories(self) -> list[Memory]:
        return self.flow.after(self.step.motion.tabulated.strain(self.q))

    def beyond(self, times: Array) -> Array:
        """Extrapolate the unknowns to the next step's stages by this step's polynomial."""
        share = (times[-1] - self.step.times[-1]) / self.step.duration
        return np.asarray(self.step.motion.rule.beyond(float(share)) @ self.step.states(self.x))

    def at_voltages(self, step: CollocatedStep) -> Array:
        """Extrapolate q to the next step's stages as a function of U², U⁴ and time.

        For an oscillating voltage this is more accurate than a polynomial of time alone.
        """
        here, squared = self.step, self.squared
        if here.jump is None:
            first = np.asarray(here.moment.loads.voltage_squared)[..., None]
            squared = np.concatenate([first, squared], -1)
        before, later = ((times - here.times[-1]) / here.duration
                         for times in (np.append(here.moment.time, here.times), step.times))
        return by_voltages(before, squared, here.states(self.x), later, step.source_squared)


def factorised(stiffness: Array) -> Callable[[Array], Array]:
    """Factorise a matrix over stages and shapes; return a solver of (..., stages, shapes).

    Raises
    ------
    NoBalance
        If the matrix is singular.
    """
    *runs, stages, count = stiffness.shape[:-2]
    size = stages * count
    matrix = stiffness.reshape(*runs, size, size)
    # LAPACK is called directly: NumPy cannot reuse factors, and is slower for small systems.
    factors = [dgetrf(each.T) for each in matrix.reshape(-1, size, size)]
    if any(singular for *_, singular in factors):
        raise NoBalance

    def solve(pull: Array) -> Array:
        rights = zip(factors, pull.reshape(-1, size), strict=True)
        changes = [dgetrs(both, pivots, right, trans=1)[0] for (both, pivots, _), right in rights]
        return np.array(changes).reshape(pull.shape)

    return solve
