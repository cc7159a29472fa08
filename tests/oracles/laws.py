"""One sample of every registered law, with an independent implementation of its energy.

The references know W(I₁, I₂) and its slopes by the invariants, and Rivlin's formula for a film with
free faces, λ₁ W₁ = 2 (λ₁² − λ₃²) (∂W/∂I₁ + λ₂² ∂W/∂I₂); nothing of tympan.fem.film.laws. Second
derivatives are differences.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.oracles import axisymmetric
from tympan.fem.film.laws import (
    ArrudaBoyce,
    Gent,
    MooneyRivlin,
    MooneyShare,
    NeoHooke,
    Ogden,
    PrestretchedOgden,
    Separable,
    Stiffened,
    Yeoh,
)


@dataclass(frozen=True)
class Sample:
    """A law, its lines in a specimen file, its reference, and its true stress at λ₁ = λ₂ = √5 [Pa].
    """

    law: Any
    lines: str
    reference: axisymmetric.Material
    stress: float


def shear_modulus(law: Any) -> float:
    """½ ∂(σ₁ − σ₂)/∂ln λ₁ of the virgin film, or at a law's own reference [Pa]."""
    rest = getattr(law, "reference", 1.0)
    _, w1, _, w11, w12, _ = law.derivatives(rest, rest)
    return float(rest**2 * (w11 - w12) + rest * w1) / 2


def rivlin(energy: Callable[[Any, Any], Any], by_first: Callable[[Any], Any], by_second: float = 0.0
           ) -> axisymmetric.EnergyFunction:
    """A reference from W(I₁, I₂), ∂W/∂I₁ as a function of I₁, and a constant ∂W/∂I₂."""
    def invariants(l1: Any, l2: Any) -> tuple[Any, Any]:
        a, b, c = l1**2, l2**2, (l1 * l2) ** -2.0
        return sum((a, b, c)), a * b + b * c + c * a

    def stress(l1: Any, l2: Any) -> Any:
        return 2 * (l1**2 - (l1 * l2) ** -2.0) * (by_first(invariants(l1, l2)[0]) + l2**2
                                                  * by_second) / l1

    return axisymmetric.EnergyFunction(
        lambda l1, l2: energy(*invariants(l1, l2)), stress, lambda l1, l2: stress(l2, l1))


def gent(mu: float, limit: float) -> axisymmetric.EnergyFunction:
    """Gent (1996); nan where the logarithm has no value."""
    def room(i1: Any) -> Any:
        return np.where(i1 < limit + 3, limit + 3 - i1, np.nan)

    return rivlin(lambda i1, _: mu * limit / 2 * (np.log(limit) - np.log(room(i1))),
                  lambda i1: mu * limit / room(i1) / 2)


def arruda_boyce(mu: float, links: float) -> axisymmetric.EnergyFunction:
    """Arruda and Boyce (1993) with their N = links: the terms as printed."""
    return rivlin(
        lambda i1, _: mu
        * ((i1 - 3) / 2 + (i1**2 - 9) / (20 * links) + 11 * (i1**3 - 27) / (1050 * links**2)
                            + 19 * (i1**4 - 81) / (7000 * links**3) + 519 * (i1**5 - 243)
                            / (673750 * links**4)),
        lambda i1: mu * (1 / 2 + i1 / (10 * links) + 11 * i1**2 / (350 * links**2) + 19 * i1**3
                         / (1750 * links**3)
                         + 519 * i1**4 / (134750 * links**4)))


def eq8(stretch: Any) -> Any:
    """The source paper's Eq. (8) with two terms, β 40 and 2 kPa, γ 3 and 1.5 kPa."""
    return 40e3 * stretch**2 - 3e3 / stretch**2 + 2e3 * stretch**4 - 1.5e3 / stretch**4


def separable(reference: float) -> axisymmetric.EnergyFunction:
    """Eq. (8) along each axis on its own; the energy is ∫ σ(x)/x dx from 1."""
    def axis(x: Any) -> Any:
        return 20e3 * x**2 + 1.5e3 / x**2 + 500 * x**4 + 375 / x**4 - 22375

    return axisymmetric.EnergyFunction(lambda l1, l2: axis(l1 / reference) + axis(l2 / reference),
                                       lambda l1, l2: eq8(l1 / reference) / l1 + 0 * l2,
                                       lambda l1, l2: eq8(l2 / reference) / l2 + 0 * l1)


