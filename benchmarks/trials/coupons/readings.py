"""Stresses of coupons by closed forms: none of the project's solvers or laws is used.

Each mode's stress is written out, a free width under voltage is the root of its balance, and a
branch's flow is a differential equation that SciPy integrates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import log

import numpy as np
from scipy.constants import epsilon_0
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from tympan.base.arrays import Array

MODULUS, THICKNESS, PERMITTIVITY, VOLTAGE = 20e3, 1e-3, 4.7, 6e3
#: What a laboratory writes in dataset.toml.
FILM = """name = "film"
[[specimen]]
name = "film"
[specimen.frame]
shape = "circle"
radius = "2 cm"
[specimen.membrane]
thickness = "1 mm"
prestretch = [1, 1]
relative_permittivity = 4.7
[specimen.membrane.material]
law = "neo_hooke"
mu = "20 kPa"
"""
#: The film is stiffer than stated, and less permittive, by these factors.
STIFFER, LESS = 1.08, 0.95


#: The width in each mode as a power of the stretch.
POWERS = {"uniaxial": -0.5, "pure_shear": 0.0, "equibiaxial": 1.0}
#: How much wider or narrower than without voltage a free strip may be, as logarithms at which its
#: balance is looked at.
_WIDENING = np.linspace(0.0, log(3.0), 300)


def neo_hookean(first: Array) -> Array:
    """2 ∂W/∂I₁ over the modulus, by I₁."""
    return np.ones_like(first)


@dataclass(frozen=True)
class Film:
    """What is hidden in tests of a film, in the effects' own parameters.

    The film's law has no second invariant: ``slope`` is 2 ∂W/∂I₁ over its modulus by I₁. It is
    stiffer than stated and less permittive by factors, and ``mounted`` at that stretch when it
    makes an actuator, to which effects refer. The branch, of a modulus [Pa] and a time [s], flows
    as stated or, ``logarithmic``, with the logarithms of its strains.
    """

    hardening: float = 0.0
    second: float = 0.0
    falling: float = 0.0
    power: float = 0.0
    held: float = 0.0
    let: float = 0.0
    branch: tuple[float, float] = (0.0, 1.0)
    stiffer: float = STIFFER
    less: float = LESS
    mounted: float = 1.0
    slope: Callable[[Array], Array] = neo_hookean
    logarithmic: bool = False

    def stress(self, mode: str, stretch: Array, voltage: float = 0.0,
               celsius: float = 20.0) -> Array:
        """Nominal stress at rest [Pa], nan where a free strip bears no such voltage."""
        warmth = ((celsius + 273.15) / 293.15) ** self.power
        across = stretch ** POWERS[mode]
        if mode == "uniaxial":
            across = self._free_width(stretch, voltage, warmth) ** (1 - self.held)
        elif mode == "pure_shear":
            across = stretch ** (-0.5 * self.let)
        return warmth * self._law(stretch, across) - self._pull(stretch, across, voltage)

    def _law(self, along: Array, across: Array) -> Array:
        """Nominal stress along one axis without voltage [Pa]."""
        first = along**2 + across**2 + (along * across) ** -2
        invariant = 2 * self.mounted**2 + self.mounted**-4
        # ∂I₂/∂λ₁ is λ₂² ∂I₁/∂λ₁.
        slope = (self.slope(first) + (first / invariant) ** self.hardening - 1
                 + self.second * (across**2 / self.mounted**2 - 1))
        return MODULUS * self.stiffer * slope * (along - 1 / (along**3 * across**2))

    def _pull(self, along: Array, across: Array, voltage: float) -> Array:
        """What voltage takes from it [Pa]."""
        field = epsilon_0 * PERMITTIVITY * self.less * (voltage / THICKNESS) ** 2
        area = along * across / self.mounted**2
        return field * (1 - self.falling / 2) * area ** -self.falling * along * across**2

    def _free_width(self, stretch: Array, voltage: float, warmth: float) -> Array:
        """Of strips on which nothing pulls across, nan where there is no such width."""
        free = stretch**-0.5
        return free if not voltage else np.array([
            self._widened(along, width, voltage, warmth)
            for along, width in zip(stretch, free, strict=True)])

    def _widened(self, along: float, free: float, voltage: float, warmth: float) -> float:
        def missing(widening: Array) -> Array:
            across, other = free * np.exp(widening), np.full_like(widening, along)
            return warmth * self._law(across, other) - self._pull(across, other, voltage)

        # A permittivity that falls fast makes voltage narrow a strip.
        way = _WIDENING if missing(_WIDENING[:1])[0] < 0 else -_WIDENING
        beyond = np.flatnonzero(missing(way) * np.sign(way[-1]) >= 0)
        if not len(beyond):
            return np.nan
        ends = way[max(beyond[0] - 1, 0)], way[beyond[0]]
        root = brentq(lambda widening: float(missing(np.array([widening]))[0]), *ends, xtol=1e-14)
        return float(free * np.exp(root))

    def branch_stress(self, mode: str, time: Array, stretch: Array) -> Array:
        """Nominal stress of the branch at times [s] of a test's stretch [Pa], (n,) each.

        The film is virgin before time 0, stretched at once there to its first reading, evenly
        between them.
        """
        modulus, constant = self.branch
        if not modulus:
            return np.zeros(len(time))
        powers = np.array([1.0, POWERS[mode]])
        # Logarithms of the branch's viscous C, and after each interval.
        inner, last, pulls = np.zeros(2), 0.0, []
        for now, along in zip(time.tolist(), stretch.tolist(), strict=True):
            if now > last:
                inner = solve_ivp(lambda at, x: self._flow(
                    x, 2 * powers * log(np.interp(at, time, stretch))) / constant,
                    (last, now), inner, "DOP853", rtol=1e-9, atol=1e-11).y[:, -1]
            last, across = now, along ** powers[1]
            first, second = np.exp(inner).tolist()
            pulls.append(along / first - first * second / (along**3 * across**2))
        return modulus * np.array(pulls)

    def _flow(self, inner: Array, whole: Array) -> Array:
        """Rate of the logarithms of the viscous C times the branch's time, of those of C."""
        elastic = whole - inner
        if self.logarithmic:
            return elastic
        return np.asarray(np.exp(elastic) - (np.exp(elastic).sum() + np.exp(-elastic.sum())) / 3)


