"""Readings at rest and frequencies of circular actuators, by none of the project's solvers.

Statics and stiffness by the axisymmetric membrane, the film's share in what swings by Bessel's
functions of the flat annulus, the electrodes' weight by the shape of a flat film, ln(b/R).
"""

from __future__ import annotations

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
    Hidden,
    dataset_file,
)

DENSITY = 960.0
#: Mass of the bare film per mounted area [kg/m²].
COAT = DENSITY * THICKNESS / STRETCH**2
VOLTAGES, SWUNG = (0.0, 1.5e3, 2.5e3, 3.2e3, 3.8e3), (0.0, 3e3)


def states_of(shape: tuple[float, float], mass: float, hidden: Hidden) -> list[tuple[float, ...]]:
    """Voltage [V], deflection [m] and frequency [Hz] of a shape under a nominal mass [kg]."""
    a, b = shape
    law = Ogden((20e3 * hidden.stiffness,), (2.0,))
    film = Film(a, b, THICKNESS, STRETCH, law, 4.7 * hidden.permittivity)
    lifted = annulus_modes.lifted_area(a, b)
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
    air = hidden.air * annulus_modes.air_volume(a, b) if hidden.air else 0.0
    return annulus_modes.swinging_mass(a, b, plate, COAT + hidden.electrode) + air


def write(folder: Path, hidden: Hidden, seed: int, noise: float = 10e-6, share: float = 1e-3,
          swings: bool = True) -> Path:
    """A dataset with these things hidden in it, with ``noise`` [m] and a ``share`` of frequencies.
    """
    hidden.only("electrode", "unaccounted", "added", "spring", "air", "tether")
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
