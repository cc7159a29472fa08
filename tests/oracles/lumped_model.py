"""Lumped models without any of the project's code: the paper's equations typed again, and what
NAME.lumped.toml says of an actuator by the formulas in the file's head alone.

There the film is an Ogden one, derivatives are complex steps, rests are bracketed roots, and the
motion is SciPy's DOP853.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.constants import epsilon_0, g
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tympan.base.arrays import Array

_STEP = 1e-30


def equations(state: np.ndarray, u: float, alpha: Sequence[float], mass: float,
              permittivity: float, radii: Sequence[float] = (4.5e-2, 7.5e-2)) -> np.ndarray:
    """Eqs. (3)–(10) as printed, with Table 1's numbers typed again; the large ellipse's radii."""
    y, speed, *strains = state
    r, z0, total, creep = 1e-2, 200e-6, 0.0, []
    for weight, outer, strain in zip(alpha, radii, strains, strict=True):
        width = outer - r
        s = (width**2 + y**2) / width**2
        stretch = np.sqrt(s)
        hyper = (13.4e3 * stretch**2 + 34.8e3 * stretch**4 + 35.8e3 * stretch**6
                 + 0.41e3 * stretch**-2 + 113e3 * stretch**-4 + 34.2e3 * stretch**-6)
        viscous = -23.5e6 * strain + 23.5e6 * (stretch - 1)
        damper = 62.4e3 * y / (width * np.sqrt(width**2 + y**2)) * speed
        sine = y / np.sqrt(width**2 + y**2)
        total += weight * 2 * np.pi * r * (z0 / stretch) / mass * sine * (
            -epsilon_0 * permittivity / z0**2 * s * u**2 + hyper + viscous + damper)
        creep.append(-23.5e6 / 177.2e6 * strain + 23.5e6 / 177.2e6 * (stretch - 1))
    return np.array([speed, g - total, *creep])


@dataclass(frozen=True)
class LumpedFile:
    """The numbers of a file, SI."""

    content: dict[str, Any]
    gravity: float = g

    @classmethod
    def read(cls, file: Path) -> LumpedFile:
        return cls(tomllib.loads(file.read_text(encoding="utf-8")))

    @property
    def film(self) -> dict[str, Any]:
        return dict(self.content["specimen"]["membrane"])

    @property
    def plate(self) -> float:
        return float(self.content["specimen"]["plate"]["radius_m"])

    @property
    def circles(self) -> Array:
        """Radii and weights, shape (2, circles)."""
        return np.array([[circle[key] for circle in self.content["circle"]]
                         for key in ("radius_m", "alpha")])

    def energy(self, y: Any, squared: float) -> Any:
        """Film less ½ U² C [J]; the voltage's square is ``squared``."""
        film, (radii, alpha), r = self.film, self.circles, self.plate
        mounted = np.sqrt(np.prod(film["prestretch"]))
        thickness, logarithm = film["thickness_m"] / mounted**2, np.log(radii / r)
        steep = np.sqrt((r**-2 - radii**-2.0) / (2 * logarithm**3))
        volume = 2 * np.pi * thickness / (logarithm * steep**2)
        stretch = mounted * np.sqrt(1 + (steep * y) ** 2)

        def stored(first: Any) -> Any:
            third = 1 / (first * mounted)
            return sum(mu / power * (first**power + mounted**power + third**power - 3)
                       for mu, power in zip(film["material"]["mu_Pa"],
                                            film["material"]["alpha"], strict=True))

        energy = self.content["stiffness"] * np.sum(
            alpha * volume * (stored(stretch) - stored(mounted)))
        charge = epsilon_0 * film["relative_permittivity"] * mounted**2 / film["thickness_m"] ** 2
        grown = self.content["permittivity"] * charge * np.sum(
            alpha * volume * (stretch**2 - mounted**2))
        return energy - squared / 2 * grown

    def force(self, y: float, squared: float) -> float:
        """With which the film holds the plate [N]."""
        return float(np.imag(self.energy(y + _STEP * 1j, squared)) / _STEP)

    def rest(self, mass: float, voltage: float) -> float:
        """The lowest deflection at rest [m]."""
        def left_over(y: float) -> float:
            return self.force(y, voltage**2) - mass * self.gravity

        high = 1e-4
        while left_over(high) < 0:
            high *= 1.2
        return float(brentq(left_over, 0.0, high, xtol=1e-15, rtol=1e-14))

    def step(self, mass: float, low: float, high: float, time: Array) -> Array:
        """Deflections [m] at times from 0 on, after a step of the voltage at 0 from rest."""
        viscous, (radii, alpha), r = self.content["viscous"], self.circles, self.plate
        length = radii - r
        mounted = np.prod(self.film["prestretch"])
        volume = 2 * np.pi * r * self.film["thickness_m"] / mounted * length

        def cone(y: float) -> tuple[Array, Array]:
            stretch = np.sqrt(1 + (y / length) ** 2)
            return stretch, y / length**2 / stretch

        def rates(_: float, state: Array) -> Array:
            y, speed, strain = state[0], state[1], state[2:]
            stretch, slope = cone(y)
            behind = stretch - 1 - strain
            drag = np.sum(alpha * volume * slope / stretch
                          * (viscous["k1_Pa"] * behind + viscous["eta2_Pa_s"] * slope * speed))
            push = mass * self.gravity - self.force(y, high**2) - drag
            return np.array([speed, push / mass,
                             *(viscous["k1_Pa"] / viscous["eta1_Pa_s"] * behind)])

        y = self.rest(mass, low)
        start = np.array([y, 0.0, *(cone(y)[0] - 1)])
        done = solve_ivp(rates, (time[0], time[-1]), start, "DOP853", time, rtol=1e-10, atol=1e-13)
        return np.asarray(done.y[0])
