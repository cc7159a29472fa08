"""Circular actuators of the lumped model: the paper's cones, Eqs. (2)–(5), and membranes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tympan.fem.film.density import maxwell
from tympan.geometry.outlines import Outline
from tympan.geometry.specimen import Specimen

#: Relative difference below which semi-axes are equal: rounding of lengths in files.
_ALIKE = 1e-9


def radii_of(frame: Outline) -> tuple[float, ...]:
    """Choose the radii [m] of the circles of a frame's semi-axes, shortest first; one if equal.

    Examples
    --------
    >>> from tympan.geometry.outlines import Circle, Ellipse
    >>> radii_of(Ellipse((60e-3, 45e-3))), radii_of(Circle(45e-3))
    ((0.045, 0.06), (0.045,))
    """
    short, long = sorted(frame.semi_axes)
    return (short, long) if long > short * (1 + _ALIKE) else (short,)


def sloped_stretch(steepness: Any, deflection: Any) -> tuple[Any, Any, Any]:
    """Compute √(1 + (κy)²) of a film of slope κy, κ = ``steepness`` [1/m], and derivatives by y."""
    slope = steepness * deflection
    stretch = np.sqrt(1 + slope * slope)
    return stretch, steepness * slope / stretch, (steepness / stretch) ** 2 / stretch


@dataclass(frozen=True)
class ConeCircle:
    """A circular actuator of outer radius ``radius`` [m] whose film is a straight cone.

    Kinematics of Eqs. (3) and (4): λ_r = λ_p √(1 + (y/l₀)²), λ_c = λ_p, sin θ = y/√(l₀² + y²), l₀ =
    radius − r, with r the plate's mean radius and λ_p the mean prestretch. Radii and deflections
    are numbers or arrays that broadcast.
    """

    specimen: Specimen
    radius: Any

    @cached_property
    def plate_radius(self) -> float:
        """Radius r [m] of the circle with the plate's area."""
        return float(np.sqrt(np.prod(self.specimen.needed_plate().outline.semi_axes)))

    @cached_property
    def steepness(self) -> Any:
        """Slope of the cone over the deflection [1/m], 1/l₀."""
        return 1 / (self.radius - self.plate_radius)

    @cached_property
    def thickness(self) -> float:
        """Thickness z₀ [m] of all layers of the mounted film."""
        return self.specimen.membrane.volume_per_area

    @cached_property
    def volume(self) -> Any:
        """Volume 2π r z₀ l₀ [m³] of film whose energy, by the deflection, gives the force of Eq. 5.

        In Eq. (5) z sin θ dy is z₀ l₀ dλ_r/λ_r, so force times dy is this volume times the stress
        times d ln λ_r: for any law the force has a potential, the volume times Ψ(λ_r, λ_c).
        """
        return 2 * np.pi * self.plate_radius * self.thickness / self.steepness

    @cached_property
    def gas_area(self) -> Any:
        """Volume below film and plate over the deflection [m²]: the area on which a gas lifts them.

        The film is not deformed by the gas: that effect is quadratic in the pressure.
        """
        inner, outer = self.plate_radius, self.radius
        return np.pi / 3 * (outer**2 + outer * inner + inner**2)

    @cached_property
    def film(self) -> tuple[Any, Any]:
        """Slope over deflection [1/m] and volume [m³] of the film that carries the load."""
        return self.steepness, self.volume

    def stretch(self, deflection: Any) -> tuple[Any, Any, Any]:
        """Compute the stretch from the mounted film at the plate's edge, √s of Eq. (3), and slopes.

        The slopes φ, φ' are derivatives by y. The viscous parts follow this stretch.
        """
        return sloped_stretch(self.steepness, deflection)

    def pull(self, material: Any, deflection: Any) -> tuple[Any, Any, Any]:
        """Compute energy [J] over the flat film's, force [N] and stiffness [N/m] of a material.

        The material has W, W₁, …. Across the slope the film keeps its stretch.
        """
        energy, force, stiffness = self._pulled(material, deflection)
        flat = self._flat
        return energy - self.film[1] * material.derivatives(flat, flat)[0], force, stiffness

    def _pulled(self, material: Any, deflection: Any) -> tuple[Any, Any, Any]:
        """Compute energy, force and stiffness as :meth:`pull` does, with the flat film's energy."""
        flat, (steepness, volume) = self._flat, self.film
        stretch, phi, bend = sloped_stretch(steepness, deflection)
        w, w1, _, w11, *_ = material.derivatives(flat * stretch, flat)
        return (volume * w, volume * flat * w1 * phi,
                volume * flat * (w1 * bend + flat * w11 * phi * phi))

    def elastic(self, deflection: Any) -> tuple[Any, Any, Any]:
        """Compute energy [J], force [N] and stiffness [N/m] of the film's own material."""
        return self.pull(self.specimen.membrane.material, deflection)

    def electric(self, deflection: Any) -> tuple[Any, Any, Any]:
        """Compute the voltage's energy, force, stiffness per V²; energy and force are negative."""
        return self.pull(self._charged, deflection)

    def forces(self, deflection: Any) -> tuple[tuple[Any, Any], tuple[Any, Any]]:
        """Compute force [N] and stiffness [N/m] of the film's material, and of the voltage per V².

        These are the pairs of :meth:`elastic` and :meth:`electric` without their energies.
        """
        _, pull, stiff = self._pulled(self.specimen.membrane.material, deflection)
        _, drawn, soft = self._pulled(self._charged, deflection)
        return (pull, stiff), (drawn, soft)

    @cached_property
    def _flat(self) -> Any:
        """Stretch of the mounted film, the mean of both directions."""
        return np.sqrt(self.specimen.membrane.area_prestretch)

    @cached_property
    def _charged(self) -> Any:
        """Electrostatic energy per V²."""
        return maxwell(self.specimen, 1.0)

    def force(self, deflection: Any, voltage: float) -> Any:
        """Compute 2π r z sin θ (σ − ε₀ε_r E²) of Eq. (5) [N]: not the derivative of the energy."""
        parts = self.specimen.membrane.material, maxwell(self.specimen, voltage**2)
        return sum(self.pull(part, deflection)[1] for part in parts)

    def capacitance(self, deflection: Any) -> Any:
        """Integrate ε₀ε_r dA/z over the film [F] at a deflection [m]."""
        flat = np.sqrt(self.specimen.membrane.area_prestretch)
        radial = flat * sloped_stretch(self.steepness, deflection)[0]
        energy = self._charged.derivatives(radial, flat)[0]
        volume = np.pi * (self.radius**2 - self.plate_radius**2) * self.thickness
        return -2 * volume * energy


