"""Eq. (5) in time: a stiff solver with dense output, piece by piece of the signal; hysteresis; settling."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tympan.geometry.errors import InputError
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import highest, limit_words, rest
from tympan.studies.lumped.signals import Signal

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SolverSettings:
    """Relative tolerance of a step, and the absolute one as a share of the deflection at rest."""

    relative: float = 1e-8
    absolute: float = 1e-9


@dataclass(frozen=True, eq=False)
class Response:
    """What an actuator did: dense in time. ``lost`` is when it left the model's reach [s], None where it stayed."""

    actuator: Actuator
    signal: Signal
    breaks: Array
    pieces: tuple[Any, ...]
    evaluations: int
    lost: float | None = None

    @property
    def end(self) -> float:
        """When it is over [s]."""
        return float(self.breaks[-1])

    def state(self, time: Array) -> Array:
        """States at times [s], shape (2 + circles, times)."""
        time = np.asarray(time, float)
        piece = np.clip(np.searchsorted(self.breaks, time, "right") - 1, 0, len(self.pieces) - 1)
        result = np.empty((2 + len(self.actuator.circles), len(time)))
        for number in np.unique(piece):
            chosen = piece == number
            result[:, chosen] = self.pieces[number](time[chosen])
        return result

    def voltage(self, time: Array) -> Array:
        """The signal at times [V]; at a jump what comes after it."""
        time = np.asarray(time, float)
        piece = np.clip(np.searchsorted(self.breaks, time, "right") - 1, 0, len(self.pieces) - 1)
        return np.array([float(self.signal.within(int(number), at))
                         for number, at in zip(piece, time, strict=True)])

    def deflection(self, time: Array) -> Array:
        """y at times [m]."""
        return np.asarray(self.state(time)[0])

    def samples(self, interval: float) -> Array:
        """Times with an interval [s] between them, from 0 to the end."""
        return np.linspace(0.0, self.end, max(2, round(self.end / interval) + 1))


def simulate(actuator: Actuator, signal: Signal, start: Array | None = None,
             settings: SolverSettings = SolverSettings()) -> Response:
    """The response to a signal, by default from rest at its first voltage.

    scipy's Radau (implicit, order 5) with the exact Jacobian, begun anew at each break of the
    signal. A motion that leaves the model's reach ends there: ``Response.lost``.

    Raises
    ------
    InputError
        When the signal goes beyond pull-in, or there is no rest to begin from.
    """
    check(actuator, signal)
    state = actuator.rest(rest(actuator, signal.first).deflection) if start is None else start
    scale = max(abs(float(state[0])), 1e-3 / min(circle.steepness for circle in actuator.circles))
    strain = max(circle.stretch(scale)[0] - 1 for circle in actuator.circles)
    absolute = settings.absolute * np.array([scale, 10 * scale,
                                             *(strain for _ in actuator.circles)])
    breaks, pieces, evaluations = signal.breaks, [], 0
    for piece, (left, right) in enumerate(pairwise(breaks)):
        done = solve_ivp(
            lambda t, x, piece=piece: actuator.rates(x, signal.within(piece, t)), (left, right),
            state, "Radau",
            dense_output=True, events=_Gone(actuator), rtol=settings.relative, atol=absolute,
            max_step=(right - left) / 8,
            jac=lambda t, x, piece=piece: actuator.jacobian(x, signal.within(piece, t)))
        pieces.append(done.sol)
        evaluations += done.nfev
        state = done.y[:, -1]
        if done.status != 0:
            ends = np.append(breaks[:piece + 1], done.t[-1])
            return Response(actuator, signal, ends, tuple(pieces), evaluations, float(done.t[-1]))
    return Response(actuator, signal, breaks, tuple(pieces), evaluations)


def check(actuator: Actuator, signal: Signal) -> None:
    """Refuse a signal beyond pull-in or the model's reach: no rest holds the film there.

    Raises
    ------
    InputError
        Naming the voltage and the limit.
    """
    peak = abs(float(actuator.rig.film_voltage(signal.peak)))
    if peak > highest(actuator):
        raise InputError(f"the signal goes too high: {limit_words(actuator)}",
                         key=f"{actuator.specimen.name}, {1e3 * actuator.mass:g} g",
                         given=f"{peak / 1e3:.5g} kV")


@dataclass(frozen=True)
class _Gone:
    """The event, for scipy, of a deflection that leaves the model's reach; it ends the motion."""

    actuator: Actuator
    terminal: bool = True

    def __call__(self, _: float, state: Array) -> float:
        """Positive within the reach."""
        return self.actuator.reach - abs(float(state[0]))


def settling_time(time: Array, deflection: Array, share: float = 0.05) -> float:
    """When the oscillation about the slow motion last exceeds ``share`` of its largest excursion [s after time[0]].

    The slow motion is that through the midpoints of neighbouring extremes, as one draws it by eye:
    the membrane goes on creeping long after the oscillation has died away. nan where there is no
    oscillation.

    Examples
    --------
    >>> t = np.linspace(0, 10, 20001)
    >>> round(settling_time(t, 0.1 * t + np.exp(-t) * np.cos(60 * t)), 1)
    3.1
    """
    turning = np.flatnonzero(np.diff(np.sign(np.diff(deflection))) != 0) + 1
    if len(turning) < 3:
        return float("nan")
    heights, times = deflection[turning], time[turning]
    swing = np.abs(np.diff(heights)) / 2
    if swing.max() < 1e-9 * np.abs(deflection).max():
        return float("nan")
    large = np.flatnonzero(swing > share * swing.max())
    return float((times[large[-1]] + times[large[-1] + 1]) / 2 - time[0])


@dataclass(frozen=True, eq=False)
class Loop:
    """One period of a response to a sine, from its begin to its end: voltages [V] and deflections [m]."""

    voltage: Array
    deflection: Array

    @property
    def drift(self) -> float:
        """By how much it ends deeper than it began [m]; 0 once the film no longer creeps from period to period."""
        return float(self.deflection[-1] - self.deflection[0])

    @property
    def area(self) -> float:
        """∮ y du [V m], positive where the deflection lags behind."""
        y = self.deflection
        return float(-np.sum((y[1:] + y[:-1]) / 2 * np.diff(self.voltage)))

    @property
    def width(self) -> float:
        """Area over the extent in voltage and deflection: 0 for a line, π/4 for an ellipse."""
        return self.area / float(np.ptp(self.voltage) * np.ptp(self.deflection))


def last_loop(response: Response, period: float, samples: int = 400) -> Loop:
    """The last whole period of a response."""
    time = np.linspace(response.end - period, response.end, samples + 1)
    return Loop(response.voltage(time), response.deflection(time))
