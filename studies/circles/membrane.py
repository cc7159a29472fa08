"""Circles whose film is shaped as a membrane instead of a cone: the corrected kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tympan.studies.circles.cone import ConeCircle


@dataclass(frozen=True)
class MembraneCircle(ConeCircle):
    """A circular actuator whose film is shaped as a weightless membrane; radius R, plate radius r.

    Under even tension and hardly deflected that is y ln(R/ρ)/ln(R/r) at a distance ρ from the axis,
    with the slope y/(ρ ln(R/r)). Over the whole film, whatever its law, the energy of those slopes
    is to fourth order in y that of a volume V of film with the one slope κy:

    V [Ψ(λ_p √(1 + κ²y²), λ_p) − Ψ(λ_p, λ_p)],  V κ² = 2π z₀/ln(R/r),  κ² = (1/r² − 1/R²)/(2
    ln³(R/r)).

    Force is its derivative, film and voltage alike: the voltage pulls with ½U² dC/dy. The paper's
    cone has V = 2π r z₀ l₀ and κ = 1/l₀, and a force smaller by :attr:`membrane_factor`.
    ``flat_capacitance`` [F] is that of the whole flat film. The viscous parts remain the cone's,
    with which the paper identified their constants.
    """

    flat_capacitance: float = 0.0

    @cached_property
    def membrane_factor(self) -> Any:
        """l₀/(r ln(R/r)): how much stiffer a membrane is than the paper's cone, hardly deflected.

        Examples
        --------
        >>> from tympan.studies.paper.table1 import paper_actuators
        >>> circle = MembraneCircle(paper_actuators(4.7)[0], 45e-3)
        >>> print(f"{circle.membrane_factor:.2f}")
        2.33
        """
        inner = self.plate_radius
        return (self.radius - inner) / (inner * np.log(self.radius / inner))

    @cached_property
    def film(self) -> tuple[Any, Any]:
        inner, outer, film = self.plate_radius, self.radius, self.specimen.membrane
        logarithm = np.log(outer / inner)
        steepness = np.sqrt((inner**-2.0 - outer**-2.0) / (2 * logarithm**3))
        thickness = film.thickness / film.area_prestretch
        return steepness, 2 * np.pi * thickness / (logarithm * steepness**2)

    def capacitance(self, deflection: Any) -> Any:
        """Of the whole film [F]; half its derivative by y times U² is the voltage's pull."""
        return self.flat_capacitance - 2 * self.electric(deflection)[0]
