"""Eqs. (5)–(10): a mass on circles of film with weights α, elastic, electric and viscous; forces, energy, rates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.constants import epsilon_0

from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import area
from tympan.geometry.specimen import Specimen
from tympan.studies.circles.cone import ConeCircle, radii_of
from tympan.studies.paper.table1 import known

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Viscous:
    """A spring k₁ [Pa] in series with a damper η₁ [Pa s], both beside a damper η₂ [Pa s] (Eqs. 9, 10, figure 3)."""

    k1: float = field(default_factory=lambda: known("k_1"))
    eta1: float = field(default_factory=lambda: known("eta_1"))
    eta2: float = field(default_factory=lambda: known("eta_2"))

    def __post_init__(self) -> None:
        """Refuse what stores or dissipates a negative energy."""
        if not (min(np.real([self.k1, self.eta2])) >= 0 and np.real(self.eta1) > 0):
            raise InputError("k1 and eta2 must not be negative, eta1 must be positive",
                             key="viscous",
                             given=f"{self.k1}, {self.eta1}, {self.eta2}")


@dataclass(frozen=True)
class Correction:
    """Factors on the energies of film and voltage, where a specimen is not what its circles say.

    An electrode that leaves bands free, a plate or a prestretch that is not round, a plate off the
    centre of a single circle; or cones instead of membranes.
    """

    stiffness: float = 1.0
    permittivity: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what turns a force around."""
        if not (self.stiffness > 0 and self.permittivity >= 0):
            raise InputError("stiffness must be positive, permittivity must not be negative",
                             key="correction",
                             given=f"{self.stiffness}, {self.permittivity}")


class Circle(Protocol):
    """A circular actuator: the paper's :class:`~tympan.studies.circles.cone.ConeCircle` or one with another kinematics.

    ``steepness`` [1/m], ``volume`` [m³] and :meth:`stretch` are those of the viscous parts.
    """

    @property
    def specimen(self) -> Specimen:
        """What it is made of."""

    @property
    def radius(self) -> float:
        """Of the frame [m]."""

    @property
    def steepness(self) -> float:
        """Slope of the film over the deflection [1/m]."""

    @property
    def volume(self) -> float:
        """V [m³]."""

    def stretch(self, deflection: Any) -> tuple[Any, Any, Any]:
        """λ_r from the mounted film and its two derivatives by the deflection."""

    def elastic(self, deflection: Any) -> tuple[Any, Any, Any]:
        """Energy [J] over that of the flat film, force [N] and stiffness [N/m] at deflections [m]."""

    def electric(self, deflection: Any) -> tuple[Any, Any, Any]:
        """The same of the voltage, per V²."""

    def capacitance(self, deflection: Any) -> Any:
        """At a deflection [m], in F."""


