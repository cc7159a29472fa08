"""Published fits of VHB, and what they say of coupon tests, by another integrator than tympan's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tympan.base.arrays import Array
from tympan.studies.data.coupon import Coupons

#: Rate of the internal stretch's logarithm, and nominal stress, at an internal and a whole stretch.
Branch = tuple[Callable[[float, float], float], Callable[[Array, Array], Array]]


@dataclass(frozen=True)
class Published:
    """A fit with its source: nominal stress at rest [Pa], and of its viscous branches."""

    name: str
    source: str
    at_rest: Callable[[Array], Array]
    branches: tuple[Branch, ...] = ()

    def stress(self, coupons: Coupons) -> Array:
        """Nominal stress of uniaxial readings [Pa]."""
        stress = self.at_rest(coupons.stretch)
        for run in coupons.timed_runs.values():
            for branch in self.branches:
                stress[run] += branch_stress(branch, coupons.time[run], coupons.stretch[run])
        return stress


def branch_stress(branch: Branch, time: Array, stretch: Array) -> Array:
    """Nominal stress [Pa] of a branch of a virgin strip at times [s] of its stretch, (n,) each.

    It is stretched at once to the first reading at time 0, then evenly between them.
    """
    rate, stress = branch
    inner, last, states = np.zeros(1), 0.0, []
    for now in time:
        if now > last:
            inner = solve_ivp(lambda at, v: [rate(float(np.exp(v[0])),
                                                  float(np.interp(at, time, stretch)))],
                              (last, now), inner, "LSODA", rtol=1e-8, atol=1e-9).y[:, -1]
        states.append(inner[0])
        last = now
    return stress(np.exp(np.array(states)), stretch)


def _elastic(inner: Any, stretch: Any) -> tuple[Any, Any]:
    """C : C_v⁻¹ of a strip, and how nominal stress goes with ∂W/∂(C : C_v⁻¹)."""
    x = (stretch / inner) ** 2
    return x + 2 / np.sqrt(x), 2 * (x - 1 / np.sqrt(x)) / stretch


def neo_hooke(mu: float) -> Callable[[Array], Array]:
    """At rest."""
    return lambda stretch: mu * (stretch - stretch**-2)


def maxwell(modulus: float, time: float) -> Branch:
    """Neo-Hookean, of constant viscosity: Ċ_v = (C − ⅓ (C : C_v⁻¹) C_v)/τ."""
    def rate(inner: float, stretch: float) -> float:
        x = (stretch / inner) ** 2
        return (x - (x + 2 / x**0.5) / 3) / (2 * time)

    return rate, lambda inner, stretch: modulus / 2 * _elastic(inner, stretch)[1]


def _lopez_pamies(i1: Any, mu: tuple[float, ...], alpha: tuple[float, ...]) -> Any:
    """2 ∂W/∂I₁ of two terms 3^(1−α)/(2α) μ (I₁^α − 3^α)."""
    return sum(m * 3 ** (1 - a) * i1 ** (a - 1) for m, a in zip(mu, alpha, strict=True))


def _kumar_rest(stretch: Array) -> Array:
    i1, slope = _elastic(1.0, stretch)
    return np.asarray(_lopez_pamies(i1, (13540.0, 1080.0), (1.0, -2.474)) * slope / 2)


def _kumar_branch() -> Branch:
    """Shear-thinning: their constants in kPa and s."""
    mu, alpha = (5.42, 20.78), (-10.0, 1.948)

    def rate(inner: float, stretch: float) -> float:
        x = (stretch / inner) ** 2
        i1, i2 = x + 2 / x**0.5, 2 * x**0.5 + 1 / x
        v1 = inner**2 + 2 / inner
        modulus = _lopez_pamies(i1, mu, alpha)
        j2 = (i1**2 / 3 - i2) * modulus**2
        viscosity = 0.1 + ((7014.0 - 0.1 + 3507.0 * (v1**1.852 - 3**1.852))
                           / (1 + max(1.0 * j2, 0.0) ** 0.26))
        return float(modulus / viscosity * (x - i1 / 3) / 2)

    def stress(inner: Array, stretch: Array) -> Array:
        i1, slope = _elastic(inner, stretch)
        return np.asarray(1e3 * _lopez_pamies(i1, mu, alpha) * slope / 2)

    return rate, stress


README_FIT = Published(
    "two branches", "13.4 kPa, 31.2 kPa with 6.5 s, 11.6 kPa with 140 s, neo-Hookean: README of "
    "github.com/miguelmaso/2026-ViscousPolyconvex, there said to be of VHB 4905",
    neo_hooke(13400.0), (maxwell(31200.0, 6.5), maxwell(11600.0, 140.0)))
KUMAR = Published(
    "Kumar, Lopez-Pamies", "C. R. Mecanique 344 (2016), shear-thinning, ten constants fitted to "
    "these tests, as FElupe's example of VHB 4910 has them; the paper was not read",
    _kumar_rest, (_kumar_branch(),))

#: Of the long-time response of 4910 of Hossain and others (2012), and of relaxed or slow tests of
#: 4905, as a collector of such fits has them.
AT_REST = {
    "vhb-4910": (Published("neo-Hooke 13.4 kPa", "", neo_hooke(13400.0)),
                 Published("Yeoh 7.198, -0.0415, 0.00094 kPa", "",
                           lambda x: 2e3 * (x - x**-2) * (
                               7.198 - 2 * 0.0415 * (x**2 + 2 / x - 3)
                               + 3 * 9.4e-4 * (x**2 + 2 / x - 3) ** 2)),
                 Published("Ogden 14.33 kPa, 1.953", "",
                           lambda x: 14330.0 * (x**0.953 - x ** (-0.5 * 1.953 - 1)))),
    "vhb-4905": (Published("neo-Hooke 14.4 kPa (relaxation)", "", neo_hooke(14400.0)),
                 Published("Ogden 24.96 kPa, 1.621 (relaxation)", "",
                           lambda x: 24960.0 * (x**0.621 - x ** (-0.5 * 1.621 - 1))),
                 Published("neo-Hooke 16.1 kPa (quasi-static)", "", neo_hooke(16100.0))),
}