@dataclass(frozen=True)
class MembraneCircle(ConeCircle):
    """A circular actuator whose film has the shape of a weightless membrane; radii R, plate r.

    Under even tension and small deflection the shape is y ln(R/ρ)/ln(R/r) at a distance ρ from the
    axis, with the slope y/(ρ ln(R/r)). Over the whole film, with any law, the energy of those
    slopes is to fourth order in y that of a volume V of film with the single slope κy:

    V [Ψ(λ_p √(1 + κ²y²), λ_p) − Ψ(λ_p, λ_p)],  V κ² = 2π z₀/ln(R/r),  κ² = (1/r² − 1/R²)/(2
    ln³(R/r)).

    Force is its derivative, for film and voltage: the voltage pulls with ½U² dC/dy. The paper's
    cone has V = 2π r z₀ l₀ and κ = 1/l₀, and a force smaller by :attr:`membrane_factor`.
    ``flat_capacitance`` [F] is that of the whole flat film. The viscous parts remain those of the
    cone, with which the paper identified their constants.
    """

    flat_capacitance: float = 0.0

    @cached_property
    def membrane_factor(self) -> Any:
        """Factor l₀/(r ln(R/r)) by which a membrane is stiffer than a cone at small deflection."""
        inner = self.plate_radius
        return (self.radius - inner) / (inner * np.log(self.radius / inner))

    @cached_property
    def gas_area(self) -> Any:
        inner, outer = self.plate_radius, self.radius
        return np.pi * (outer**2 - inner**2) / (2 * np.log(outer / inner))

    @cached_property
    def film(self) -> tuple[Any, Any]:
        inner, outer = self.plate_radius, self.radius
        logarithm = np.log(outer / inner)
        steepness = np.sqrt((inner**-2.0 - outer**-2.0) / (2 * logarithm**3))
        return steepness, 2 * np.pi * self.thickness / (logarithm * steepness**2)

    def capacitance(self, deflection: Any) -> Any:
        """Compute the film's capacitance; the voltage pulls with half its derivative times U²."""
        return self.flat_capacitance - 2 * self.electric(deflection)[0]
