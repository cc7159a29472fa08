"""A film stretched to a truncated cone with even meridians, written out for SciPy.

Every meridian has the stretch λ = p √(1 + (q/g)²) at a deflection q over the gap g; around the axis
the film keeps its prestretch p. The law is one Ogden term, the film an ideal dielectric.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from scipy.constants import epsilon_0
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

#: Deflections [m] between which equilibria are sought.
_LOW, _HIGH = 1e-7, 0.044


@dataclass(frozen=True)
class Cone:
    """The film of a circular frame and plate."""

    mu: float
    alpha: float
    prestretch: float
    thickness: float
    permittivity: float = 4.7
    frame: float = 45e-3
    plate: float = 10e-3

    @property
    def gap(self) -> float:
        return self.frame - self.plate

    @property
    def virgin_volume(self) -> float:
        flat = pi * (self.frame**2 - self.plate**2)
        return flat * self.thickness / self.prestretch**2

    def stretch(self, q: float) -> float:
        return self.prestretch * sqrt(1 + (q / self.gap) ** 2)

    def _elongation(self, q: float) -> float:
        return self.prestretch**2 * q / (self.gap**2 * self.stretch(q))

    def stored(self, q: float) -> float:
        """Elastic energy [J]."""
        first, second, a = self.stretch(q), self.prestretch, self.alpha
        return self.virgin_volume * self.mu / a * (
            first**a + second**a + (first * second) ** -a - 3)

    def pull(self, q: float) -> float:
        """Elastic force [N]."""
        first, second, a = self.stretch(q), self.prestretch, self.alpha
        slope = self.mu * (first ** (a - 1) - first ** (-a - 1) * second**-a)
        return self.virgin_volume * slope * self._elongation(q)

    def capacitance(self, q: float) -> float:
        area = self.stretch(q) * self.prestretch
        return epsilon_0 * self.permittivity * self.virgin_volume * (area / self.thickness) ** 2

    def by_squared(self, q: float) -> float:
        """Fall of the force by U² [N/V²]: half the slope of the capacitance."""
        return (epsilon_0 * self.permittivity * self.virgin_volume * self.stretch(q)
                * (self.prestretch / self.thickness) ** 2 * self._elongation(q))

    def volume(self, q: float) -> float:
        """Volume of the truncated cone [m³]."""
        return pi * q * (self.frame**2 + self.frame * self.plate + self.plate**2) / 3

    def force(self, q: float, voltage: float = 0.0, pressure: float = 0.0) -> float:
        """Force that holds the plate [N]; a gas pressure below lifts it."""
        lifted = pressure * self.volume(1.0)
        return self.pull(q) - voltage**2 * self.by_squared(q) + lifted

    def deflection(self, force: float, voltage: float = 0.0, pressure: float = 0.0) -> float:
        """First equilibrium under a force [m]."""
        places = np.linspace(_LOW, _HIGH, 400)
        excess = np.array([self.force(place, voltage, pressure) for place in places]) - force
        first = int(np.argmax(excess > 0))
        assert excess[first] > 0, "the film pulls in"
        return float(brentq(lambda q: self.force(q, voltage, pressure) - force,
                            places[first - 1], places[first], xtol=1e-15, rtol=1e-14))

    def voltage(self, q: float, force: float) -> float:
        """Voltage under which a deflection is an equilibrium [V]."""
        return sqrt(max((self.pull(q) - force) / self.by_squared(q), 0.0))

    def pull_in(self, force: float) -> tuple[float, float]:
        """Deflection [m] and voltage [V] of the pull-in."""
        start = self.deflection(force)
        found = minimize_scalar(lambda q: -self.voltage(q, force) ** 2, bounds=(start, _HIGH),
                                method="bounded", options={"xatol": 1e-12})
        assert found.x < 0.99 * _HIGH, "the film has no pull-in"
        return float(found.x), self.voltage(float(found.x), force)

    def stiffness(self, q: float, voltage: float = 0.0) -> float:
        """Slope of the force [N/m], by Richardson's extrapolation of central differences."""
        def slope(step: float) -> float:
            return (self.force(q + step, voltage) - self.force(q - step, voltage)) / (2 * step)

        return (4 * slope(1e-5) - slope(2e-5)) / 3

    def true_stress(self, q: float, voltage: float = 0.0) -> tuple[float, float]:
        """True stress along and around [Pa], elastic less Maxwell's."""
        first, second, a = self.stretch(q), self.prestretch, self.alpha
        thin = self.mu * (first * second) ** -a
        maxwell = epsilon_0 * self.permittivity * self.field(q, voltage) ** 2
        return self.mu * first**a - thin - maxwell, self.mu * second**a - thin - maxwell

    def field(self, q: float, voltage: float) -> float:
        """True electric field [V/m]."""
        return voltage * self.stretch(q) * self.prestretch / self.thickness

    def motion(self, mass: float, damper: float, force: float, voltage: float,
               times: np.ndarray) -> np.ndarray:
        """Deflections [m] after a voltage is put on at once, at rest before, at times [s]."""
        def rates(_: float, state: np.ndarray) -> list[float]:
            q, speed = state
            return [speed, (force - self.force(q, voltage) - damper * speed) / mass]

        begin = [self.deflection(force), 0.0]
        return solve_ivp(rates, (0.0, times[-1]), begin, t_eval=times, rtol=1e-10, atol=1e-13).y[0]
