"""Motion of a reduced film in time, in steps as long as an error estimate allows.

A step is collocated at the stages of Radau's rule (:mod:`tympan.fem.transient.collocation`): film,
branches (:mod:`tympan.fem.film.staged_memory`) and plate meet their equations at all of them, and
Newton's method solves for all at once. So a step is long, and the points of all of its stages
share each call of NumPy, which is what such a small film costs. Its error is told from the highest
coefficients of the polynomial that it is.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgesv

from tympan.fem.film.memory import Memory
from tympan.fem.film.staged_memory import StagedFlow
from tympan.fem.transient.collocation import CollocationRule, radau
from tympan.studies.reduced_film.film import (
    ITERATIONS,
    FilmLoads,
    NoBalance,
    ReducedFilm,
    require_stable,
)
from tympan.studies.signals import Signal, Supplied, Together

Array = NDArray[np.float64]

#: Stages of a step of one run, and of several: these cost arithmetic, not calls.
_STAGES, _FEWER = 4, 3

#: Up to how many times as long a step begins where the one before leads to.
_FAR = 1.5

#: Safety of a step's length, by how much it may shrink and grow, the first and the shortest as
#: shares of the shortest time that matters.
_SAFE, _SHRINK, _GROWTH, _FIRST, _SHORTEST = 0.8, 0.2, 5.0, 3.0, 1e-9

#: How much the last coefficient but one counts: where a signal swings between stages, the last may
#: be nothing. Errors so many times too large after one correction are not corrected further.
_NEXT, _HOPELESS = 0.2, 3.0

#: By how much more closely what swings is followed: over many swings phases add up.
_PHASES = 2.0

#: After so many steps that failed where it begins is put in balance again.
_TWICE = 2

#: The last correction of a state over the root of a step's error, and at most; what may be left
#: after later ones, over that error.
_CLOSER, _NEAR, _LEFT = 0.2, 5e-4, 0.3

#: Of a step, relative to the gap between plate and frame.
ERROR = 1e-4

#: Deflection over the gap at which the film has pulled in.
_REACH = 1.5


@dataclass(frozen=True, eq=False)
class ReducedMoment:
    """A reduced film at a time [s]: q, its loads and memory, the velocity of a plate with mass.

    Of one run or, as arrays, of several.
    """

    time: float
    q: Array
    loads: FilmLoads
    memory: Memory
    velocity: Any = 0.0

    @property
    def heave(self) -> Any:
        """The plate's deflection [m]."""
        return self.q[..., 0]


class PulledIn(ArithmeticError):
    """The film goes no further than a ``time`` [s]."""

    def __init__(self, time: float) -> None:
        super().__init__(f"pulled in at {time:g} s")
        self.time = time


