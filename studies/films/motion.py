"""Motion of a reduced film in time, in steps as long as an error estimate allows.

A step (:mod:`tympan.studies.films.collocated_step`) begins where the one before leads to, or after
a jump of the voltage where the film was.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.fem.transient.integrate import Stopped
from tympan.studies.films.collocated_step import CollocatedStep, StepSolution
from tympan.studies.films.driven_film import DrivenFilm, ReducedMoment
from tympan.studies.films.film import FilmLoads, NoBalance

#: Up to how many times as long a step begins where the one before leads to.
_FAR = 1.5

#: A step's length over the longest that its error would allow, so that few are refused; a usual
#: factor of safety.
_SAFE = 0.8
#: A step is at least this share of the one before, as an error estimate far from its aim says
#: little.
_SHRINK = 0.2
#: A step is at most this many times as long as the one before, for the same reason.
_GROWTH = 5.0
#: The first step over the shortest time that matters: five stages resolve that much of a decay.
_FIRST = 3.0
#: A step this much shorter than the first is the end: the film has pulled in.
_SHORTEST = 1e-9

#: After so many steps that failed where it begins is put in balance again.
_TWICE = 2

#: Shares of a piece of the signal at which it is looked at whether it is a line.
_PLACES = np.array([0.1, 0.3, 0.5])
#: How far from a line these voltages may be, over the largest: the rounding of numbers.
_LINE = 1e-9
#: The first step in a piece that is no line, as a share of the piece. Set by trial.
_BENT = 0.25

#: Deflection over the gap at which the film has pulled in.
_REACH = 1.5


@dataclass(frozen=True, eq=False)
class ReducedMotion(DrivenFilm):
    """A driven film in time."""

    def moments(self, begin: ReducedMoment | None = None) -> Iterator[ReducedMoment]:
        """Moments from one, by default its ``begin``, to the signal's end, stage by stage.

        Where a piece of the signal begins, the same time again.

        Raises
        ------
        Stopped
            Where the film has no equilibrium any more, or the plate is gone.
        InputError
            Where it takes more work than its budget has.
        """
        moment, step, past = begin or self.begin, 0.0, None
        for piece, (start, end) in enumerate(pairwise(self.signal.breaks.tolist())):
            loads = FilmLoads(self.force, self.signal.within(piece, start) ** 2, self.biases)
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

    def _through(self, moment: ReducedMoment, step: float, piece: int, end: float,
                 past: StepSolution | None, jump: FilmLoads | None
                 ) -> Generator[ReducedMoment, None,
                                tuple[ReducedMoment, float, StepSolution | None]]:
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
            self._spend(moment, len(times))
            solution = self._attempt(CollocatedStep(self, moment, piece, times, jump), past)
            error = solution.error if solution is not None else np.inf
            change = _SAFE * (self.error / max(error, 1e-300)) ** (1 / len(times))
            step = duration * min(max(change, _SHRINK), _GROWTH)
            if solution is not None and error <= self.error:
                past, failures, moments = solution, 0, solution.moments
                yield from moments if jump is None else [solution.start, *moments]
                moment, jump = moments[-1], None
                if np.abs(solution.q[..., 0]).max() > _REACH * self.gap:
                    raise Stopped("pull_in", moment.time)
                continue
            if jump is not None:
                moment, jump = self._after_jump(moment, jump), None
                yield moment
                continue
            if duration < shortest:
                raise Stopped("pull_in", moment.time)
            failures += 1
            if failures == _TWICE:
                # Where it begins a little out of balance, that is an error no short step lessens.
                moment = self._after_jump(moment, moment.loads)
        return moment, step, past

    def _spend(self, moment: ReducedMoment, stages: int) -> None:
        """Draw on the budget for a step."""
        if self.budget is None:
            return
        if self.budget.spent:
            breaks = self.signal.breaks
            raise InputError(f"takes too much work: it was given up at {moment.time:.4g} s of "
                             f"{breaks[-1]:.4g} s; make it shorter or with fewer bends",
                             key="signal", given=f"{len(breaks)} bends")
        self.budget.left -= stages * self.film.count

    def _attempt(self, step: CollocatedStep, past: StepSolution | None) -> StepSolution | None:
        """A step after another one; None where the film cannot be followed."""
        try:
            with np.errstate(all="ignore"):
                return step.solved(self._guess(step, past))
        except NoBalance:
            return None

    def _guess(self, step: CollocatedStep, past: StepSolution | None) -> Array:
        """q at the stages of a step."""
        if past is not None and not self.leads:
            return past.at_voltages(step)
        if past is not None and step.duration <= _FAR * past.step.duration:
            return past.beyond(step.times)
        return np.repeat(step.moment.q[..., None, :], len(step.stages), -2)

    def _straight(self, piece: int, start: float, end: float) -> float:
        """The longest first step in a piece of the signal [s]: a part of one that is no line."""
        voltage = self.signal.within(piece, start + (end - start) * _PLACES)
        bend = abs(voltage[..., 0] - 2 * voltage[..., 1] + voltage[..., 2])
        bent = bend > _LINE * np.abs(voltage).max()
        return _BENT * (end - start) if bent.any() else np.inf

    def _times(self, moment: ReducedMoment) -> list[float]:
        """Times that matter [s]: of the branches, of the plate's swing or creep."""
        times: list[float] = moment.memory.times.tolist()
        if self.mass is not None:
            times.append(float(np.sqrt(self.mass / self._stiffness(moment))))
        elif self.damper:
            times.append(self.damper / self._stiffness(moment))
        return times

    def _stiffness(self, moment: ReducedMoment) -> float:
        """Stiffness against deflection [N/m], of the stiffest run."""
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
            raise Stopped("pull_in", moment.time) from None
        return replace(moment, q=q, loads=loads)
