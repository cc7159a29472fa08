"""A PI controller for a lumped model: highest integral gain at a bounded sensitivity.

The design follows Åström and Hägglund (*Advanced PID Control*, 2006, §7.3: the integral gain is the
inverse of the integrated error after a slow disturbance), here over the whole range of deflections.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import Failure
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.control.controller import Controller, Made, Method, StaticInverse
from tympan.studies.lumped.control.loop import (
    Complex,
    RunMargins,
    SampledLoop,
    closed_poles,
    frequencies,
)
from tympan.studies.lumped.control.lqg import best_lqg
from tympan.studies.lumped.equilibria import settle
from tympan.studies.lumped.linear import Linear, linearise

#: Number of voltages of the range about which the model is linearised.
_RESTS = 9
#: Largest sensitivity: it ensures a gain margin of at least 2.7 and a phase margin of at least 36°
#: (Åström, Hägglund: 1.4 to 2).
SENSITIVITY = 1.6
#: Times of the lags to try, over the time of one radian of the swing; 0 is tried as well. The
#: longest leaves 6 % of a swing; longer lags only slow the loop.
_LAGS = np.geomspace(0.25, 4.0, 20)
#: Ratios K_p/K_i [s] to try, over the swing's time.
_RATIOS = np.append(0.0, np.geomspace(0.05, 500.0, 20))
#: Integral gains to try, over the swing's frequency. One step is 8 %.
_GAINS = np.geomspace(1e-4, 1e2, 180)


@dataclass(frozen=True, eq=False)
class ControllerDesign:
    """A controller and the linearised plants over the range that it was designed on."""

    controller: Controller
    plants: tuple[SampledLoop, ...]
    linear: tuple[Linear, ...]
    sensor_lag: float

    def loops(self) -> tuple[list[Complex], Array]:
        """Compute the open loops at their frequencies [rad/s]."""
        omega = frequencies(self.controller.interval_s)
        z = np.exp(1j * omega * self.controller.interval_s)
        shape = -self.controller.law.response(z)
        return [shape * plant.response(z) for plant in self.plants], omega

    def largest_pole(self, films: Actuator) -> Array:
        """Find the largest pole of each film's sampled loop; below 1 the loop is stable.

        The films are an array. The poles are taken at the voltages about which the model was
        linearised. A film without an equilibrium at a voltage is judged at the other voltages. A
        film without any equilibrium is unstable.
        """
        largest = np.zeros(films.flat.shape)
        for linear in self.linear:
            y = settle(partial(films.balance, voltage=linear.voltage), films.flat)
            about = films.about(linear.voltage)
            state = films.rest(np.nan_to_num(y), about)
            driven = films.by_voltage(state, about, squared=True)[..., None]
            plant = SampledLoop.of(films.linear(state, about)[1], driven / linear.gain,
                               self.controller.interval_s, self.sensor_lag)
            pole = closed_poles(plant, self.controller.law).max(axis=-1)
            largest = np.fmax(largest, np.where(np.isfinite(y), pole, np.nan))
        return np.where(largest > 0, largest, np.inf)

    @property
    def margins(self) -> RunMargins:
        """The worst margins over the range."""
        return RunMargins.of(*self.loops())


def design_controller(actuator: Actuator, supply: float, interval: float, sensor_lag: float = 0.0,
           method: Method = "pi") -> ControllerDesign:
    """Design an actuator's controller from 0 to a supply's voltage [V], sampled each interval [s].

    ``sensor_lag``: time of the sensor's lag [s].

    Raises
    ------
    Failure
        Where none of the gains tried is stable over the range.
    """
    # The input is U², which has an effect at 0 V too.
    linear = [linearise(actuator, float(voltage), by="U2")
              for voltage in np.linspace(0.0, supply, _RESTS)]
    plants = tuple(SampledLoop.of(each.a, each.b / each.gain, interval, sensor_lag)
                   for each in linear)
    swing = max(abs(pole.value) for each in linear for pole in each.named_poles
                if pole.name != "charging")
    found = _pi(plants, swing) if method == "pi" else best_lqg(plants, SENSITIVITY)
    if found is None:
        raise Failure("no controller of this sampling holds the film: sample it more often "
                      "(--interval)")
    controller = found(StaticInverse.of(actuator, supply), supply)
    return ControllerDesign(controller, plants, tuple(linear), sensor_lag)


@dataclass(frozen=True, order=True)
class PiGains:
    """Gains of a PI controller behind two lags: K_i [1/s], K_p over K_i [s], the lags' time [s]."""

    integral: float
    ratio: float
    lag: float

    @property
    def proportional(self) -> float:
        """K_p."""
        return self.integral * self.ratio

    def share(self, interval: float) -> float:
        """Compute the share of the remaining way that a lag covers in an interval."""
        return float(-np.expm1(-interval / self.lag)) if self.lag else 1.0

    def lowered(self, factor: float) -> PiGains:
        """Multiply both gains by a factor."""
        return PiGains(factor * self.integral, self.ratio, self.lag)


def pi_gains(responses: Complex, z: Complex, interval: float, swing: float) -> Iterator[PiGains]:
    """Yield the highest robust gains for each lag and ratio tried; 0 where none is robust.

    ``responses`` of plants at points of the z-plane, (plants, points); ``swing`` of the plate
    [rad/s].
    """
    for lag in (0.0, *(_LAGS / swing).tolist()):
        share = PiGains(0.0, 0.0, lag).share(interval)
        lagged = responses * (share / (1 - (1 - share) / z)) ** 2
        for ratio in (_RATIOS / swing).tolist():
            gain = _highest_gain(lagged * (ratio + interval / (1 - 1 / z)), _GAINS * swing)
            yield PiGains(float(gain), ratio, lag)


def _pi(plants: Sequence[SampledLoop], swing: float) -> Made | None:
    """Find lags, K_p/K_i and gain for plants with a swing [rad/s]; None where none is stable."""
    interval = plants[0].interval
    z = np.exp(1j * frequencies(interval)[::3] * interval)
    best = max(pi_gains(np.array([plant.response(z) for plant in plants]), z, interval, swing))
    if not best.integral:
        return None
    return lambda inverse, supply: Controller.pi(inverse, supply, interval, best.lag,
                                                 best.proportional, best.integral)


def _highest_gain(loops: Complex, gains: Array) -> float:
    """Find the last of ascending gains up to which 1 + L stays away from 0 in all loops.

    Without gain the loop is stable, and it stays stable as long as L does not pass −1.
    """
    real, squared = loops.real.copy(), loops.real**2 + loops.imag**2
    highest = 0.0
    for gain in gains.tolist():
        # |1 + gL|² = 1 + g (2 Re L + g |L|²)
        if 1 + gain * (2 * real + gain * squared).min() < SENSITIVITY**-2:
            break
        highest = gain
    return highest
