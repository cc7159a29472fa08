"""Motion of a reduced film in time, in steps as long as an error estimate allows.

A step is collocated at the stages of Radau's rule (:mod:`tympan.fem.transient.collocation`): film,
branches (:mod:`tympan.fem.film.staged_memory`) and plate meet their equations at all of them, and
Newton's method solves for all at once, by one tangent as long as Broyden's updates do. So a step is
long, and the points of all of its stages share each call of NumPy, which is what such a small film
costs. Where the loads jump the state at once after it is a stage of the step that begins there. The
error of a step is told from the highest coefficients of the polynomial that it is.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.memory import Memory
from tympan.fem.film.staged_memory import StagedFlow
from tympan.fem.transient.collocation import CollocationRule, radau
from tympan.studies.reduced_film.corrections import Corrections, factorised
from tympan.studies.reduced_film.film import (
    ITERATIONS,
    FilmLoads,
    NoBalance,
    ReducedFilm,
    require_stable,
)
from tympan.studies.reduced_film.sampling import by_voltages
from tympan.studies.signals import Signal, Supplied, Together

Array = NDArray[np.float64]

#: Stages of a step of one run; of several, which cost arithmetic, or where the plate is led.
_STAGES, _FEWER = 5, 4

#: Up to how many times as long a step begins where the one before leads to.
_FAR = 1.5

#: Safety of a step's length, by how much it may shrink and grow, the first and the shortest as
#: shares of the shortest time that matters.
_SAFE, _SHRINK, _GROWTH, _FIRST, _SHORTEST = 0.8, 0.2, 5.0, 3.0, 1e-9

#: How much the last coefficient but one counts: where a signal swings between stages, the last may
#: be nothing. Errors so many times too large after one correction are not corrected further.
_TAILS, _HOPELESS = np.diag([1.0, 0.2]), 1.5

#: By how much more closely what swings is followed: over many swings phases add up.
_PHASES = 2.0

#: After so many steps that failed where it begins is put in balance again.
_TWICE = 2

#: The last correction of a state over the root of a step's error, and at most; what may be left
#: after later ones, over that error.
_CLOSER, _NEAR, _LEFT = 0.2, 2e-3, 0.3

#: A tangent serves again where corrections fall at least so fast.
_SLOW = 0.4

#: A signal is a line where it is one at these places, but for so much of it; else the first step is
#: so long a part of it.
_PLACES, _LINE, _BENT = np.array([0.0, 0.3, 0.6]), 1e-9, 0.25

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
        film, time = self.tabulated, float(self.signal.breaks[0])
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
        moment, step, past = begin or self.begin, 0.0, None
        for piece, (start, end) in enumerate(pairwise(self.signal.breaks.tolist())):
            loads = FilmLoads(self.force, self.signal.within(piece, start) ** 2, self.spring)
            jump = loads if loads.differ(moment.loads) else None
            if jump and self.leads:
                moment = self._after_jump(moment, jump)
            if jump or not step:
                step = min(_FIRST * min([end - start, *self._times(moment)]),
                           self._straight(piece, start, end))
            past = None if jump else past
            if jump is None or self.leads:
                jump = None
                yield moment
            moment, step, past = yield from self._through(moment, step, piece, end, past, jump)

    @property
    def tabulated(self) -> ReducedFilm:
        """The film with its law in a table."""
        return self.film.tabulated

    @cached_property
    def rule(self) -> CollocationRule:
        """Of a step."""
        several = np.ndim(self.force) or np.ndim(self.signal.first)
        return radau(_FEWER if several or self.leads else _STAGES)

    @cached_property
    def leads(self) -> bool:
        """Whether inertia or a damper hold the plate at once."""
        return self.mass is not None or self.damper > 0

    @cached_property
    def gap(self) -> float:
        """Between plate and frame [m]."""
        return self.film.specimen.gap

    @cached_property
    def last(self) -> float:
        """A correction of a state, relative to the gap, after which no other is looked for."""
        return min(_NEAR, _CLOSER * float(np.sqrt(self.closeness)))

    @cached_property
    def closeness(self) -> float:
        """The error of a step, relative to the gap; closer of what swings."""
        return self.error / (1.0 if self.mass is None else _PHASES)

    def _through(self, moment: ReducedMoment, step: float, piece: int, end: float,
                 past: _StepSolution | None, jump: FilmLoads | None
                 ) -> Generator[ReducedMoment, None,
                                tuple[ReducedMoment, float, _StepSolution | None]]:
        """A piece of the signal, in steps; its last moment, the next step's length [s], the last.

        The loads may ``jump`` at its beginning, which is then part of its first step.
        """
        shortest, failures = _SHORTEST * step, 0
        while moment.time < end:
            rest = end - moment.time
            duration = rest if step >= rest else min(step, rest / 2)
            times = moment.time + duration * self.rule.nodes
            if duration == rest:
                times[-1] = end
            solution = self._attempt(_Step(self, moment, piece, times, jump), past)
            error = solution.error if solution is not None else np.inf
            change = _SAFE * (self.error / max(error, 1e-300)) ** (1 / len(times))
            step = duration * min(max(change, _SHRINK), _GROWTH)
            if solution is not None and error <= self.error:
                past, failures, moments = solution, 0, solution.moments
                yield from moments if jump is None else [solution.start, *moments]
                moment, jump = moments[-1], None
                if np.abs(solution.q[..., 0]).max() > _REACH * self.gap:
                    raise PulledIn(moment.time)
                continue
            if jump is not None:
                moment, jump = self._after_jump(moment, jump), None
                yield moment
                continue
            if duration < shortest:
                raise PulledIn(moment.time)
            failures += 1
            if failures == _TWICE:
                # Where it begins a little out of balance, that is an error no short step lessens.
                moment = self._after_jump(moment, moment.loads)
        return moment, step, past

    def _attempt(self, step: _Step, past: _StepSolution | None) -> _StepSolution | None:
        """A step after another one; None where the film cannot be followed."""
        try:
            with np.errstate(all="ignore"):
                return step.solved(self._guess(step, past))
        except NoBalance:
            return None

    def _guess(self, step: _Step, past: _StepSolution | None) -> Array:
        """q at the stages of a step."""
        if past is not None and not self.leads:
            return past.at_voltages(step)
        if past is not None and step.duration <= _FAR * past.step.duration:
            return past.beyond(step.times)
        return np.repeat(step.moment.q[..., None, :], len(step.stages), -2)

    def _straight(self, piece: int, start: float, end: float) -> float:
        """The longest first step in a piece of the signal [s]: a part of one that is no line."""
        voltage = self.signal.within(piece, start + (end - start) * _PLACES)
        bends = np.abs(np.diff(voltage, 2)) > _LINE * np.abs(voltage).max()
        return _BENT * (end - start) if np.any(bends) else np.inf

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
        film, clamped = self.tabulated, self.leads
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
    jump: FilmLoads | None = None

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.times[-1]) - self.moment.time

    @cached_property
    def stages(self) -> Array:
        """Times [s] at which it is solved for: after a ``jump`` of the loads its start, too."""
        return self.times if self.jump is None else np.append(self.moment.time, self.times)

    @cached_property
    def squared(self) -> Array:
        """U² at the stages [V²]."""
        return np.asarray(self.motion.signal.within(self.piece, self.stages) ** 2)

    def solved(self, guess: Array) -> _StepSolution:
        """Near q at the stages; where its error is far too large not to the last.

        Raises
        ------
        NoBalance
            Where there is none that is stable.
        """
        motion, q, size, tangent = self.motion, guess, np.inf, None
        film, flow, (constant, slope) = motion.tabulated, self._flow, self._drive
        for _ in range(ITERATIONS):
            fresh = tangent is None
            if tangent is None:
                pull, stiffness, flow = film.staged_pull(q, self.squared, flow)
                stiffness[..., :, 0, :, 0] += slope
                tangent = Corrections(factorised(stiffness))
            else:
                pull, flow = film.staged_forces(q, self.squared, flow)
            pull[..., 0] += q[..., 0] @ slope.T - constant
            change, before = tangent.correction(pull), size
            size = float(np.maximum.reduce(np.abs(change), None)) / motion.gap
            if not size < 1:
                break
            q = q - change
            if self._settled(size, before, fresh):
                self._require_stable(stiffness)
                return _StepSolution(self, q, flow, self._error(q))
            if fresh and (error := self._error(q)) > _HOPELESS * motion.error:
                return _StepSolution(self, q, flow, error)
            if size > _SLOW * before:
                tangent = None
        raise NoBalance

    @property
    def _flow(self) -> StagedFlow:
        """Of the branches, before anything is known of C at the stages."""
        moment, motion, rule = self.moment, self.motion, self.motion.rule
        return StagedFlow.of(moment.memory, motion.tabulated.strain(moment.q), self.duration,
                             rule.matrix if self.jump is None else rule.from_start)

    def _settled(self, size: float, before: float, fresh: bool) -> bool:
        """Whether little is left after a correction, relative to the gap, and the one before it.

        Of a fresh tangent's its square, of others as large a share as they are of those before.
        """
        little = _LEFT * self.motion.closeness
        return (fresh and size < self.motion.last) or size**2 < little * before < np.inf

    def _require_stable(self, stiffness: Array) -> None:
        # What inertia or a damper lead need not be stable by itself.
        led = int(self.motion.leads)
        for stage in (-1,) if self.jump is None else (0, -1):
            require_stable(stiffness[..., stage, led:, stage, led:])

    @cached_property
    def _drive(self) -> tuple[Array, Array]:
        """c and K of the force K y - c [N] that spring, damper and inertia put against the heaves.

        Shapes (..., stages) and (stages, stages).
        """
        motion, moment = self.motion, self.moment
        force = np.asarray(motion.force)[..., None]
        spring = motion.spring * np.eye(len(self.stages))
        if not motion.leads:
            return force, spring
        rate = motion.rule.inverse / self.duration
        moving = motion.damper * rate + (motion.mass or 0.0) * rate @ rate
        flown = np.multiply.outer(moment.heave, np.ones(len(rate))) @ moving.T
        if motion.mass is not None:
            flown = flown + motion.mass * np.multiply.outer(moment.velocity, rate.sum(1))
        return flown + force, moving + spring

    def _error(self, q: Array) -> float:
        """Of q at the stages, relative to the gap."""
        if self.jump is None:
            q = np.concatenate([self.moment.q[..., None, :], q], -2)
        motion, tail = self.motion, np.abs(_TAILS @ (self.motion.rule.tail @ q))
        closer = 1.0 if motion.mass is None else _PHASES
        return closer * float(np.maximum.reduce(tail, None)) / motion.gap


@dataclass(frozen=True, eq=False)
class _StepSolution:
    """A step that is made: q at its stages, the branches' flow."""

    step: _Step
    q: Array
    flow: StagedFlow
    error: float

    @property
    def start(self) -> ReducedMoment:
        """Where it begins, after the loads jumped if they do."""
        step = self.step
        if step.jump is None:
            return step.moment
        return replace(step.moment, q=self.q[..., 0, :], loads=step.jump)

    @property
    def moments(self) -> list[ReducedMoment]:
        """At the stages, without the start."""
        motion, step = self.step.motion, self.step
        memories = self.flow.after(motion.tabulated.strain(self.q))
        velocities = np.zeros(self.q.shape[:-1])
        if motion.mass is not None:
            moved = self.q[..., 0] - np.asarray(step.moment.heave)[..., None]
            velocities = moved @ motion.rule.inverse.T / step.duration
        first = len(step.stages) - len(step.times)
        return [ReducedMoment(time, self.q[..., stage, :],
                              FilmLoads(motion.force, step.squared[..., stage], motion.spring),
                              memories[stage], velocities[..., stage])
                for stage, time in enumerate(step.times.tolist(), first)]

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

    def at_voltages(self, step: _Step) -> Array:
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
