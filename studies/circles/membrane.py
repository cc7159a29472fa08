"""Circles whose film is shaped as a membrane instead of a cone: the corrected kinematics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tympan.fem.film.density import maxwell
from tympan.geometry.specimen import Specimen
from tympan.studies.circles.cone import ConeCircle, sloped_film


@dataclass(frozen=True)
class MembraneCircle:
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

    cone: ConeCircle
    flat_capacitance: float

    @property
    def specimen(self) -> Specimen:
        """What it is made of."""
        return self.cone.specimen

    @property
    def radius(self) -> Any:
        """R [m]."""
        return self.cone.radius

    @property
    def steepness(self) -> Any:
        """Of the cone [1/m]."""
        return self.cone.steepness

    @property
    def volume(self) -> Any:
        """Of the cone's viscous film [m³]."""
        return self.cone.volume

    @cached_property
    def membrane_factor(self) -> Any:
        """l₀/(r ln(R/r)): how much stiffer a membrane is than the paper's cone, hardly deflected.

        Examples
        --------
        >>> from tympan.studies.paper.table1 import paper_actuators
        >>> cone = ConeCircle(paper_actuators(4.7)[0], 45e-3)
        >>> print(f"{MembraneCircle(cone, 0.0).membrane_factor:.2f}")
        2.33
        """
        inner = self.cone.plate_radius
        return (self.radius - inner) / (inner * np.log(self.radius / inner))

    @cached_property
    def _slope(self) -> Any:
        """κ [1/m]."""
        inner, outer = self.cone.plate_radius, self.radius
        return np.sqrt((inner**-2.0 - outer**-2.0) / (2 * np.log(outer / inner) ** 3))

    @cached_property
    def _film(self) -> Any:
        """V [m³]."""
        film = self.specimen.membrane
        thickness = film.thickness / film.area_prestretch
        logarithm = np.log(self.radius / self.cone.plate_radius)
        return 2 * np.pi * thickness / (logarithm * self._slope**2)

    def stretch(self, deflection: Any) -> tuple[Any, Any, Any]:
        """The cone's, which the viscous parts follow, with two derivatives by y."""
        return self.cone.stretch(deflection)

    def elastic(self, deflection: Any) -> tuple[Any, Any, Any]:
        """Energy [J] over the flat film's, force [N] and stiffness [N/m] at deflections [m]."""
        return self._pull(self.specimen.membrane.material, deflection)

    def electric(self, deflection: Any) -> tuple[Any, Any, Any]:
        """The voltage's, per V²."""
        return self._pull(maxwell(self.specimen, 1.0), deflection)

    def capacitance(self, deflection: Any) -> Any:
        """Of the whole film [F]; half its derivative by y times U² is the voltage's pull."""
        return self.flat_capacitance - 2 * self.electric(deflection)[0]

    def _pull(self, material: Any, deflection: Any) -> tuple[Any, Any, Any]:
        prestretch = np.sqrt(self.specimen.membrane.area_prestretch)
        energy, force, stiffness = sloped_film(material, prestretch, self._slope, deflection)
        return self._film * energy, self._film * force, self._film * stiffness