#: Modes, voltages [V] and temperatures [°C] in which a film is tested; no free strip is charged.
DESIGN = (("uniaxial", 0.0, 20.0), ("equibiaxial", 0.0, 20.0), ("equibiaxial", VOLTAGE, 20.0),
          ("pure_shear", 0.0, 20.0), ("pure_shear", VOLTAGE, 20.0), ("pure_shear", 0.0, 50.0))
STRETCH = np.linspace(1.1, 3.0, 12)


def at_rest(film: Film, noise: float, seed: int, factors: Sequence[float] = (1.0,) * len(DESIGN)
            ) -> str:
    """coupon.csv of :data:`DESIGN`, the noise a share of the stress, strips stiffer by factors."""
    stress = np.concatenate([factor * film.stress(mode, STRETCH, voltage, celsius)
                             for (mode, voltage, celsius), factor in zip(DESIGN, factors,
                                                                         strict=True)])
    sigma = noise * float(np.sqrt(np.mean(stress**2)))
    stress = stress + np.random.default_rng(seed).normal(0, sigma, len(stress))
    lines = [f"{mode},{stretch:.8f},{read / 1e3:.8f},{voltage / 1e3},{celsius},{sigma / 1e3:.6f}\n"
             for (mode, voltage, celsius), part in zip(DESIGN, np.split(stress, len(DESIGN)),
                                                       strict=True)
             for stretch, read in zip(STRETCH, part, strict=True)]
    return "mode,stretch,nominal_stress_kPa,voltage_kV,temperature_C,sigma_kPa\n" + "".join(lines)


def in_time(film: Film, noise: float, seed: int) -> str:
    """coupon.csv of uniaxial ramps at two rates to a stretch of 3, held there for five minutes."""
    rows, values = [], []
    for rate in (0.01, 0.1):
        ramp = np.linspace(1, 3, 16)
        time = np.r_[(ramp - 1) / rate, 2 / rate + np.geomspace(1, 300, 12)]
        stretch = np.r_[ramp, np.full(12, 3.0)]
        stress = film.stress("uniaxial", stretch) + film.branch_stress("uniaxial", time, stretch)
        rows += [(f"{rate} per s", *pair) for pair in zip(time, stretch, strict=True)]
        values.append(stress)
    read = np.concatenate(values)
    sigma = noise * float(np.sqrt(np.mean(read**2)))
    read = read + np.random.default_rng(seed).normal(0, sigma, len(read))
    lines = [f"uniaxial,{run},{time:.8f},{stretch:.8f},{stress / 1e3:.8f},{sigma / 1e3:.6f}\n"
             for (run, time, stretch), stress in zip(rows, read, strict=True)]
    head = "mode,run,t_s,stretch,nominal_stress_kPa,sigma_kPa\n"
    return head + "".join(lines)
