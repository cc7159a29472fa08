"""Several lumped actuators under one signal at once: the same equations, several times faster than one by one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tympan.fem.film.density import Maxwell, maxwell
from tympan.geometry.errors import InputError
from tympan.studies.circles.cone import ConeCircle, sloped_stretch
from tympan.studies.lumped.actuator import Actuator, Correction
from tympan.studies.lumped.equilibria import rest
from tympan.studies.lumped.signals import Signal
from tympan.studies.lumped.simulate import check

Array = NDArray[np.float64]
_ROUNDS = 30


@dataclass(frozen=True, eq=False)
class Fleet:
    """Actuators of cones of one film, rig and viscosity that differ in radii, weights, mass and permittivity.

    A state is (y, ẏ, ε₁ of each circle), shape (2 + circles, actuators); who has fewer circles than
    the others has some of weight 0.
    """

    actuators: tuple[Actuator, ...]

    def __post_init__(self) -> None:
        """Refuse actuators that differ in what all must share."""
        first = self.actuators[0]
        film = first.specimen.membrane
        for other in self.actuators:
            its = other.specimen.membrane
            same = (its.material, its.prestretch, its.permittivity_exponent, other.viscous,
                    other.rig) == (
                film.material, film.prestretch, film.permittivity_exponent, first.viscous,
                first.rig)
            cones = all(isinstance(circle, ConeCircle) for circle in other.circles)
            if not (same and cones and other.correction == Correction()):
                raise InputError("must be cones of the same film, rig and viscosity to be simulated together",
                                 key="actuators",
                                 given=f"{first.specimen.name}, {other.specimen.name}")

    @cached_property
    def _count(self) -> int:
        return max(len(actuator.circles) for actuator in self.actuators)

    def _stacked(self, values: Any, missing: float) -> Array:
        rows = [[*values(actuator), *[missing] * (self._count - len(actuator.circles))]
                for actuator in self.actuators]
        return np.array(rows, float).T

    @cached_property
    def _steepness(self) -> Array:
        return self._stacked(lambda one: [circle.steepness for circle in one.circles], 1.0)

    @cached_property
    def _volume(self) -> Array:
        """Weight times volume [m³]."""
        return self._stacked(lambda one: [weight * circle.volume for weight, circle
                                          in zip(one.weights, one.circles, strict=True)], 0.0)

    @cached_property
    def _laws(self) -> tuple[float, Any, Any]:
        """Mean prestretch, the film's law and the voltage's per V²."""
        first = self.actuators[0].specimen
        unit = maxwell(first, 1.0)
        coefficients = np.array([maxwell(one.specimen, 1.0).coefficient for one in self.actuators])
        prestretch = float(np.sqrt(first.membrane.area_prestretch))
        return prestretch, first.membrane.material, Maxwell(coefficients, unit.power)

    @cached_property
    def _masses(self) -> tuple[Array, Array]:
        """Moved masses [kg] and weights [N]."""
        return np.array([one.moved
                         for one in self.actuators]), np.array([one.load for one in self.actuators])

    def rates(self, state: Array, voltage: float) -> Array:
        """Time derivative of a state: :meth:`Actuator.rates` of each."""
        rig, v = self.actuators[0].rig, self.actuators[0].viscous
        y, speed, strain = state[0], state[1], state[2:]
        stretch, phi, _ = stretched = sloped_stretch(self._steepness, y)
        behind = stretch - 1 - strain
        pull = self._film(stretched,
                          voltage)[0] + phi / stretch * (v.k1 * behind + v.eta2 * phi * speed)
        force = np.sum(self._volume * pull, axis=0) + rig.spring * y
        mass, load = self._masses
        return np.vstack([speed, (load - force) / mass, v.k1 / v.eta1 * behind])

    def _film(self, stretched: tuple[Array, Array, Array], voltage: float) -> tuple[Array, Array]:
        """What film and voltage pull with per volume, and its derivative by y, as ``sloped_film``.

        Without the energy, which doubles the time of a simulation.
        """
        stretch, phi, bend = stretched
        prestretch, law, unit = self._laws
        squared = float(self.actuators[0].rig.film_voltage(voltage)) ** 2
        film, volts = (one.derivatives(prestretch * stretch, prestretch) for one in (law, unit))
        first, second = film[1] + squared * volts[1], film[3] + squared * volts[3]
        return prestretch * first * phi, prestretch * (first * bend + prestretch * second * phi
                                                       * phi)

    def follow(self, strain: Array, voltage: float, y: Array) -> Array:
        """Where forces balance without inertia and η₂ [m] while the branches are at ε₁; Newton from ``y``."""
        rig, k1 = self.actuators[0].rig, self.actuators[0].viscous.k1
        for _ in range(_ROUNDS):
            stretch, phi, bend = stretched = sloped_stretch(self._steepness, y)
            pull, stiff = self._film(stretched, voltage)
            behind = (stretch - 1 - strain) / stretch
            force = np.sum(self._volume * (pull + k1 * phi * behind), axis=0) + rig.spring * y
            change = bend * behind + (1 + strain) * (phi / stretch) ** 2
            stiffness = np.sum(self._volume * (stiff + k1 * change), axis=0) + rig.spring
            move = (self._masses[1] - force) / stiffness
            y = y + move
            if np.abs(move).max() < 1e-10:
                break
        return y

    def levels(self, signal: Signal, step: float = 0.5) -> Array:
        """Deflections [m] at the end of each level of a signal of steps, the rest before it first.

        Without inertia and η₂, whose oscillation is gone by then: only the branches move, by Runge
        and Kutta's steps of order 4 [s]. Shape (levels + 1, actuators).
        """
        state = self.rest(signal.first)
        y, strain, found = state[0], state[2:], [state[0]]
        rate = self.actuators[0].viscous.k1 / self.actuators[0].viscous.eta1
        for piece, (left, right) in enumerate(pairwise(signal.breaks)):
            voltage, count = float(signal.within(piece, right)), max(1,
                                                                     round((right - left) / step))
            width = (right - left) / count
            for _ in range(count):
                slopes: list[Array] = []
                for share in (0.0, 0.5, 0.5, 1.0):
                    at = strain + share * width * slopes[-1] if slopes else strain
                    y = self.follow(at, voltage, y)
                    slopes.append(rate * (sloped_stretch(self._steepness, y)[0] - 1 - at))
                strain = strain + width / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2]
                                               + slopes[3])
            y = self.follow(strain, voltage, y)
            found.append(y)
        return np.array(found)

    def rest(self, voltage: float) -> Array:
        """All at rest at a voltage [V]."""
        deflection = np.array([rest(actuator, voltage).deflection for actuator in self.actuators])
        return np.vstack([deflection, 0 * deflection,
                          sloped_stretch(self._steepness, deflection)[0] - 1])

    def simulate(self, signal: Signal, interval: float, tolerance: float = 1e-7) -> tuple[Array,
                                                                                          Array]:
        """Times [s] with an interval and deflections [m], shape (times, actuators), from rest at the first voltage.

        scipy's LSODA, relative error ``tolerance`` of a step, begun anew at each break of the
        signal; a break must lie on a multiple of the interval.

        Raises
        ------
        InputError
            When the signal goes beyond pull-in of one of them, or one leaves the model's reach.
        """
        for actuator in self.actuators:
            check(actuator, signal)
        state = self.rest(signal.first)
        shape, found, times = state.shape, [state[:1]], [np.zeros(1)]
        absolute = 0.1 * tolerance * np.abs(np.vstack([state[0], 10 * state[0], state[2:]]))
        reach = np.array([actuator.reach for actuator in self.actuators])
        for piece, (left, right) in enumerate(pairwise(signal.breaks)):
            done = solve_ivp(lambda t, x, piece=piece: self.rates(x.reshape(shape),
                                                                  signal.within(piece, t)).ravel(),
                             (left, right), state.ravel(), "LSODA", rtol=tolerance,
                             atol=absolute.ravel(),
                             t_eval=left + interval
                             * np.arange(1, round((right - left) / interval) + 1))
            state = done.y[:, -1].reshape(shape)
            moved = done.y[:shape[1]].T
            if not (done.success and (np.abs(moved) < reach).all()):
                raise InputError("one of the films is drawn in: a step overshoots what a slow ramp may reach; lower "
                                 "the voltage", key="signal", given=f"{signal.peak / 1e3:g} kV")
            found.append(moved)
            times.append(np.asarray(done.t))
        return np.concatenate(times), np.vstack(found)
