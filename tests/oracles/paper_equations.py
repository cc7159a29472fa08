"""The paper's lumped equations, typed again; the project is not imported."""

from __future__ import annotations

import numpy as np
from scipy.constants import epsilon_0, g


def equations(state: np.ndarray, u: float, alpha: tuple[float, float], mass: float,
              permittivity: float) -> np.ndarray:
    """Eqs. (3)–(10) as printed, for the large ellipse, with Table 1's numbers typed again."""
    y, speed, *strains = state
    r, z0, total, creep = 1e-2, 200e-6, 0.0, []
    for weight, outer, strain in zip(alpha, (4.5e-2, 7.5e-2), strains, strict=True):
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