@dataclass(frozen=True)
class Actuator:
    """The lumped model of one actuator under one mass [kg]: circles with weights α ≥ 0, Σ α = 1.

    A state is (y, ẏ, ε₁ of every circle). With φ = dλ_r/dy and V = 2π r z₀ l₀ of each circle, Eq.
    (5) reads

    m ÿ = m g − k y − Σ α V φ/λ_r [σ_h − ε₀ε_r E² + k₁(λ_r − 1 − ε₁) + η₂ φ ẏ],

    the same as in the paper because 2π r z sin θ = V φ/λ_r. ``correction`` multiplies the parts of
    σ_h and of E². Of the rig gravity, the unaccounted mass, the parallel spring and what the supply
    does to the voltage count.
    """

    circles: tuple[Circle, ...]
    weights: tuple[float, ...]
    mass: float
    viscous: Viscous = field(default_factory=Viscous)
    rig: Rig = field(default_factory=Rig)
    correction: Correction = Correction()

    def __post_init__(self) -> None:
        """Refuse what is no mixture, no mass, and what of a rig this model does not have."""
        if not len(self.weights) == len(self.circles) > 0 or min(np.real(self.weights)) < 0 \
                or abs(sum(self.weights) - 1) > 1e-9:
            raise InputError(f"must be {len(self.circles)} numbers from 0 that add up to 1, one for each circle",
                             key="weights", given=self.weights)
        if not 0 < self.moved <= 100:
            raise InputError("must be above 0, at most 100 kg: the lumped model needs a mass to move", key="mass",
                             given=f"{self.moved:g} kg")
        if self.rig.biases or self.rig.gas_pressure or self.rig.plate_pressure or self.rig.lag_voltage:
            raise InputError("the lumped model has no bias, gas or plate pressure and no lag: only gravity, "
                             "unaccounted mass, spring, amplifier, sag and sensor count", key="rig")

    @classmethod
    def of(cls, specimen: Specimen, mass: float, weights: Sequence[float] | None = None,
           viscous: Viscous | None = None, rig: Rig = Rig(), profile: float = 0.0) -> Actuator:
        """A specimen as the paper has it: one circle for each of its semi-axes, the shortest first.

        Without ``weights`` the circles share equally (the paper's are lost). ``profile`` is that of
        :class:`~tympan.studies.circles.cone.ConeCircle`.
        """
        radii = radii_of(specimen.frame)
        if weights is None or len(radii) == 1:
            weights = (1 / len(radii),) * len(radii)
        circles = tuple(ConeCircle(specimen, radius, profile) for radius in radii)
        return cls(circles, tuple(weights), mass, viscous or Viscous(), rig)

    @property
    def moved(self) -> float:
        """The mass that moves [kg]."""
        return self.mass + self.rig.unaccounted_mass

    @property
    def specimen(self) -> Specimen:
        """What the circles are made of."""
        return self.circles[0].specimen

    @property
    def load(self) -> float:
        """The weight [N]."""
        return float(self.rig.force(self.mass))

    @cached_property
    def reach(self) -> float:
        """How far the model is looked at [m]: three times the longest film, or where the law still has stress."""
        longest = 3 / min(circle.steepness for circle in self.circles)
        y = np.linspace(0, longest, 2001)
        with np.errstate(all="ignore"):
            good = np.isfinite(self.elastic(y)[2])
        return float(longest if good.all() else y[np.argmin(good) - 1])

    def elastic(self, y: Any) -> tuple[Any, Any, Any]:
        """Energy [J], force [N] and stiffness [N/m] of film and spring at deflections [m], with ε₁ = λ_r − 1."""
        k = self.rig.spring
        parts = self._mixed([circle.elastic(y) for circle in self.circles],
                            self.correction.stiffness)
        return parts[0] + k * y * y / 2, parts[1] + k * y, parts[2] + k + 0 * y

    def electric(self, y: Any) -> tuple[Any, Any, Any]:
        """The same of the voltage, per V² of the film's voltage; energy and force are negative."""
        return self._mixed([circle.electric(y) for circle in self.circles],
                           self.correction.permittivity)

    def balance(self, y: Any, voltage: Any) -> tuple[Any, Any]:
        """Film's force minus weight [N] and its stiffness [N/m] at rest, at deflections [m] and voltages [V]."""
        squared = self.rig.film_voltage(voltage) ** 2
        (_, held, stiff), (_, drawn, soft) = self.elastic(y), self.electric(y)
        return held + squared * drawn - self.load, stiff + squared * soft

    def rest(self, y: float) -> Array:
        """The state at rest at a deflection [m], its branches relaxed."""
        return np.array([y, 0.0, *(circle.stretch(y)[0] - 1 for circle in self.circles)])

    def rates(self, state: Any, voltage: Any) -> Any:
        """Time derivative of a state, shape (2 + circles,) or with further axes behind."""
        y, speed, strains = state[0], state[1], state[2:]
        v = self.viscous
        force, creep = self.balance(y, voltage)[0], []
        for weight, circle, strain in zip(self.weights, self.circles, strains, strict=True):
            stretch, phi, _ = circle.stretch(y)
            behind = stretch - 1 - strain
            force = force + weight * circle.volume * phi / stretch * (v.k1 * behind + v.eta2 * phi
                                                                      * speed)
            creep.append(v.k1 / v.eta1 * behind)
        return np.array([speed, -force / self.moved, *creep])

    def jacobian(self, state: Any, voltage: Any) -> Any:
        """Derivative of :meth:`rates` by the state, shape (2 + circles,) twice, and the further axes of the state."""
        return self.linear(state, voltage)[1]

    def linear(self, state: Any, voltage: Any) -> tuple[Any, Any]:
        """:meth:`rates` and their derivative by the state, for the price of one."""
        y, speed, strains = state[0], state[1], state[2:]
        v, size = self.viscous, 2 + len(self.circles)
        result = np.zeros((size, size, *np.shape(y)), dtype=np.result_type(state, voltage, 0.0))
        result[0, 1] = 1.0
        (force, by_y), by_speed, creep = self.balance(y, voltage), 0.0, []
        for number, (weight, circle, strain) in enumerate(zip(self.weights, self.circles, strains,
                                                              strict=True), 2):
            stretch, phi, bend = circle.stretch(y)
            lever = weight * circle.volume * phi / stretch
            change = weight * circle.volume * (bend / stretch - (phi / stretch) ** 2)
            behind = stretch - 1 - strain
            stress = v.k1 * behind + v.eta2 * phi * speed
            force = force + lever * stress
            by_y = by_y + change * stress + lever * (v.k1 * phi + v.eta2 * bend * speed)
            by_speed = by_speed + lever * v.eta2 * phi
            creep.append(v.k1 / v.eta1 * behind)
            result[1, number] = lever * v.k1 / self.moved
            result[number, 0], result[number, number] = v.k1 / v.eta1 * phi, -v.k1 / v.eta1
        result[1, 0], result[1, 1] = -by_y / self.moved, -by_speed / self.moved
        return np.array([speed, -force / self.moved, *creep]), result

    def by_voltage(self, state: Any, voltage: float) -> Any:
        """Derivative of :meth:`rates` by the voltage [1/V], shape (2 + circles,)."""
        step = 1e-30
        moved: Any = voltage + 1j * step
        squared = np.imag(self.rig.film_voltage(moved) ** 2) / step
        result = np.zeros(2 + len(self.circles))
        result[1] = -squared * self.electric(state[0])[1] / self.moved
        return result

    def by_viscous(self, state: Any) -> Any:
        """Derivatives of :meth:`rates` by ln k₁, ln η₁ and ln η₂, shape (2 + circles, 3, …)."""
        y, speed, strains = state[0], state[1], state[2:]
        v = self.viscous
        result = np.zeros((2 + len(self.circles), 3, *np.shape(y)))
        for number, (weight, circle, strain) in enumerate(zip(self.weights, self.circles, strains,
                                                              strict=True), 2):
            stretch, phi, _ = circle.stretch(y)
            lever = weight * circle.volume * phi / stretch / self.moved
            behind = v.k1 * (stretch - 1 - strain)
            result[1, 0] -= lever * behind
            result[1, 2] -= lever * v.eta2 * phi * speed
            result[number, 0], result[number, 1] = behind / v.eta1, -behind / v.eta1
        return result

    def energy(self, state: Any, voltage: Any) -> Any:
        """Free energy [J] of a state at a held voltage: motion, weight, film, spring, branches and voltage.

        What the model's own forces derive from. A branch stores V k₁ (1 + ε₁)(x − 1 − ln x), x =
        λ_r/(1 + ε₁): the energy whose derivative by y is its force in Eq. (5), and which Eq. (9)
        can only lower. So at a constant voltage this never grows; the damper η₂ lowers it further
        by V η₂ λ̇_r²/λ_r.
        """
        y, speed, strains = state[0], state[1], state[2:]
        squared = self.rig.film_voltage(voltage) ** 2
        total = self.moved * speed**2 / 2 - self.load * y + self.elastic(y)[0] + squared * self.electric(y)[0]
        for weight, circle, strain in zip(self.weights, self.circles, strains, strict=True):
            x = circle.stretch(y)[0] / (1 + strain)
            total = total + weight * circle.volume * self.viscous.k1 * (1 + strain) * (x - 1
                                                                                       - np.log(x))
        return total

    def capacitance(self, y: Any) -> Any:
        """Σ α C of the circles [F] at a deflection [m], the factor on the voltage's energy on its change."""
        pairs = tuple(zip(self.weights, self.circles, strict=True))
        flat, now = (sum(weight * circle.capacitance(at) for weight, circle in pairs)
                     for at in (0.0, y))
        return flat + self.correction.permittivity * (now - flat)

    def _mixed(self, parts: Sequence[tuple[Any, Any, Any]], factor: float) -> tuple[Any, Any, Any]:
        weighted = [[factor * weight * one for one in part]
                    for weight, part in zip(self.weights, parts, strict=True)]
        energy, force, stiffness = (sum(column) for column in zip(*weighted, strict=True))
        return energy, force, stiffness


def flat_capacitance(specimen: Specimen) -> float:
    """Eq. (1): ε₀ε_r S/d [F] of the flat film between frame and plate, d the mounted thickness.

    Examples
    --------
    >>> from tympan.studies.paper.table1 import paper_actuators
    >>> [round(1e12 * flat_capacitance(one)) for one in paper_actuators(4.7)]
    [1258, 1700, 2141]
    """
    film = specimen.membrane
    surface = area(specimen.frame) - area(specimen.plate.outline)
    return float(epsilon_0 * film.relative_permittivity * surface * film.area_prestretch
                 / film.thickness)


def stored_energy(capacitance: float, voltage: float) -> float:
    """½ C u² [J] of Eq. (1)'s text."""
    return capacitance * voltage**2 / 2