@dataclass(frozen=True, eq=False)
class ReducedMotion:
    """A reduced film under a force [N] and a signal of the voltage across it, or several runs.

    These have forces of shape (runs,), or signals :class:`~tympan.studies.signals.Together`; they
    share their steps.

    ``spring`` on the plate [N/m]; its ``mass`` [kg], None for one that follows the film at once;
    ``damper`` on it [N s/m]; ``error``: of a step, relative to the gap between plate and frame.
    """

    film: ReducedFilm
    force: Any
    signal: Signal | Supplied | Together
    spring: float = 0.0
    mass: float | None = None
    damper: float = 0.0
    error: float = ERROR

    @property
    def begin(self) -> ReducedMoment:
        """At rest for ever under force and first voltage; mounted and flat where the film says.

        Raises
        ------
        NoBalance
            Where there is no rest.
        """
        film, time = self.film, float(self.signal.breaks[0])
        if film.specimen.membrane.mounted is not None:
            return self.flat
        loads = FilmLoads(self.force, self.signal.first**2, self.spring)
        q = film.at_rest(loads, self.last)
        return ReducedMoment(time, q, loads, film.relaxed(q))

    @property
    def flat(self) -> ReducedMoment:
        """Mounted and flat, so long ago as the film says, before the loads are put on."""
        film, time = self.film, float(self.signal.breaks[0])
        runs = np.broadcast_shapes(np.shape(self.force), np.shape(self.signal.first))
        memory = Memory.mounted(film.specimen.membrane, (*runs, len(film.volumes)))
        return ReducedMoment(time, np.zeros((*runs, film.count)), FilmLoads(0.0, 0.0), memory)

    def moments(self, begin: ReducedMoment | None = None) -> Iterator[ReducedMoment]:
        """From a moment, by default its ``begin``, to the signal's end, stage by stage.

        Where a piece of the signal begins, the same time again.

        Raises
        ------
        PulledIn
            Where the film has no equilibrium any more, or the plate is gone.
        """
        moment, step = begin or self.begin, 0.0
        for piece, (start, end) in enumerate(pairwise(self.signal.breaks.tolist())):
            loads = FilmLoads(self.force, self.signal.within(piece, start) ** 2, self.spring)
            jumps = loads.differ(moment.loads)
            if jumps:
                moment = self._after_jump(moment, loads)
            if jumps or not step:
                step = _FIRST * min([end - start, *self._times(moment)])
            yield moment
            moment, step = yield from self._through(moment, step, piece, end)

    @cached_property
    def rule(self) -> CollocationRule:
        """Of a step."""
        several = np.ndim(self.force) or np.ndim(self.signal.first)
        return radau(_FEWER if several else _STAGES)

    @property
    def leads(self) -> bool:
        """Whether inertia or a damper hold the plate at once."""
        return self.mass is not None or self.damper > 0

    @property
    def last(self) -> float:
        """A correction of a state, relative to the gap, after which no other is looked for."""
        return min(_NEAR, _CLOSER * float(np.sqrt(self.closeness)))

    @property
    def closeness(self) -> float:
        """The error of a step, relative to the gap; closer of what swings."""
        return self.error / (1.0 if self.mass is None else _PHASES)

    def _through(self, moment: ReducedMoment, step: float, piece: int, end: float
                 ) -> Generator[ReducedMoment, None, tuple[ReducedMoment, float]]:
        """A piece of the signal, in steps; its last moment and the next step's length [s]."""
        shortest, failures, past = _SHORTEST * step, 0, None
        while moment.time < end:
            rest = end - moment.time
            duration = rest if step >= rest else min(step, rest / 2)
            times = moment.time + duration * self.rule.nodes
            if duration == rest:
                times[-1] = end
            solution = self._attempt(moment, past, piece, times)
            error = solution.error if solution is not None else np.inf
            change = _SAFE * (self.error / max(error, 1e-300)) ** (1 / len(times))
            step = duration * min(max(change, _SHRINK), _GROWTH)
            if solution is not None and error <= self.error:
                past, failures, moments = solution, 0, solution.moments
                yield from moments
                moment = moments[-1]
                if np.abs(solution.q[..., 0]).max() > _REACH * self.film.specimen.gap:
                    raise PulledIn(moment.time)
                continue
            if duration < shortest:
                raise PulledIn(moment.time)
            failures += 1
            if failures == _TWICE:
                # Where it begins a little out of balance, that is an error no short step lessens.
                moment = self._after_jump(moment, moment.loads)
        return moment, step

    def _attempt(self, moment: ReducedMoment, past: _StepSolution | None, piece: int, times: Array
                 ) -> _StepSolution | None:
        """A step to some times of its stages; None where the film cannot be followed."""
        try:
            with np.errstate(all="ignore"):
                return _Step(self, moment, piece, times).solved(self._guess(moment, past, times))
        except NoBalance:
            return None

    def _guess(self, moment: ReducedMoment, past: _StepSolution | None, times: Array) -> Array:
        """q at the stages of a step from a moment."""
        if past is not None and times[-1] - moment.time <= _FAR * past.step.duration:
            return past.beyond(times)
        return np.repeat(moment.q[..., None, :], len(times), -2)

    def _times(self, moment: ReducedMoment) -> list[float]:
        """Times that matter [s]: of the branches, of the plate's swing or creep."""
        times: list[float] = moment.memory.times.tolist()
        if self.mass is not None:
            times.append(float(np.sqrt(self.mass / self._stiffness(moment))))
        elif self.damper:
            times.append(self.damper / self._stiffness(moment))
        return times

    def _stiffness(self, moment: ReducedMoment) -> float:
        """Against heave [N/m], of the stiffest run."""
        flow = moment.memory.step(self.film.strain(moment.q), 0.0)
        _, stiffness = self.film.pull(moment.q, moment.loads.voltage_squared, flow)
        return float(np.abs(stiffness[..., 0, 0]).max())

    def _after_jump(self, moment: ReducedMoment, loads: FilmLoads) -> ReducedMoment:
        """The film at once after its loads jumped, the plate held by inertia or damper."""
        film, clamped = self.film, self.leads
        flow = moment.memory.step(film.strain(moment.q), 0.0)
        try:
            q = film.carried(moment.q, moment.loads, loads, flow, clamped=clamped, last=self.last)
        except NoBalance:
            raise PulledIn(moment.time) from None
        return replace(moment, q=q, loads=loads)


