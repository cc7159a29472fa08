"""Stresses of coupons by closed forms: none of the project's solvers or laws is used.

Each mode's stress is written out; a branch's flow is a differential equation that SciPy integrates.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.constants import epsilon_0

from benchmarks.vhb.published import branch_stress, maxwell

Array = NDArray[np.float64]

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


@dataclass(frozen=True)
class Film:
    """What is hidden in a neo-Hookean film's tests, in the effects' own parameters."""

    hardening: float = 0.0
    second: float = 0.0
    falling: float = 0.0
    power: float = 0.0
    held: float = 0.0
    let: float = 0.0
    branch: tuple[float, float] = (0.0, 1.0)

    def stress(self, mode: str, stretch: Array, voltage: float = 0.0,
               celsius: float = 20.0) -> Array:
        """Nominal stress at rest [Pa], of strips whose width does not follow the voltage."""
        narrowing = {"uniaxial": 0.5 * (1 - self.held), "pure_shear": 0.5 * self.let}
        across = stretch ** -narrowing.get(mode, -1.0)
        first = stretch**2 + across**2 + (stretch * across) ** -2
        # ∂I₂/∂λ₁ is λ₂² ∂I₁/∂λ₁.
        slope = (first / 3) ** self.hardening + self.second * (across**2 - 1)
        law = MODULUS * STIFFER * slope * (stretch - 1 / (stretch**3 * across**2))
        field = epsilon_0 * PERMITTIVITY * LESS * (voltage / THICKNESS) ** 2
        area = stretch * across
        pull = field * (1 - self.falling / 2) * area ** (1 - self.falling) * across
        return law * ((celsius + 273.15) / 293.15) ** self.power - pull


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
        stress = film.stress("uniaxial", stretch) + branch_stress(maxwell(*film.branch), time,
                                                                  stretch)
        rows += [(f"{rate} per s", *pair) for pair in zip(time, stretch, strict=True)]
        values.append(stress)
    read = np.concatenate(values)
    sigma = noise * float(np.sqrt(np.mean(read**2)))
    read = read + np.random.default_rng(seed).normal(0, sigma, len(read))
    lines = [f"uniaxial,{run},{time:.8f},{stretch:.8f},{stress / 1e3:.8f},{sigma / 1e3:.6f}\n"
             for (run, time, stretch), stress in zip(rows, read, strict=True)]
    head = "mode,run,t_s,stretch,nominal_stress_kPa,sigma_kPa\n"
    return head + "".join(lines)
