"""Readings at rest and frequencies of circular actuators, by none of the project's solvers.

Statics and stiffness by the axisymmetric membrane, the film's share in what swings by Bessel's
functions of the flat annulus, the electrodes' weight by the shape of a flat film, ln(b/R).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.oracles import annulus_modes
from tests.oracles.axisymmetric import Film, Ogden, RitzExpansion
from tests.oracles.readings.round_actuators import (
    GRAVITY,
    MASSES,
    SHAPES,
    STRETCH,
    THICKNESS,
    dataset_file,
)

DENSITY = 960.0
#: Mass of the bare film per mounted area [kg/m²].
COAT = DENSITY * THICKNESS / STRETCH**2
VOLTAGES, SWUNG = (0.0, 1.5e3, 2.5e3, 3.2e3, 3.8e3), (0.0, 3e3)


@dataclass(frozen=True)
class Hidden:
    """What is there and nobody states [SI]; stiffness and permittivity are factors."""

    electrode: float = 0.0
    unaccounted: float = 0.0
    added: float = 0.0
    spring: float = 0.0
    air: float = 0.0
    tether: float = 0.0
    stiffness: float = 1.06
    permittivity: float = 0.96


def states_of(shape: tuple[float, float], mass: float, hidden: Hidden) -> list[tuple[float, ...]]:
    """Voltage [V], deflection [m] and frequency [Hz] of a shape under a nominal mass [kg]."""
    a, b = shape
    law = Ogden((20e3 * hidden.stiffness,), (2.0,))
    film = Film(a, b, THICKNESS, STRETCH, law, 4.7 * hidden.permittivity)
    ratio = np.log(b / a)
    # ∫ ln(b/R)/ln(b/a) dA
    lifted = np.pi * ((b**2 - a**2) / 2 - a**2 * ratio) / ratio
    load = GRAVITY * (mass + hidden.unaccounted + (COAT + hidden.electrode) * lifted)
    swinging = swinging_mass(a, b, mass + hidden.unaccounted + hidden.added, hidden)
    ritz = RitzExpansion(film, 24)
    at, states = ritz.flat(0.0), []
    for voltage in VOLTAGES + SWUNG[1:]:
        for _ in range(40):
            at = ritz.equilibrium(at.c, at.deflection, voltage**2) or at
            # A tether is stated by its pull at 1 mm.
            pull = hidden.spring * at.deflection + hidden.tether * (1e3 * at.deflection) ** 3
            outer = hidden.spring + 3e3 * hidden.tether * (1e3 * at.deflection) ** 2
            step = (load - pull - at.force) / (at.stiffness + outer)
            step = float(np.clip(step, -2e-3, 2e-3))
            if abs(step) < 1e-10:
                break
            at = ritz.equilibrium(at.c + at.tangent_w * step, at.deflection + step, voltage**2)
        frequency = ((at.stiffness + outer) / swinging) ** 0.5 / (2 * np.pi)
        states.append((voltage, at.deflection, frequency))
    return states


def swinging_mass(a: float, b: float, plate: float, hidden: Hidden) -> float:
    """Mass [kg] that swings as plate and film of the flat annulus do at its lowest frequency."""
    coat = COAT + hidden.electrode
    k = float(annulus_modes.heaving(1, a, b, plate / coat)[0])
    # ω² = k² N/s and the stiffness 2πN/ln(b/a): the tension N does not matter.
    air = hidden.air * air_volume(a, b) if hidden.air else 0.0
    return 2 * np.pi * coat / np.log(b / a) / k**2 + air


def air_volume(a: float, b: float) -> float:
    """Added mass of still air on both sides in a baffle, over its density [m³].

    Of the profile 1 on the plate and ln(b/R)/ln(b/a) beyond, ∬ v v'/(2π |x - x'|) dA dA' a side,
    by Hankel's transform V: 2π ∫ V(k)² dk.
    """
    from scipy.special import j0

    k = np.linspace(1e-3, 6000.0, 3000)
    radius = np.linspace(0, b, 1501)
    v = np.where(radius < a, 1.0, np.log(b / np.maximum(radius, a)) / np.log(b / a))
    transform = np.array([np.trapezoid(v * j0(at * radius) * radius, radius) for at in k])
    return float(4 * np.pi * np.trapezoid(transform**2, k))


def write(folder: Path, hidden: Hidden, seed: int, noise: float = 10e-6, share: float = 1e-3,
          swings: bool = True) -> Path:
    """A dataset with these things hidden in it, with ``noise`` [m] and a ``share`` of frequencies.
    """
    random = np.random.default_rng(seed)
    folder.mkdir()
    (folder / "dataset.toml").write_text(dataset_file(noise, density=DENSITY), encoding="utf-8")
    static, swung = ["specimen,mass_g,voltage_kV,displacement_mm"], [
        "specimen,mass_g,voltage_kV,mode,frequency_Hz,sigma_Hz"]
    for name, shape in SHAPES.items():
        for mass in MASSES:
            for voltage, deflection, frequency in states_of(shape, mass, hidden):
                start = f"{name},{1e3 * mass!r},{1e-3 * voltage!r}"
                if voltage in VOLTAGES:
                    read = deflection + noise * random.standard_normal()
                    static.append(f"{start},{1e3 * read:.9g}")
                if voltage in SWUNG:
                    read = frequency * (1 + share * random.standard_normal())
                    swung.append(f"{start},heave,{read:.9g},{share * frequency:.9g}")
    (folder / "static.csv").write_text("\n".join(static) + "\n", encoding="utf-8")
    if swings:
        (folder / "frequency.csv").write_text("\n".join(swung) + "\n", encoding="utf-8")
    return folder
