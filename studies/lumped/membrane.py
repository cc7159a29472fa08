"""Circles whose film is shaped as a membrane instead of a cone: the corrected kinematics."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from tympan.fem.film.density import maxwell
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.circles.cone import ConeCircle, sloped_film
from tympan.studies.lumped.actuator import Actuator, Correction, Viscous


@dataclass(frozen=True)
class MembraneCircle:
    """A circular actuator, outer radius R and plate radius r, whose film has a weightless membrane's shape.

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
    def radius(self) -> float:
        """R [m]."""
        return self.cone.radius

    @property
    def steepness(self) -> float:
        """Of the cone [1/m]."""
        return self.cone.steepness

    @property
    def volume(self) -> float:
        """Of the cone's viscous film [m³]."""
        return self.cone.volume

    @cached_property
    def membrane_factor(self) -> float:
        """l₀/(r ln(R/r)): by how much a membrane is stiffer than the paper's cone at small deflections.

        Examples
        --------
        >>> from tympan.studies.paper.table1 import paper_actuators
        >>> round(MembraneCircle(ConeCircle(paper_actuators(4.7)[0], 45e-3), 0.0).membrane_factor, 2)
        2.33
        """
        inner = self.cone.plate_radius
        return float((self.radius - inner) / (inner * np.log(self.radius / inner)))

    @cached_property
    def _slope(self) -> float:
        """κ [1/m]."""
        inner, outer = self.cone.plate_radius, self.radius
        return float(np.sqrt((inner**-2 - outer**-2) / (2 * np.log(outer / inner) ** 3)))

    @cached_property
    def _film(self) -> float:
        """V [m³]."""
        film = self.specimen.membrane
        thickness = film.thickness / film.area_prestretch
        return float(2 * np.pi * thickness
                     / (np.log(self.radius / self.cone.plate_radius) * self._slope**2))

    def stretch(self, deflection: Any) -> tuple[Any, Any, Any]:
        """The cone's, which the viscous parts follow, with two derivatives by y."""
        return self.cone.stretch(deflection)

    def elastic(self, deflection: Any) -> tuple[Any, Any, Any]:
        """Energy [J] over that of the flat film, force [N] and stiffness [N/m] at deflections [m]."""
        return self._pull(self.specimen.membrane.material, deflection)

    def electric(self, deflection: Any) -> tuple[Any, Any, Any]:
        """The same of the voltage, per V²."""
        return self._pull(maxwell(self.specimen, 1.0), deflection)

    def capacitance(self, deflection: Any) -> Any:
        """Of the whole film [F] at a deflection [m]; half its derivative times U² is the voltage's pull."""
        return self.flat_capacitance - 2 * self.electric(deflection)[0]

    def _pull(self, material: Any, deflection: Any) -> tuple[Any, Any, Any]:
        prestretch = np.sqrt(self.specimen.membrane.area_prestretch)
        energy, force, stiffness = sloped_film(material, prestretch, self._slope, deflection)
        return self._film * energy, self._film * force, self._film * stiffness


@dataclass(frozen=True)
class LumpedModel:
    """What stands for a specimen: circles of given radii [m], the shortest first, with weights α; two factors.

    The film's law, thickness, prestretch and permittivity, and the plate's size, are those of
    ``specimen``. ``flat_capacitance`` is the whole flat film's [F], ``highest_voltage`` the highest
    across the film [V] that it is for: these circles keep their hoop stretch, so they do not pull
    in where the film does.
    """

    specimen: Specimen
    radii: tuple[float, ...]
    weights: tuple[float, ...]
    correction: Correction
    flat_capacitance: float
    highest_voltage: float
    viscous: Viscous = field(default_factory=Viscous)

    @property
    def circles(self) -> tuple[MembraneCircle, ...]:
        """The circles, ready to be moved."""
        return tuple(MembraneCircle(ConeCircle(self.specimen, radius), self.flat_capacitance)
                     for radius in self.radii)

    def check(self, voltage: float) -> None:
        """Refuse a voltage across the film [V] beyond those it is for.

        Raises
        ------
        InputError
            Naming both.
        """
        if abs(voltage) > self.highest_voltage * (1 + 1e-9):
            raise InputError(f"the model was built for at most {self.highest_voltage / 1e3:.5g} kV across the film and "
                             "does not know where it pulls in: build it for more with --voltages",
                             key=self.specimen.name, given=f"{voltage / 1e3:.5g} kV")

    def actuator(self, mass: float, rig: Rig = Rig()) -> Actuator:
        """It under a mass [kg]."""
        return Actuator(self.circles, self.weights, mass, self.viscous, rig, self.correction)
