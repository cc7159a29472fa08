"""Eqs. (5)–(10): masses on circles of film with weights α: forces, energy, rates, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from operator import add
from typing import Any

import numpy as np

from tympan.base.constants import EPSILON_0
from tympan.base.errors import InputError
from tympan.fem.membrane.biases import JoinedFilm
from tympan.fem.membrane.loading import Guide, Loading
from tympan.fem.membrane.quintics import QuinticCurve
from tympan.fem.rig import Rig, Supply
from tympan.geometry.outlines import area
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, solved_loading
from tympan.studies.circles import ConeCircle, radii_of

#: Tolerance of the weights' sum and of their bounds.
_SLIGHT = 1e-9
#: Step of a derivative by complex steps.
_STEP = 1e-30
#: Shortest charging time [s] that is simulated, a thousandth of the fastest swing. A film that
#: charges faster is taken as charged at once.
_AT_ONCE = 1e-6
#: Smallest voltage [V] for linearising by the square of the voltage a film that charges through a
#: resistance.
_NEARLY_NONE = 1.0
#: Largest deflection for which a joined film is solved, over its frame's half extent. Each
#: sixteenth of it takes two solutions.
_JOINED = 0.5


@dataclass(frozen=True)
class Viscous:
    """A spring k₁ [Pa] in series with a damper η₁ [Pa s], and a damper η₂ in parallel.

    Eqs. (9), (10). The values are numbers, or arrays for an array of actuators.
    """

    k1: Any
    eta1: Any
    eta2: Any

    def __post_init__(self) -> None:
        if not (min(np.min(np.real(each)) for each in (self.k1, self.eta2)) >= 0
                and np.min(np.real(self.eta1)) > 0):
            raise InputError("k1 and eta2 must not be negative, eta1 must be positive",
                             key="viscous", given=f"{self.k1}, {self.eta1}, {self.eta2}")

    @property
    def borrowed(self) -> bool:
        """Whether these are :data:`BORROWED` and not constants found for the film."""
        return self == BORROWED


#: Constants of the source paper's own film (its Table 1), borrowed for a film without constants of
#: its own. Every result that uses them says so.
BORROWED = Viscous(k1=23.5e6, eta1=177.2e6, eta2=62.4e3)


@dataclass(frozen=True, eq=False)
class Actuator:
    """The lumped model of an actuator under a mass [kg]: circles with weights α ≥ 0, Σ α = 1.

    It is one actuator, or an array of actuators of any shape. The circles and their weights are on
    the last axis of ``circles.radius`` and ``weights``. The axes before it broadcast with the
    masses, the corrections and the points given to a method. An actuator with fewer circles than
    others has further circles of weight 0. A state is (y, ẏ, ε₁ of every circle) on its last axis,
    (…, 2 + circles). A film that charges through a resistance adds its charge Q [C] at the end.
    With φ = dλ_r/dy and V = 2π r z₀ l₀ of each circle, Eq. (5) reads

    m ÿ = m g − k y − Σ α V φ/λ_r [σ_h − ε₀ε_r E² + k₁(λ_r − 1 − ε₁) + η₂ φ ẏ],

    the same as in the paper because 2π r z sin θ = V φ/λ_r. ``stiffness`` and ``permittivity``
    multiply the terms of σ_h and of E², to correct the circles for a specimen. ``gas_area`` [m²] is
    the area on which a gas below film and plate lifts the plate, by default the circles' area. The
    model includes these parts of the rig: all that acts on the plate or on the voltage at rest, all
    that damps the plate or moves with it, and all that charges the film. It leaves out friction and
    a lag of the voltage. Gas lifts the plate, but does not bulge the film.
    """

    circles: ConeCircle
    weights: Any
    mass: Any
    viscous: Viscous = BORROWED
    rig: Rig = field(default_factory=Rig)
    stiffness: Any = 1.0
    permittivity: Any = 1.0
    gas_area: Any = None

    def __post_init__(self) -> None:
        alpha = np.real(self.weights)
        if alpha.shape[-1] != self.count or alpha.min() < -_SLIGHT \
                or np.abs(alpha.sum(axis=-1) - 1).max() > _SLIGHT:
            raise InputError(f"must be {self.count} numbers from 0 that add up to 1, one for each "
                             "circle", key="weights", given=self.weights)
        if not np.all((self.moved > 0) & (self.moved <= 100)):
            raise InputError("must be above 0, at most 100 kg: the lumped model needs a mass to "
                             "move", key="mass", given=f"{np.min(self.moved):g} kg")
        if not (np.all(np.real(self.stiffness) > 0) and np.all(np.real(self.permittivity) >= 0)):
            raise InputError("stiffness must be positive, permittivity must not be negative",
                             key="correction", given=f"{self.stiffness}, {self.permittivity}")
        self._check_rig()

    def _check_rig(self) -> None:
        """Refuse rigs that circles cannot model, and mechanisms with no force at the flat film."""
        rig = self.rig
        if rig.guide == "fixed":
            raise InputError("must let the plate move: the lumped model is of its motion",
                             key="rig.guide", given=rig.guide)
        for bias, curve in zip(rig.biases, self.mechanisms, strict=True):
            if curve is None:
                raise InputError(f"the mechanism {bias.law!r} has no force at the flat film, from "
                                 "which the lumped model begins", key="rig.bias")

    @classmethod
    def of(cls, specimen: Specimen, mass: float, weights: Sequence[float] | None = None,
           viscous: Viscous | None = None, rig: Rig = Rig()) -> Actuator:
        """Make the paper's model of a specimen: one circle per semi-axis, the shortest first.

        Without ``weights`` the circles share equally (the paper's are lost).
        """
        radii = np.array(radii_of(specimen.frame))
        if weights is None or len(radii) == 1:
            weights = (1 / len(radii),) * len(radii)
        return cls(ConeCircle(specimen, radii), tuple(weights), mass, viscous or BORROWED, rig)

    @property
    def count(self) -> int:
        return int(np.shape(self.circles.radius)[-1])

    @cached_property
    def charges(self) -> bool:
        """Whether the film charges through a resistance so slowly that it must be simulated."""
        return bool(np.max(self.rig.circuit.time(self.capacitance(0.0))) > _AT_ONCE)

    @cached_property
    def _source(self) -> Supply:
        return self.rig.source

    @property
    def size(self) -> int:
        """Number of components of a state."""
        return 2 + self.count + self.charges

    @property
    def flat(self) -> Any:
        """Zero deflections [m], of the array's shape."""
        return np.zeros(np.broadcast_shapes(np.shape(self.weights)[:-1], np.shape(self.mass),
                                            np.shape(self.permittivity)))

    @property
    def moved(self) -> Any:
        """The moving mass [kg]."""
        return self.rig.moving_mass(self.mass)

    @property
    def specimen(self) -> Specimen:
        return self.circles.specimen

    @cached_property
    def plate_area(self) -> float:
        """Area of the plate [m²]."""
        return float(self.specimen.plate_area)

    @property
    def load(self) -> Any:
        """The weight, plus a pressure's force on the plate, less the lift of a gas below it [N]."""
        weight = self.rig.force(self.mass, self.plate_area if self.rig.plate_pressure else 0.0)
        if not self.rig.gas_pressure:
            return weight
        area = self.gas_area
        if area is None:
            area = np.sum(self.weights * self.circles.gas_area, axis=-1)
        return weight - self.rig.gas_pressure * area

    @cached_property
    def mechanisms(self) -> tuple[QuinticCurve | None, ...]:
        """Force curves of the rig's mechanisms; None for a mechanism without a force at 0."""
        rig = self.rig
        biases: tuple[Any, ...] = rig.biases
        return tuple(_curve(bias, self._longest, rig.guide, rig.gravity) for bias in biases)

    @property
    def _longest(self) -> float:
        """Three times the longest film [m]."""
        return 3 / float(np.min(self.circles.steepness))

    def case(self, voltage: float) -> Case:
        """Make the field model's case at a nominal voltage [V], under the largest mass."""
        return Case(self.specimen, mass=float(np.max(self.mass)), voltage=voltage, rig=self.rig)

    @property
    def label(self) -> str:
        return f"{self.specimen.name}, {1e3 * np.max(self.mass):g} g"

    @cached_property
    def reach(self) -> float:
        """Largest deflection in use [m]: three times the longest film, or where the stress ends."""
        return self._far(self._longest)

    @cached_property
    def lowest(self) -> float:
        """Lowest deflection in use [m]: 0, or below it if a mechanism or gas may lift the plate."""
        lifted = self.rig.biases or self.rig.gas_pressure > 0
        return self._far(-self._longest) if lifted else 0.0

    def _far(self, end: float) -> float:
        """Find the deflection up to which a stress exists on the way from 0 to an end [m]."""
        y = np.linspace(0, end, 2001)
        with np.errstate(all="ignore"):
            stiffness = self.elastic(y.reshape(-1, *[1] * (np.ndim(self.circles.radius) - 1)))[2]
        good = np.isfinite(stiffness).reshape(len(y), -1).all(axis=1)
        return end if good.all() else float(y[np.argmin(good) - 1])

    def elastic(self, y: Any) -> tuple[Any, Any, Any]:
        """Compute energy [J], force [N] and stiffness [N/m] of film, spring and mechanisms.

        The branches are relaxed: ε₁ = λ_r − 1.
        """
        film = self._mixed(self.circles.elastic(_each(y)), self.stiffness)
        energy, force, stiffness = map(add, film, self.beside(y))
        return energy, force, stiffness

    def beside(self, y: Any) -> tuple[Any, Any, Any]:
        """Compute energy [J], force [N] and stiffness [N/m] of the rig's spring and mechanisms."""
        k = self.rig.spring
        energy, force, stiffness = k * y * y / 2, k * y, k + 0 * y
        for curve in self.mechanisms:
            assert curve is not None
            energy, force, stiffness = map(add, (energy, force, stiffness), curve.derivatives(y))
        return energy, force, stiffness

    def electric(self, y: Any) -> tuple[Any, Any, Any]:
        """Compute the energy, force and stiffness by voltage, per V² across the film.

        Energy and force are negative.
        """
        return self._mixed(self.circles.electric(_each(y)), self.permittivity)

    def balance(self, y: Any, voltage: Any, strains: Any = None) -> tuple[Any, Any]:
        """Compute the force of film and voltage less the load [N], and its derivative by y [N/m].

        The plate does not move. The branches are relaxed, or at ``strains`` ε₁, shape (…, circles).
        """
        return self._balance(y, self.rig.film_voltage(voltage) ** 2, strains)

    def _balance(self, y: Any, squared: Any, strains: Any) -> tuple[Any, Any]:
        """Compute the balance at the square of the film's voltage [V²]."""
        force, stiffness, _ = self._relaxed(y, squared)
        if strains is None:
            return force, stiffness
        return self._crept(force, stiffness, self._branches(y, strains))

    def _relaxed(self, y: Any, squared: Any) -> tuple[Any, Any, Any]:
        """Compute the balance of relaxed branches, its derivative, and the voltage's force per V².

        ``squared`` is the square of the film's voltage [V²].
        """
        (pull, stiff), (drawn, soft) = self.circles.forces(_each(y))
        pull, stiff = (self.stiffness * self._summed(part) for part in (pull, stiff))
        drawn, soft = (self.permittivity * self._summed(part) for part in (drawn, soft))
        _, held, firm = self.beside(y)
        return pull + held + squared * drawn - self.load, stiff + firm + squared * soft, drawn

    def _crept(self, force: Any, stiffness: Any, branches: tuple[Any, Any, Any, Any, Any]
               ) -> tuple[Any, Any]:
        """Add the branches' force and stiffness to those of relaxed branches."""
        phi, _, behind, lever, change = branches
        k1 = self.viscous.k1
        return (force + k1 * (lever * behind).sum(axis=-1),
                stiffness + k1 * (change * behind + lever * phi).sum(axis=-1))

    def rest(self, y: Any, voltage: Any) -> Any:
        """Compute the state at rest at deflections [m] and a nominal voltage [V].

        The branches are relaxed.
        """
        strains = self.circles.stretch(_each(y))[0] - 1
        parts = [_each(y) + 0 * strains[..., :1], 0 * strains[..., :1], strains]
        if self.charges:
            charge = self.capacitance(y) * self.rig.film_voltage(voltage)
            parts.append(_each(charge) + 0 * parts[0])
        return np.concatenate(parts, axis=-1)

    def by_rest(self, y: Any, voltage: Any) -> Any:
        """Differentiate the state at rest by its deflection, (…, size), at a given voltage."""
        tangent = [np.ones(1), np.zeros(1), self.circles.stretch(_each(y))[1]]
        if self.charges:
            tangent.append(_each(self._capacitance_slope(y) * self.rig.film_voltage(voltage)))
        return np.concatenate(tangent, axis=-1)

    def strains(self, state: Any) -> Any:
        """Take ε₁ of every circle from states, shape (…, circles)."""
        return state[..., 2:2 + self.count]

    def film_voltage(self, state: Any, voltage: Any) -> Any:
        """Compute the voltage [V] across the film of states at a nominal voltage."""
        if self.charges:
            return state[..., -1] / self.capacitance(state[..., 0])
        return self.rig.film_voltage(voltage)

    def linear(self, state: Any, voltage: Any) -> tuple[Any, Any]:
        """Compute the time derivative of states, (…, size), and its Jacobian, (…, size, size)."""
        y, speed, strains = state[..., 0], state[..., 1], self.strains(state)
        v, circles = self.viscous, slice(2, 2 + self.count)
        branches = np.arange(2, 2 + self.count)
        crept = phi, bend, behind, lever, change = self._branches(y, strains)
        damping = self.rig.plate_damping + v.eta2 * (lever * phi).sum(axis=-1)
        film_voltage = self.film_voltage(state, voltage)
        force, by_y, drawn = self._relaxed(y, film_voltage**2)
        force, by_y = self._crept(force, by_y, crept)
        by_y = by_y + v.eta2 * speed * (change * phi + lever * bend).sum(axis=-1)
        acceleration = -(force + damping * speed) / self.moved
        rates = [_each(speed), _each(acceleration), self._creep(behind)]
        slopes = np.zeros((*np.shape(force), self.size, self.size), force.dtype)
        if self.charges:
            circuit, capacitance = self.rig.circuit, self.capacitance(y)
            source = self._source.film_voltage(voltage)
            by_charge = 1 / capacitance  # of U = Q/C
            of_y = -film_voltage * self._capacitance_slope(y) / capacitance
            by_y = by_y + 2 * film_voltage * of_y * drawn
            slopes[..., 1, -1] = -2 * film_voltage * by_charge * drawn / self.moved
            slopes[..., -1, 0] = -circuit.conductance * of_y
            slopes[..., -1, -1] = -circuit.conductance * by_charge
            rates.append(_each(circuit.current(source, film_voltage)))
        slopes[..., 0, 1] = 1.0
        slopes[..., 1, 0] = -by_y / self.moved
        slopes[..., 1, 1] = -damping / self.moved
        slopes[..., 1, circles] = lever * _each(v.k1 / self.moved)
        slopes[..., circles, 0] = self._creep(phi)
        slopes[..., branches, branches] = self._creep(-1.0)
        return np.concatenate(rates, axis=-1), slopes

    def about(self, voltage: float) -> float:
        """Find the voltage [V] about which to linearise by the square of the voltage.

        A film that charges through a resistance cannot be linearised this way at 0 V: its charge
        goes with the root of the square.
        """
        return max(abs(voltage), _NEARLY_NONE) if self.charges else voltage

    def by_voltage(self, state: Any, voltage: Any, squared: bool = False) -> Any:
        """Differentiate the rates by the voltage [1/V], or by its square, (…, size)."""
        result = np.zeros(np.shape(state))
        if self.charges:
            slope = _by_voltage(self._source.film_voltage, voltage, squared)
            result[..., -1] = slope / self.rig.series_resistance
        else:
            result[..., 1] = self.by_rest_voltage(state[..., 0], voltage, squared) / self.moved
        return result

    def by_rest_voltage(self, y: Any, voltage: Any, squared: bool = False) -> Any:
        """Differentiate the voltage's part of the load [N] by the voltage or its square."""
        return -self.electric(y)[1] * _by_voltage(
            lambda nominal: self.rig.film_voltage(nominal) ** 2, voltage, squared)

    def by_viscous(self, state: Any) -> Any:
        """Differentiate the rates by ln k₁, ln η₁ and ln η₂, shape (…, size, 3)."""
        circles = slice(2, 2 + self.count)
        phi, _, behind, lever, _ = self._branches(state[..., 0], self.strains(state))
        lever = lever / _each(self.moved)
        result = np.zeros((*np.shape(state), 3))
        result[..., 1, 0] = -self.viscous.k1 * np.sum(lever * behind, axis=-1)
        result[..., 1, 2] = -self.viscous.eta2 * state[..., 1] * np.sum(lever * phi, axis=-1)
        result[..., circles, 0] = self._creep(behind)
        result[..., circles, 1] = -self._creep(behind)
        return result

    def drag(self, state: Any) -> Any:
        """Compute the pull of each circle's branch and damper for α = 1 [N], (…, circles)."""
        y, speed, strains = state[..., 0], state[..., 1], self.strains(state)
        stretch, phi, _ = self.circles.stretch(_each(y))
        stress = (_each(self.viscous.k1) * (stretch - 1 - strains)
                  + phi * _each(self.viscous.eta2 * speed))
        return self.circles.volume * phi / stretch * stress

    def capacitance(self, y: Any) -> Any:
        """Sum α C of the circles [F] at a deflection [m]; the correction multiplies its change."""
        flat, deflected = (np.sum(self.weights * self.circles.capacitance(_each(at)), axis=-1)
                           for at in (0.0, y))
        return flat + self.permittivity * (deflected - flat)

    def _capacitance_slope(self, y: Any) -> Any:
        """Differentiate the capacitance by y [F/m]; a cone's force uses another capacitance."""
        return np.imag(self.capacitance(y + _STEP * 1j)) / _STEP

    def _branches(self, y: Any, strains: Any) -> tuple[Any, Any, Any, Any, Any]:
        """Compute φ, φ', λ_r − 1 − ε₁, α V φ/λ_r and its derivative by y, shape (…, circles)."""
        stretch, phi, bend = self.circles.stretch(_each(y))
        share = self.weights * self.circles.volume
        lever = share * phi / stretch
        change = share * (bend / stretch - (phi / stretch) ** 2)
        return phi, bend, stretch - 1 - strains, lever, change

    def _creep(self, behind: Any) -> Any:
        return _each(self.viscous.k1 / self.viscous.eta1) * behind

    def _mixed(self, parts: tuple[Any, Any, Any], factor: Any) -> tuple[Any, Any, Any]:
        energy, force, stiffness = (factor * self._summed(part) for part in parts)
        return energy, force, stiffness

    def _summed(self, part: Any) -> Any:
        """Sum the circles' values, (…, circles), with their weights α."""
        return (self.weights * part).sum(axis=-1)


def _by_voltage(of: Callable[[Any], Any], voltage: Any, squared: bool) -> Any:
    """Differentiate a function of the voltage [V] by the voltage, or by its square."""
    stepped = np.sqrt(voltage**2 + _STEP * 1j) if squared else voltage + _STEP * 1j
    return np.imag(of(stepped)) / _STEP


@lru_cache(maxsize=64)
def _curve(bias: Any, far: float, guide: Guide, gravity: float) -> QuinticCurve | None:
    """Interpolate a mechanism's force up to deflections ±``far`` [m], cached for later actuators.

    A film joined by a rod is solved on the usual mesh.
    """
    if isinstance(bias, JoinedFilm):
        far = min(far, _JOINED * max(bias.specimen.frame.semi_axes))
        bias, = solved_loading(Loading((bias,), guide=guide, gravity=gravity), Settings()).biases
    return QuinticCurve.of(bias.derivatives, -far, far, getattr(bias, "kinks", ()))


def paper_cones(specimens: Sequence[Specimen], weights: Sequence[float] | None = None,
          rig: Rig = Rig()) -> tuple[Actuator, ...]:
    """Make the paper's models of specimens, all with these weights, each under 1 kg."""
    return tuple(Actuator.of(specimen, 1.0, weights, rig=rig) for specimen in specimens)


def _each(values: Any) -> Any:
    return np.asarray(values)[..., None]


def flat_capacitance(specimen: Specimen) -> float:
    """Compute Eq. (1): ε₀ε_r S/d [F] of the flat film; d is the mounted thickness.

    The film lies between frame and plate.
    """
    film = specimen.membrane
    surface = area(specimen.frame) - specimen.plate_area
    return float(EPSILON_0 * film.relative_permittivity * surface * film.layers
                 * film.area_prestretch / film.thickness)
