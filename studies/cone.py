"""The paper's straight cone: the force of one circular actuator, Eqs. (2)–(5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.density import maxwell
from geometry.specimen import Specimen


@dataclass(frozen=True)
class ConeCircle:
    """A circular actuator of outer radius ``radius`` [m] whose film is a straight cone.

    Kinematics of Eqs. (3) and (4): λ_r = λ_p √(1 + (y/l₀)²), λ_c = λ_p, sin θ = y/√(l₀² + y²), l₀ = radius − r, with r
    the plate's mean radius and λ_p the mean prestretch. The material is the specimen's own.
    """

    specimen: Specimen
    radius: float

    @property
    def plate_radius(self) -> float:
        """R [m], of the circle with the plate's semi-axes' product."""
        return float(np.sqrt(np.prod(self.specimen.plate.outline.semi_axes)))

    def force(self, deflection: float, voltage: float) -> float:
        """2π r z sin θ (σ − ε₀ε_r E²) of Eq. (5) [N], at a deflection [m] and a voltage [V]."""
        film = self.specimen.membrane
        width = self.radius - self.plate_radius
        prestretch = np.sqrt(film.area_prestretch)
        radial = prestretch * np.hypot(1.0, deflection / width)
        thickness = film.thickness / (radial * prestretch)
        elastic = film.material.derivatives(radial, prestretch)[1]
        electric = maxwell(self.specimen, voltage**2).derivatives(radial, prestretch)[1]
        stress = radial * (elastic + electric)
        slope = deflection / np.hypot(width, deflection)
        return float(2 * np.pi * self.plate_radius * thickness * slope * stress)
