"""Motion of a reduced film in time, in steps whose length an error estimate controls.

A step (:mod:`tympan.studies.films.collocated_step`) starts from the prediction of the one before,
or, after a jump of the voltage, from the film's last state.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.fem.transient.ends import Stopped
from tympan.fem.transient.stepper import StepControl, moments
from tympan.studies.films.collocated_step import CollocatedStep, StepSolution
from tympan.studies.films.driven_film import DrivenFilm, ReducedMoment
from tympan.studies.films.film import FilmLoads, NoBalance

#: Largest ratio of a step to the one before for which that one's polynomial is the guess.
_FAR = 1.5

#: Ratio of a step's length to the longest that its error would allow, so that few steps are
#: rejected; a usual safety factor.
_SAFETY = 0.8
#: First step over the shortest relevant time: five stages resolve that much of a decay.
_FIRST = 3.0
#: Step, relative to the first, below which the motion ends: the film has pulled in.
_SHORTEST = 1e-9

#: Number of failed steps after which the film is equilibrated again at their start.
_TWICE = 2

#: Positions in a piece of the signal, as shares, that show whether the signal is linear.
_PLACES = np.array([0.1, 0.3, 0.5])
#: Largest deviation of a linear piece's voltages from a line, over the largest: rounding.
_LINE = 1e-9
#: First step in a piece that is not linear, as a share of the piece. Set by trial.
_BENT = 0.25

#: Deflection over the gap at which the film has pulled in.
_REACH = 1.5


@dataclass(frozen=True, eq=False)
class ReducedMotion(DrivenFilm):
    """Motion of a driven film in time."""

    def moments(self, begin: ReducedMoment | None = None) -> Iterator[ReducedMoment]:
        """Yield moments from one, by default ``begin``, to the signal's end, stage by stage.

        The first time of each piece of the signal occurs twice.

        Raises
        ------
        Stopped
            If the film has no equilibrium any more, or the plate has pulled in.
        InputError
            If the motion takes more work than its budget allows.
        """
        return moments(_InMotion(self, begin or self.begin), self.signal.breaks.tolist())

    @property
    def control(self) -> StepControl:
        """Control of the steps' lengths."""
        return StepControl(self.error, len(self.rule.nodes), _SAFETY, _SHORTEST)

    def first_step(self, moment: ReducedMoment, piece: int, end: float) -> float:
        """Choose the first step [s] from a moment in a piece of the signal that has an end."""
        shortest = min([end - moment.time, *self._times(moment)])
        return min(_FIRST * shortest, self._straight(piece, moment.time, end))

    def spend(self, moment: ReducedMoment, stages: int) -> None:
        """Subtract the work of a step from the budget; InputError if none is left."""
        if self.budget is None:
            return
        if self.budget.spent:
            breaks = self.signal.breaks
            raise InputError(f"takes too much work: it was given up at {moment.time:.4g} s of "
                             f"{breaks[-1]:.4g} s; make it shorter or with fewer bends",
                             key="signal", given=f"{len(breaks)} bends")
        self.budget.left -= stages * self.film.count

    def attempted(self, step: CollocatedStep, past: StepSolution | None) -> StepSolution | None:
        """Solve a step after another one; None if the film cannot be followed."""
        try:
            with np.errstate(all="ignore"):
                return step.solved(self._guess(step, past))
        except NoBalance:
            return None

    def _guess(self, step: CollocatedStep, past: StepSolution | None) -> Array:
        """Guess the unknowns at the stages of a step."""
        if past is not None and not self.led and not self.charges:
            return past.at_voltages(step)
        if past is not None and step.duration <= _FAR * past.step.duration:
            return past.beyond(step.times)
        return np.repeat(step.begin[..., None, :], len(step.stages), -2)

    def _straight(self, piece: int, start: float, end: float) -> float:
        """Limit the first step in a piece of the signal [s].

        The limit is a share of a piece that is not linear, else infinite.
        """
        voltage = self.signal.within(piece, start + (end - start) * _PLACES)
        bend = abs(voltage[..., 0] - 2 * voltage[..., 1] + voltage[..., 2])
        bent = bend > _LINE * np.abs(voltage).max()
        return _BENT * (end - start) if bent.any() else np.inf

    def _times(self, moment: ReducedMoment) -> list[float]:
        """List relevant times [s]: of the branches, of the plate's motion, of charging."""
        times: list[float] = moment.memory.times.tolist()
        if self.plate is not None:
            times.append(float(np.sqrt(self.inertia.diagonal() / self._stiffness(moment)).min()))
        elif self.damper:
            times.append(self.damper / float(self._stiffness(moment)[0]))
        if self.charges:
            capacitance = self.film.capacitance(moment.q, moment.loads.voltage_squared)
            times.append(float(np.min(self.circuit.time(capacitance))))
        return times

    def _stiffness(self, moment: ReducedMoment) -> Array:
        """Compute the stiffness against each amplitude that is led [N/m] of the stiffest run."""
        flow = moment.memory.step(self.film.strain(moment.q), 0.0)
        _, stiffness = self.film.pull(moment.q, moment.loads.voltage_squared, flow)
        own = np.abs(np.einsum("...kk->...k", stiffness)[..., :self.led])
        return np.asarray(own.reshape(-1, self.led).max(0))

    def after_jump(self, moment: ReducedMoment, loads: FilmLoads) -> ReducedMoment:
        """Compute the moment immediately after a jump of the loads.

        Inertia or a damper hold the plate.
        """
        film, clamped = self.tabulated, self.led
        flow = moment.memory.step(film.strain(moment.q), 0.0)
        try:
            q = film.carried(moment.q, moment.loads, loads, flow, clamped=clamped, last=self.last)
        except NoBalance:
            raise Stopped("pull_in", moment.time) from None
        return replace(moment, q=q, loads=loads)