@dataclass(frozen=True, eq=False)
class _Step:
    """A step of a motion from a moment, to some ``times`` [s] of its stages."""

    motion: ReducedMotion
    moment: ReducedMoment
    piece: int
    times: Array

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.times[-1]) - self.moment.time

    def solved(self, guess: Array) -> _StepSolution:
        """Near q at the stages; where its error is far too large not to the last.

        Raises
        ------
        NoBalance
            Where there is none that is stable.
        """
        motion, moment, q = self.motion, self.moment, guess
        film = motion.film
        voltage = motion.signal.within(self.piece, self.times)
        flow = StagedFlow.of(moment.memory, film.strain(moment.q), self.duration,
                             motion.rule.matrix)
        constant, slope = self._drive
        size = np.inf
        for _ in range(ITERATIONS):
            pull, stiffness, flow = film.staged_pull(q, voltage**2, flow)
            pull[..., 0] += q[..., 0] @ slope.T - constant
            stiffness[..., :, 0, :, 0] += slope
            change, before = _solved(stiffness, pull), size
            size = float(np.abs(change).max()) / film.specimen.gap
            if not size < 1:
                break
            q = q - change
            error = self._error(q)
            if size < motion.last or size**2 < _LEFT * motion.closeness * before < np.inf:
                require_stable(stiffness[..., -1, self._led:, -1, self._led:])
                return _StepSolution(self, q, voltage, flow, error)
            if error > _HOPELESS * motion.error:
                return _StepSolution(self, q, voltage, flow, error)
        raise NoBalance

    @property
    def _led(self) -> int:
        """How many shapes inertia or damper lead, so that they need not be stable by themselves."""
        return int(self.motion.leads)

    @cached_property
    def _drive(self) -> tuple[Array, Array]:
        """c and K of the force K y - c [N] that spring, damper and inertia put against the heaves.

        Shapes (..., stages) and (stages, stages).
        """
        motion, moment = self.motion, self.moment
        rate = motion.rule.inverse / self.duration
        moving = motion.damper * rate + (motion.mass or 0.0) * rate @ rate
        flown = np.multiply.outer(moment.heave, np.ones(len(rate))) @ moving.T
        if motion.mass is not None:
            flown = flown + motion.mass * np.multiply.outer(moment.velocity, rate.sum(1))
        return (flown + np.asarray(motion.force)[..., None],
                moving + motion.spring * np.eye(len(rate)))

    def _error(self, q: Array) -> float:
        """Of q at the stages, relative to the gap."""
        tail = self.motion.rule.tail @ np.concatenate([self.moment.q[..., None, :], q], -2)
        last, before = np.abs(tail).max((*range(tail.ndim - 2), -1))
        closer = 1.0 if self.motion.mass is None else _PHASES
        return closer * float(max(last, _NEXT * before)) / self.motion.film.specimen.gap


@dataclass(frozen=True, eq=False)
class _StepSolution:
    """A step that is made: q at its stages, the voltages there [V], the branches' flow."""

    step: _Step
    q: Array
    voltage: Array
    flow: StagedFlow
    error: float

    @property
    def moments(self) -> list[ReducedMoment]:
        """At the stages."""
        motion, start = self.step.motion, self.step.moment
        memories = self.flow.after(motion.film.strain(self.q))
        velocity = np.zeros(self.q.shape[:-1])
        if motion.mass is not None:
            moved = self.q[..., 0] - np.asarray(start.heave)[..., None]
            velocity = moved @ motion.rule.inverse.T / self.step.duration
        return [ReducedMoment(time, self.q[..., stage, :],
                              FilmLoads(motion.force, self.voltage[..., stage] ** 2, motion.spring),
                              memories[stage], velocity[..., stage])
                for stage, time in enumerate(self.step.times.tolist())]

    def beyond(self, times: Array) -> Array:
        """q at the stages of the step that follows."""
        share = (times[-1] - self.step.times[-1]) / self.step.duration
        states = np.concatenate([self.step.moment.q[..., None, :], self.q], -2)
        return np.asarray(self.step.motion.rule.beyond(float(share)) @ states)


def _solved(stiffness: Array, pull: Array) -> Array:
    """The solution, in the shape of the right side, of systems over stages and shapes."""
    size = pull.shape[-2] * pull.shape[-1]
    matrix = stiffness.reshape(*pull.shape[:-2], size, size)
    if pull.ndim == 2:
        *_, step, singular = dgesv(matrix, pull.ravel())
        if singular:
            raise NoBalance
        return np.asarray(step).reshape(pull.shape)
    try:
        step = np.linalg.solve(matrix, pull.reshape(*pull.shape[:-2], size, 1))
    except np.linalg.LinAlgError:
        raise NoBalance from None
    return np.asarray(step.reshape(pull.shape))
