"""Claims about small vibrations of the flat film."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.verification.claim import Pair, claim
from benchmarks.verification.films import MU, A, B, annulus, oracle
from tests.oracles import annulus_modes
from tests.oracles.axisymmetric import neo_hooke
from tympan.fem.film.laws import NeoHooke
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import HEAVE
from tympan.fem.vibration.modes import vibrations
from tympan.geometry.outlines import Circle
from tympan.studies.case import Settings, build_model

DENSITY, MASS = 960.0, 17.9e-3


def heavy_film() -> Model:
    """The film with a mass."""
    specimen = annulus(NeoHooke(MU))
    return build_model(replace(specimen, membrane=replace(specimen.membrane, density=DENSITY)),
                       Settings())


def per_area() -> float:
    """Mass of the mounted film per area [kg/m²]."""
    film = heavy_film().specimen.membrane
    return DENSITY * film.thickness / film.area_prestretch


def hertz(wave_number: float, voltage: float) -> float:
    """Frequency of a wave number: the flat film's waves run at √(tension/mass per area)."""
    return wave_number * math.sqrt(oracle(neo_hooke(MU)).resultant(voltage)
                                   / per_area()) / (2 * math.pi)


def transverse(model: Model, voltage: float) -> list[float]:
    """Frequencies [Hz] of the modes across the film, its plate held."""
    clamped = replace(model, loading=replace(model.loading, guide="fixed"))
    modes = vibrations(clamped, model.mounted(voltage**2), RigidPlate(0.0), count=12)
    across = [(shape[:, 2] ** 2).sum() > 0.99 * (shape**2).sum() for shape in modes.shapes]
    return [float(value) for value in modes.frequencies_Hz[across]]


@claim("Natural frequencies of the flat annular film, plate held", tolerance=1e-5,
       reference="zeros of J_m(ka) Y_m(kb) − J_m(kb) Y_m(ka), waves at √(tension/mass per area)")
def annulus_held() -> Iterator[Pair]:
    """The lowest five across the film, twins counted twice.

    A voltage lowers them by the Maxwell tension.
    """
    waves = [annulus_modes.held(m, 2, A, B) for m in range(4)]
    exact = np.sort(np.concatenate([np.repeat(wave, 1 if m == 0 else 2)
                                    for m, wave in enumerate(waves)]))
    for voltage in (0.0, 5000.0):
        frequencies = transverse(heavy_film(), voltage)
        for number, wave in enumerate(exact[:5]):
            yield Pair(f"f{number + 1} at {voltage / 1e3:g} kV", frequencies[number],
                       hertz(float(wave), voltage), "Hz")


@claim("Heave frequency of a 17.9 g plate on the flat film", tolerance=1e-6,
       reference="Bessel functions with the plate's inertia at the inner edge")
def plate_on_film() -> Iterator[Pair]:
    """The lowest mode: plate and film swing together."""
    wave = annulus_modes.heaving(1, A, B, MASS / per_area())[0]
    modes = vibrations(heavy_film(), heavy_film().mounted(),
                       RigidPlate.uniform(Circle(A), MASS), count=6)
    heave = int(np.argmax(modes.shares[:, HEAVE]))
    yield Pair("f", float(modes.frequencies_Hz[heave]), hertz(float(wave), 0.0), "Hz")