@dataclass(eq=False)
class _InMotion:
    """A reduced film in motion: its last moment, and the last step as a guess for the next.

    ``jump``: loads that jump at the last moment; the jump is part of the next step.
    """

    motion: ReducedMotion
    moment: ReducedMoment
    past: StepSolution | None = None
    jump: FilmLoads | None = None
    attempted: StepSolution | None = None
    piece: int = -1
    failures: int = 0

    @property
    def control(self) -> StepControl:
        return self.motion.control

    @property
    def time(self) -> float:
        return self.moment.time

    @property
    def gone(self) -> bool:
        last, gap = self.past, self.motion.gap
        return last is not None and float(np.abs(last.q[..., 0]).max()) > _REACH * gap

    def enter(self, piece: int, begin: float, end: float
              ) -> tuple[list[ReducedMoment], float | None]:
        motion, first = self.motion, self.piece < 0
        # With a resistance the film's voltage does not jump with the source's.
        squared = (self.moment.loads.voltage_squared if motion.charges
                   else motion.signal.within(piece, begin) ** 2)
        loads = FilmLoads(motion.force, squared, motion.biases)
        jumps = loads.differ(self.moment.loads)
        self.piece, self.failures = piece, 0
        if jumps and motion.led:
            self.moment = motion.after_jump(self.moment, loads)
        anew = jumps or motion.charges
        step = motion.first_step(self.moment, piece, end) if anew or first else None
        if anew:
            self.past = None
        self.jump = loads if jumps and not motion.led else None
        return [] if self.jump is not None else [self.moment], step

    def attempt(self, duration: float, end: float | None) -> float:
        motion, moment = self.motion, self.moment
        times = moment.time + duration * motion.rule.nodes
        if end is not None:
            times[-1] = end
        motion.spend(moment, len(times))
        step = CollocatedStep(motion, moment, self.piece, times, self.jump)
        self.attempted = motion.attempted(step, self.past)
        return np.inf if self.attempted is None else self.attempted.error

    def accept(self) -> list[ReducedMoment]:
        assert self.attempted is not None
        self.past, self.failures = self.attempted, 0
        made = self.past.moments if self.jump is None else [self.past.start, *self.past.moments]
        self.moment, self.jump = made[-1], None
        return made

    def recover(self, shortest: bool) -> list[ReducedMoment]:
        motion = self.motion
        if self.jump is not None:
            # The jump failed as part of a step, so it is made separately.
            self.moment, self.jump = motion.after_jump(self.moment, self.jump), None
            return [self.moment]
        if shortest:
            raise Stopped("pull_in", self.moment.time)
        self.failures += 1
        if self.failures == _TWICE:
            # A shorter step does not reduce the error of a start that is slightly out of
            # equilibrium.
            self.moment = motion.after_jump(self.moment, self.moment.loads)
        return []