def prestretched_ogden(reference: float) -> axisymmetric.EnergyFunction:
    """The same with γ on the thickness, as an Ogden law of the virgin film with constants that
    differ by axis."""
    inner, outer = ((40e3, 2e3), (2, 4)), ((3e3, 1.5e3), (2, 4))

    def energy(l1: Any, l2: Any) -> Any:
        plane = sum(b / a * (l1**a + l2**a) / reference**a for b, a in zip(*inner, strict=True))
        return plane + sum(g / a * reference ** (2 * a) / (l1 * l2) ** a
                           for g, a in zip(*outer, strict=True)) - 42875

    def stress(l1: Any, l2: Any) -> Any:
        squeeze = reference**2 / (l1 * l2)
        up, down = (l1 / reference) ** 2, squeeze**2
        return (40e3 * up - 3e3 * down + 2e3 * up**2 - 1.5e3 * down**2) / l1

    return axisymmetric.EnergyFunction(energy, stress, lambda l1, l2: stress(l2, l1))


SAMPLES = {
    "ogden": Sample(
        Ogden((16e3, 300.0), (1.7, 4.2)), 'mu = ["16 kPa", "0.3 kPa"]\nalpha = [1.7, 4.2]',
        axisymmetric.Ogden((16e3, 300.0), (1.7, 4.2)),
        16e3 * (5**0.85 - 5**-1.7) + 300 * (5**2.1 - 5**-4.2)),
    "neo_hooke": Sample(
        NeoHooke(20e3), 'mu = "20 kPa"',
        rivlin(lambda i1, _: 10e3 * (i1 - 3), lambda i1: 10e3 + 0 * i1),
        20e3 * 4.96),
    "mooney_rivlin": Sample(
        MooneyRivlin(8e3, 500.0), 'c10 = "8 kPa"\nc01 = "0.5 kPa"',
        rivlin(lambda i1, i2: 8e3 * (i1 - 3) + 500 * (i2 - 3), lambda i1: 8e3 + 0 * i1, 500.0),
        2 * 4.96 * (8e3 + 5 * 500)),
    "yeoh": Sample(
        Yeoh((9e3, -30.0, 1.5)), 'c = ["9 kPa", "-30 Pa", "1.5 Pa"]',
        rivlin(lambda i1, _: 9e3 * (i1 - 3) - 30 * (i1 - 3) ** 2 + 1.5 * (i1 - 3) ** 3,
               lambda i1: 9e3 - 60 * (i1 - 3) + 4.5 * (i1 - 3) ** 2),
        2 * 4.96 * (9e3 - 60 * 7.04 + 4.5 * 7.04**2)),
    "gent": Sample(
        Gent(15e3, 40.0), 'mu = "15 kPa"\nj_lim = 40', gent(15e3, 40.0),
        15e3 * 4.96 * 40 / (40 - 7.04)),
    "arruda_boyce": Sample(
        ArrudaBoyce(14e3, 4.0), 'mu = "14 kPa"\nlambda_lock = 4', arruda_boyce(14e3, 16.0),
        14e3 * 4.96 * (1 + 10.04 / 80 + 11 * 10.04**2 / 44800 + 19 * 10.04**3 / 3584000 + 519
                       * 10.04**4 / 4415488000)),
    "separable": Sample(
        Separable((40e3, 2e3), (3e3, 1.5e3), (2.0, 4.0), 2.1),
        'beta = ["40 kPa", "2 kPa"]\ngamma = ["3 kPa", "1.5 kPa"]\nreference = 2.1', separable(2.1),
        40e3 * 5 / 4.41 - 3e3 * 4.41 / 5 + 2e3 * 25 / 4.41**2 - 1.5e3 * 4.41**2 / 25),
    "prestretched_ogden": Sample(
        PrestretchedOgden((40e3, 2e3), (3e3, 1.5e3), (2.0, 4.0), 2.1),
        'beta = ["40 kPa", "2 kPa"]\ngamma = ["3 kPa", "1.5 kPa"]\nalpha = [2, 4]\nreference = 2.1',
        prestretched_ogden(2.1),
        40e3 * 5 / 4.41 - 3e3 * 4.41**2 / 25 + 2e3 * 25 / 4.41**2 - 1.5e3 * 4.41**4 / 625),
    "stiffened": Sample(
        Stiffened(NeoHooke(20e3), 0.3, 9.0),
        'nominal = { law = "neo_hooke", mu = "20 kPa" }\nexponent = 0.3\ninvariant = 9',
        rivlin(lambda i1, _: 90e3 / 1.3 * ((i1 / 9) ** 1.3 - 3**-1.3),
               lambda i1: 10e3 * (i1 / 9) ** 0.3),
        20e3 * 4.96 * (10.04 / 9) ** 0.3),
    "mooney_share": Sample(
        MooneyShare(NeoHooke(20e3), 0.3, 4.0),
        'nominal = { law = "neo_hooke", mu = "20 kPa" }\nshare = 0.3\narea = 4',
        rivlin(lambda i1, i2: 7e3 * (i1 - 3) + 750 * (i2 - 3), lambda i1: 7e3 + 0 * i1, 750.0),
        2 * 4.96 * (7e3 + 5 * 750)),
}
