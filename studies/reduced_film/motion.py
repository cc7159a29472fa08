"""Motion of a reduced film in time, in steps as long as an error estimate allows.

As the field model moves (:mod:`tympan.fem.transient.integrate`), with the same step of its memory
and the same rule for the plate, the trapezoidal, damped where its damper stops it within a step
(:mod:`tympan.fem.membrane.damped_rule`). A step begins at the polynomial through the moments before
it; how far it ends from there is the error its length follows (Milne's device: Hairer, Nørsett and
Wanner, *Solving Ordinary Differential Equations I*, §III.1). What swings is also made in halves and
extrapolated, as the field model is: over many swings phases add up.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.memory import Memory, determinant
from tympan.fem.membrane.damped_rule import end_weights
from tympan.studies.reduced_film.film import Drive, FilmLoads, NoBalance, ReducedFilm
from tympan.studies.signals import Signal, Supplied, Together

Array = NDArray[np.float64]

#: Safety of a step's length, by how much it may shrink and grow, the first and the shortest as
#: shares of the shortest time that matters.
_SAFE, _SHRINK, _GROWTH, _FIRST, _SHORTEST = 0.8, 0.2, 5.0, 2e-2, 1e-9

#: The last correction of a state over the root of a step's error.
_CLOSER = 0.2

#: By how much more closely what swings is followed.
_PHASES = 5.0

#: Of a step, relative to the gap between plate and frame.
ERROR = 1e-4

#: Deflection over the gap at which the film has pulled in.
_REACH = 1.5


@dataclass(frozen=True, eq=False)
class ReducedMoment:
    """A reduced film at a time [s]: q, its loads and memory; the plate's velocity, acceleration.

    Of one run or, as arrays, of several. ``stiffness`` against the heave of a plate that is damped
    [N/m], of the stiffest.
    """

    time: float
    q: Array
    loads: FilmLoads
    memory: Memory
    velocity: Any = 0.0
    acceleration: Any = 0.0
    stiffness: float = 0.0

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
        q = film.at_rest(loads, self._last)
        return ReducedMoment(time, q, loads, film.relaxed(q))

    @property
    def flat(self) -> ReducedMoment:
        """Mounted and flat, so long ago as the film says, before the loads are put on."""
        film, time = self.film, float(self.signal.breaks[0])
        runs = np.broadcast_shapes(np.shape(self.force), np.shape(self.signal.first))
        memory = Memory.mounted(film.specimen.membrane, (*runs, len(film.volumes)))
        return ReducedMoment(time, np.zeros((*runs, film.count)), FilmLoads(0.0, 0.0), memory)

    def moments(self, begin: ReducedMoment | None = None) -> Iterator[ReducedMoment]:
        """From a moment, by default its ``begin``, to the signal's end.

        After a jump of the voltage the same time again.

        Raises
        ------
        PulledIn
            Where the film has no equilibrium any more, or the plate is gone.
        """
        past, step = [begin or self.begin], 0.0
        for piece, (start, end) in enumerate(pairwise(self.signal.breaks.tolist())):
            loads = self._loads(piece, start)
            jumps = loads.differ(past[-1].loads)
            if jumps:
                past = [self._after_jump(past[-1], loads)]
            if self.damper:
                past[-1] = replace(past[-1], stiffness=self._stiffness(past[-1]))
            if jumps or not step:
                step = _FIRST * min([end - start, *self._times(past[-1])])
            yield past[-1]
            past, step = yield from self._through(past, step, piece, end)

    @property
    def _last(self) -> float:
        """The last correction of a state, relative to the gap."""
        return _CLOSER * float(np.sqrt(self.error))

    def _loads(self, piece: int, time: float) -> FilmLoads:
        return FilmLoads(self.force, self.signal.within(piece, time) ** 2, self.spring)

    def _through(self, past: list[ReducedMoment], step: float, piece: int, end: float
                 ) -> Generator[ReducedMoment, None, tuple[list[ReducedMoment], float]]:
        """A piece of the signal, in steps; the last moments and the next step's length [s]."""
        advance = self._step if self.mass is None else self._doubled
        shortest = _SHORTEST * step
        while past[-1].time < end:
            rest = end - past[-1].time
            duration = rest if step >= rest else min(step, rest / 2)
            try:
                following, error = advance(past, piece, duration)
            except NoBalance:
                error = np.inf
            order = len(past) if self.mass is None else 3
            change = _SAFE * (self.error / max(error, 1e-300)) ** (1 / order)
            step = duration * min(max(change, _SHRINK), _GROWTH)
            if error <= self.error:
                past = [*past[-2:], replace(following, time=end) if duration == rest else following]
                yield past[-1]
                if np.abs(past[-1].heave).max() > _REACH * self.film.specimen.gap:
                    raise PulledIn(past[-1].time)
            elif duration < shortest:
                raise PulledIn(past[-1].time)
        return past, step

    def _times(self, moment: ReducedMoment) -> list[float]:
        """Times that matter [s]: of the branches, of the plate's swing or creep."""
        times: list[float] = moment.memory.times.tolist()
        if self.mass is not None:
            times.append(float(np.sqrt(self.mass / self._stiffness(moment))))
        elif self.damper:
            times.append(self.damper / moment.stiffness)
        return times

    def _stiffness(self, moment: ReducedMoment) -> float:
        """Against heave [N/m], of the stiffest run."""
        flow = moment.memory.step(self.film.strain(moment.q), 0.0)
        _, stiffness = self.film.pull(moment.q, moment.loads.voltage_squared, flow)
        return float(np.abs(stiffness[..., 0, 0]).max())

    def _after_jump(self, moment: ReducedMoment, loads: FilmLoads) -> ReducedMoment:
        """The film at once after its loads jumped, the plate held by inertia or damper."""
        film = self.film
        flow = moment.memory.step(film.strain(moment.q), 0.0)
        try:
            if self.mass is None and not self.damper:
                q = film.carried(moment.q, moment.loads, loads, flow, last=self._last)
                return replace(moment, q=q, loads=loads)
            q = film.carried(moment.q, moment.loads, loads, flow, None, self._last)
        except NoBalance:
            raise PulledIn(moment.time) from None
        pull, _ = film.pull(q, loads.voltage_squared, flow)
        push = loads.force - pull[..., 0] - self.spring * q[..., 0]
        if self.mass is None:
            return replace(moment, q=q, loads=loads, velocity=push / self.damper)
        push = push - self.damper * moment.velocity
        return replace(moment, q=q, loads=loads, acceleration=push / self.mass)

    def _step(self, past: list[ReducedMoment], piece: int, duration: float
              ) -> tuple[ReducedMoment, float]:
        """The moment after a duration [s], and its error relative to the gap."""
        film, moment = self.film, past[-1]
        time = moment.time + duration
        loads = self._loads(piece, time)
        flow = moment.memory.step(film.strain(moment.q), duration)
        guess = _extrapolated(past, time)
        q = film.balanced(guess, loads, flow, self._drive(moment, duration),
                          self._last)
        velocity, acceleration = self._after(moment, duration, q[..., 0])
        following = ReducedMoment(time, q, loads, flow.after(film.strain(q)), velocity,
                                  acceleration, moment.stiffness)
        error = float(np.abs(q - guess).max()) / film.specimen.gap
        return following, error * _share(past, time)

    def _doubled(self, past: list[ReducedMoment], piece: int, duration: float
                 ) -> tuple[ReducedMoment, float]:
        """The moment after a duration [s], from two halves and the whole; their error."""
        whole, _ = self._step(past, piece, duration)
        middle, _ = self._step(past, piece, duration / 2)
        halves, _ = self._step([*past[-2:], middle], piece, duration / 2)
        gap = halves.q - whole.q
        viscous = halves.memory.viscous
        viscous = viscous + (viscous - whole.memory.viscous) / 3
        memory = replace(halves.memory, viscous=viscous / np.cbrt(determinant(viscous)))
        better = replace(
            halves, q=halves.q + gap / 3, memory=memory,
            velocity=halves.velocity + (halves.velocity - whole.velocity) / 3,
            acceleration=halves.acceleration + (halves.acceleration - whole.acceleration) / 3)
        return better, _PHASES * float(np.abs(gap).max()) / 3 / self.film.specimen.gap

    def _drive(self, moment: ReducedMoment, duration: float) -> Drive:
        """What inertia and damper add to the plate's balance over a step."""
        (motion, momentum), mass = self._ends(moment, duration), self.mass or 0.0
        inertia = mass / (momentum * duration) + self.damper
        flown = moment.heave + (1 - motion) * duration * moment.velocity
        back = (moment.velocity / duration + (1 - momentum) * moment.acceleration) / momentum
        slope = inertia / (motion * duration)
        return Drive(-slope * flown - mass * back, slope)

    def _after(self, moment: ReducedMoment, duration: float, heave: Any) -> tuple[Any, Any]:
        """The plate's velocity and acceleration a duration [s] after a moment, at a heave [m]."""
        motion, momentum = self._ends(moment, duration)
        mean = (heave - moment.heave) / duration
        velocity = (mean - (1 - motion) * moment.velocity) / motion
        push = (velocity - moment.velocity) / duration
        return velocity, (push - (1 - momentum) * moment.acceleration) / momentum

    def _ends(self, moment: ReducedMoment, duration: float) -> tuple[float, float]:
        """How much the end of a step counts in the plate's motion and in its momentum."""
        return end_weights(duration, moment.stiffness, self.damper, self.mass or 0.0)


def _extrapolated(past: list[ReducedMoment], time: float) -> Array:
    """q at a time by the polynomial through some moments."""
    result = np.zeros_like(past[-1].q)
    for moment in past:
        share = 1.0
        for other in past:
            if other is not moment:
                share *= (time - other.time) / (moment.time - other.time)
        result = result + share * moment.q
    return result


def _share(past: list[ReducedMoment], time: float) -> float:
    """The error of the step to a time over how far it ends from the polynomial before it.

    By their third derivatives; with fewer moments than three a bound.
    """
    if len(past) < 3:
        return 0.25
    first, second, last = (time - moment.time for moment in past)
    return last**2 / (2 * first * second)

