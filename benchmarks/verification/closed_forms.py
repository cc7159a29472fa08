"""Claims against closed forms: free actuation, homogeneous pull-in, balloon, small deflections."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from scipy.constants import epsilon_0
from scipy.optimize import brentq, minimize_scalar

from benchmarks.verification.claim import Pair, claim
from benchmarks.verification.films import MU, PERMITTIVITY, ROOT5, A, B, T, annulus
from tests.oracles.axisymmetric import Material
from tests.oracles.laws import SAMPLES
from tympan.fem.equilibrium.solve import held
from tympan.fem.film.density import FilmDensity
from tympan.fem.film.laws import NeoHooke
from tympan.geometry.specimen import Material as FilmMaterial
from tympan.studies.case import Settings, build_model

_UNIT = epsilon_0 * PERMITTIVITY / T**2  # ε₀ ε_r E² of the virgin film per U²


def nominal(material: FilmMaterial, stretch: float, voltage_squared: float) -> float:
    """Equibiaxial nominal stress of the program's film density, by virgin area [Pa]."""
    film = annulus(material, prestretch=(1.0, 1.0))
    c = (np.array([stretch**2]), np.array([stretch**2]), np.array([0.0]))
    return float(FilmDensity(film, voltage_squared, 1.0,
                             wrinkles=False)(c, tangent=False).stress[0, 0]) * stretch


def elastic(material: Material, stretch: float) -> float:
    """The same of the elastic film, by the reference's law [Pa]."""
    return float(material.w1(np.array([stretch]), np.array([stretch]))[0])


def free_stretch(material: FilmMaterial, voltage_squared: float, start: float) -> float:
    """Stretch at which the program's film, free at its edges, is in balance; near ``start``."""
    return float(brentq(lambda stretch: nominal(material, stretch, voltage_squared), 0.97 * start,
                        1.03 * start, xtol=1e-14))


def stress_free(material: Material) -> float:
    """Stretch without stress: 1, but for laws that are referred to the mounted film."""
    if abs(elastic(material, 1.0)) < 1e-6:
        return 1.0
    return float(brentq(lambda stretch: elastic(material, stretch), 1.0, ROOT5))


@claim("A free film actuated by voltage stretches equibiaxially, every law",
       reference="closed form σ(λ) = ε₀ε_r (U λ²/T)², "
                 "stresses by Rivlin's formula from the invariants", tolerance=1e-9)
def free_actuation() -> Iterator[Pair]:
    """Stretch at the closed form's voltage for stretches 1.1 and 1.2 of the film free of stress."""
    for name, sample in SAMPLES.items():
        for stretch in stress_free(sample.reference) * np.array([1.1, 1.2]):
            voltage_squared = elastic(sample.reference, stretch) / (_UNIT * stretch**3)
            yield Pair(f"{name}, {math.sqrt(voltage_squared) / 1e3:.4g} kV, λ",
                       free_stretch(sample.law, voltage_squared, stretch), stretch)


def homogeneous_limit(stress: float) -> tuple[float, float]:
    """Stretch and voltage [V] at a neo-Hooke film's largest voltage, nominal stress in Pa."""
    material = NeoHooke(MU)

    def voltage(stretch: float) -> float:
        excess = nominal(material, stretch, 0.0) - stress
        push = nominal(material, stretch, 0.0) - nominal(material, stretch, 1e8)  # of 10 kV
        return 1e4 * math.sqrt(max(excess, 0.0) / push)

    peak = minimize_scalar(lambda stretch: -voltage(stretch), bounds=(1.01, 6.0), method="bounded",
                           options={"xatol": 1e-10})
    return float(peak.x), float(-peak.fun)


@claim("Pull-in of the homogeneous neo-Hooke film, free and under equibiaxial dead load",
       reference="closed form: dU/dλ = 0 at λ = 2^(1/3), λ₃ = 0.63; "
                 "under a stress s where 2λ/3 − 8/(3λ⁵) = s/μ",
       tolerance=1e-6)
def homogeneous_pull_in() -> Iterator[Pair]:
    """The largest voltage over all stretches."""
    for stress, words in ((0.0, "free"), (MU * (1.5 - 1.5**-5), "dead load of 1.5 stretch")):
        stretch, voltage = homogeneous_limit(stress)
        critical = 2 ** (1 / 3)
        if stress:
            critical = float(brentq(
                lambda trial, s=stress: 2 * trial / 3 - 8 / (3 * trial**5) - s / MU, 1.2, 5.0))
        yield Pair(f"{words}, λ", stretch, critical)
        yield Pair(f"{words}, λ₃", stretch**-2, critical**-2)
        exact = (MU * (critical - critical**-5) - stress) / (_UNIT * critical**3)
        yield Pair(f"{words}, U", voltage, math.sqrt(exact), "V")


def balloon(material: FilmMaterial, stretch: float) -> float:
    """Pressure [Pa] in a sphere of radius 1 and thickness ``T``, p = dW/dΛ · 4πT / (4πΛ²)."""
    return 2 * T * nominal(material, stretch, 0.0) / stretch**2


@claim("Pressure in a spherical balloon, every law", reference="closed form p = 2hσ/r",
       tolerance=1e-9)
def balloon_pressure() -> Iterator[Pair]:
    """At small and large stretch; the law that stiffens to a limit stays below it."""
    for name, sample in SAMPLES.items():
        for stretch in (1.3, 2.5):
            stress = stretch * elastic(sample.reference, stretch)
            yield Pair(f"{name}, Λ = {stretch}, p at radius 1 m", balloon(sample.law, stretch),
                       2 * (T / stretch**2) * stress / stretch, "Pa")


@claim("Largest pressure in a neo-Hooke balloon",
       reference="closed form: Λ = 7^(1/6), p = 2μT/r (1/Λ − 1/Λ⁷)",
       tolerance=1e-6)
def balloon_limit() -> Iterator[Pair]:
    """Beyond it the balloon grows at falling pressure."""
    peak = minimize_scalar(lambda stretch: -balloon(NeoHooke(MU), stretch), bounds=(1.05, 3.0),
                           method="bounded",
                           options={"xatol": 1e-10})
    limit = 7 ** (1 / 6)
    yield Pair("Λ", float(peak.x), limit)
    yield Pair("p at radius 1 m", float(-peak.fun), 2 * MU * T * (1 / limit - limit**-7), "Pa")


@claim("Small deflection of the taut film, and the capacitance of the flat one",
       reference="closed forms F = 2πN₀w/ln(b/a), C = ε₀ε_r π(b² − a²)λ²/T", tolerance=1e-6)
def small_deflection() -> Iterator[Pair]:
    """A deflection of 1 µm without and with voltage, at the default mesh refined twice."""
    settings = Settings()
    settings = Settings(settings.mesh.refined(2.0))
    model = build_model(annulus(NeoHooke(MU)), settings)
    for voltage in (0.0, 5000.0):
        stress = MU * (ROOT5**2 - ROOT5**-4) - _UNIT * (voltage * ROOT5**2) ** 2
        exact = 2 * math.pi * stress * T / ROOT5**2 * 1e-6 / math.log(B / A)
        yield Pair(f"{voltage / 1e3:g} kV, F", held(model, 1e-6, voltage).state.force, exact, "N")
    yield Pair("C", model.capacitance(model.mounted()),
               epsilon_0 * PERMITTIVITY * math.pi * (B**2 - A**2) * ROOT5**2 / T, "F")
