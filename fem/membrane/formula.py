"""A film in closed form: its energy as a formula of the plate's deflection and of the voltage.

A formula takes the place of the finite elements (:class:`FormulaFilm`). It has no unknowns of its
own, so its mesh has no elements: one node, the plate's centre, which moves along the load. All
equations of film, plate and rig stay those of :class:`~tympan.fem.membrane.model.Model`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.sparse import csc_matrix

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.fields import Registry
from tympan.base.plugins import load_later
from tympan.fem.complex_step import complex_step
from tympan.fem.discretisation.discretisation import Discretisation
from tympan.fem.membrane.loading import GUIDES
from tympan.fem.membrane.model import Linearised, Model, Sampled, cauchy_green
from tympan.fem.membrane.state import HEAVE, State
from tympan.geometry.outlines import area
from tympan.geometry.specimen import Specimen

#: Step of a difference between deflections, over the gap between plate and frame, and between U²,
#: over U² or 1 V². The error of the four-point difference is the step's fourth power over 30,
#: 3e-14, and rounding 1e-13.
_STEP = 1e-3

#: Weights of a four-point difference at the steps of :data:`_PLACES`.
_WEIGHTS = np.array([1.0, -8.0, 8.0, -1.0]) / 12
_PLACES = np.array([-2.0, -1.0, 1.0, 2.0])


@dataclass(frozen=True, eq=False)
class Formula:
    """A film in closed form, registered under its ``name``, which :data:`FORMULAS` lists.

    All functions work on arrays, also of complex numbers, and on specimens with arrays in place of
    numbers. They use analytic operations alone: no ``abs``, no ``max``.

    ``energy(specimen, deflection, squared)``: energy of the whole film at constant voltage [J],
    counted from the virgin film: what it stores less C U²/2. ``squared`` is U² [V²].
    ``volume(specimen, deflection)``: volume between the flat and the deflected film and plate [m³],
    positive for a positive deflection; a film above gas needs it.
    ``stretches(specimen, deflection)``: both principal stretches from the virgin film at its most
    strained place, under the electrode. They give it stresses, a field, and the limits that depend
    on them.
    """

    name: str
    energy: Callable[[Any, Any, Any], Any]
    volume: Callable[[Any, Any], Any] | None = None
    stretches: Callable[[Any, Any], tuple[Any, Any]] | None = None


@dataclass(frozen=True, eq=False)
class Derived:
    """Derivatives of a formula for a specimen, or for several with arrays in place of numbers.

    The first ones are exact, by the complex step, unless the specimen or the loads have an
    imaginary step of their own. These, and those again by the deflection, are differences of four
    values, with errors of 1e-12. ``step`` is between deflections [m].
    """

    formula: Formula
    specimen: Any
    step: Any

    def energy(self, deflection: Any, squared: Any) -> Any:
        """Compute the energy at constant voltage [J].

        Raises
        ------
        InputError
            If the formula fails, as for a law that it does not know.
        """
        try:
            return self.formula.energy(self.specimen, deflection, squared)
        except Exception as error:  # a user's function may raise anything
            raise InputError("has no energy of this specimen: "
                             f"{type(error).__name__}: {error}", key="formula",
                             given=self.formula.name) from error

    def force(self, deflection: Any, squared: Any) -> Any:
        """Differentiate the energy by the deflection [N]."""
        return self._first(lambda place: self.energy(place, squared), deflection)

    def stiffness(self, deflection: Any, squared: Any) -> Any:
        """Differentiate the force by the deflection [N/m]."""
        return _slope(lambda place: self.force(place, squared), deflection, self.step)

    def capacitance(self, deflection: Any, squared: Any) -> Any:
        """Compute −2 ∂energy/∂U² [F]."""
        def charged(value: Any) -> Any:
            return self.energy(deflection, value)

        if np.iscomplexobj(charged(squared)):
            step = _STEP * np.maximum(np.abs(np.real(squared)), 1.0)
            return -2 * _slope(charged, squared, step)
        return -2 * complex_step(charged, squared)

    def by_voltage(self, deflection: Any, squared: Any) -> Any:
        """Differentiate the force by U² [N/V²]."""
        return -_slope(lambda place: self.capacitance(place, squared), deflection, self.step) / 2

    def volume(self, deflection: Any) -> Any:
        """Compute the volume between the flat and the deflected film and plate [m³].

        Raises
        ------
        InputError
            If the formula has no volume.
        """
        if self.formula.volume is None:
            raise InputError(f"must be 0: the film {self.formula.name!r} has no formula of the "
                             "volume below it", key="rig.gas_pressure")
        return self.formula.volume(self.specimen, deflection)

    def swept(self, deflection: Any) -> Any:
        """Differentiate the volume by the deflection [m²]."""
        return self._first(self.volume, deflection)

    def widening(self, deflection: Any) -> Any:
        """Differentiate the volume by the deflection twice [m]."""
        return _slope(self.swept, deflection, self.step)

    def _first(self, function: Callable[[Any], Any], deflection: Any) -> Any:
        if np.iscomplexobj(function(deflection)):
            return _slope(function, deflection, self.step)
        return complex_step(function, deflection)


def _slope(function: Callable[[Any], Any], at: Any, step: Any) -> Any:
    """Differentiate a function by differences of four values."""
    return sum(weight * function(at + place * step)
               for weight, place in zip(_WEIGHTS, _PLACES, strict=True)) / step


#: Films in closed form by name.
FORMULAS: Registry[Formula] = Registry("name")


@dataclass(frozen=True, eq=False)
class FormulaFilm(Model):
    """A specimen whose film is a ``formula`` of the plate's deflection, and its surroundings.

    It has no elements: no fields, no wrinkles, no mass and weight of its own. Its plate moves along
    the load alone.
    """

    formula: Formula = field(kw_only=True)
    step: float = field(kw_only=True)  #: of differences between deflections [m]

    @classmethod
    def of(cls, formula: Formula, specimen: Specimen) -> Self:
        """Make the film of a specimen.

        Raises
        ------
        InputError
            If the specimen has no plate, or a film with viscous branches.
        """
        specimen.needed_plate()
        if specimen.membrane.branches:
            raise InputError(f"must not be there: the film {formula.name!r} has a formula of its "
                             "energy, no memory", key="membrane.branches")
        return cls(Discretisation.of_plate(specimen.centre), specimen, formula=formula,
                   step=step_of(specimen))

    def __post_init__(self) -> None:
        super().__post_init__()
        if any(np.real(self.loading.arm)):
            raise InputError(f"must be 0, 0: the plate of the film {self.formula.name!r} moves "
                             "along the load alone, so it cannot tilt", key="rig.weight_offset",
                             given=self.loading.arm)

    @cached_property
    def plate_freedoms(self) -> tuple[int, ...]:
        return (HEAVE,) if "z" in GUIDES[self.loading.guide] else ()

    @property
    def bears_gas(self) -> bool:
        return self.formula.volume is not None

    @property
    def covered(self) -> Any:
        """1: a formula has the strains of one place, under the electrode."""
        return 1.0

    @property
    def shares(self) -> Any:
        """1: a formula has the strains of one place, under an electrode in one piece."""
        return 1.0

    @property
    def relative_thickness(self) -> Any:
        """1: a formula has the strains of one place, of the stated thickness."""
        return 1.0

    @property
    def volumes(self) -> AnyArray:
        """No volume: the energy is the formula's, not a sum over points."""
        return np.zeros(self._places_count)

    @property
    def _places_count(self) -> int:
        return 0 if self.formula.stretches is None else 1

    def sampled(self, states: Sequence[State], cells: AnyArray, points: AnyArray) -> Sampled:
        """Deform the film at its most strained place in each state; nowhere without stretches."""
        count = self._places_count
        flat = np.tile(self.discretisation.reference, (len(states), 1))
        positions = np.array([state.positions[0] for state in states])
        deformations = np.array([self._deformation(state.positions) for state in states])
        every = slice(len(states) * count)
        return Sampled(flat[every], positions[every], deformations.reshape(-1, 3, 2)[every],
                       np.ones(len(states) * count))

    def _deformation(self, positions: AnyArray) -> AnyArray:
        """Compute F from the mounted film at the most strained place, (places, 3, 2)."""
        result = np.zeros((self._places_count, 3, 2), dtype=positions.dtype)
        if self.formula.stretches is not None:
            first, second = self.specimen.membrane.prestretch
            along, across = self.formula.stretches(self.specimen, positions[0, HEAVE])
            result[0, 0, 0], result[0, 1, 1] = along / first, across / second
        return result

    def cauchy_green(self, positions: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
        return cauchy_green(self._deformation(positions))

    @property
    def mass_and_volume(self) -> tuple[float, float]:
        flat = area(self.specimen.frame) - self.plate_area
        return flat * self.mass_per_area, flat * self.specimen.membrane.volume_per_area

    def least_stress(self, state: State) -> float | None:
        """Return None: the least stress follows from the fields, if the formula has stretches."""
        return None

    def thinning_margin(self, state: State) -> float:
        """Infinite: a formula has no wrinkles that could thin."""
        return np.inf

    def residual_share(self, state: State) -> float:
        """0: what a formula stores, it stores by its own tension."""
        return 0.0

    def energy(self, positions: AnyArray, voltage_squared: Any) -> Any:
        return self._derived.energy(positions[0, HEAVE], voltage_squared)

    def forces(self, positions: AnyArray, voltage_squared: Any) -> AnyArray:
        return _along(self._derived.force(positions[0, HEAVE], voltage_squared))

    def capacitance(self, state: State) -> Any:
        return self._derived.capacitance(_place(state), state.voltage_squared)

    def integrals(self, states: Sequence[State]) -> tuple[AnyArray, AnyArray, AnyArray]:
        rows = [(self.reaction(state), self.capacitance(state),
                 self.energy(state.positions, state.voltage_squared)) for state in states]
        reaction, capacitance, energy = np.array(rows).reshape(-1, 3).T
        return reaction, capacitance, energy

    def linearised(self, state: State) -> Linearised:
        forces = self.nodal_forces(state)
        stiffness = self._derived.stiffness(_place(state), state.voltage_squared)
        if state.pressure:
            stiffness = stiffness + state.pressure * self._derived.widening(_place(state))
        count = len(self.plate_freedoms)
        return Linearised(forces, csc_matrix((0, 0)), np.zeros((0, count)),
                          np.full((count, count), stiffness) + self.plate_curvature(forces, state))

    def gas_volume(self, state: State) -> Any:
        """Compute the volume below the film alone [m³]: without that below the plate."""
        return self.plate_area * _place(state) - self._derived.volume(_place(state))

    def _volume_forces(self, state: State) -> AnyArray:
        return _along(self.plate_area - self._derived.swept(_place(state)))

    def _electric_forces(self, state: State) -> AnyArray:
        return _along(self._derived.by_voltage(_place(state), state.voltage_squared))

    @cached_property
    def _derived(self) -> Derived:
        return Derived(self.formula, self.specimen, self.step)


def step_of(specimen: Specimen) -> float:
    """Choose the step of differences between deflections of a specimen's plate [m]."""
    return _STEP * specimen.gap


def _place(state: State) -> Any:
    """Read the deflection [m], which may have an imaginary step."""
    return state.positions[0, HEAVE]


def _along(force: Any) -> AnyArray:
    """Make the nodal forces of the plate's centre, (1, 3), of a force along the load."""
    forces = np.zeros((1, 3), dtype=np.result_type(force))
    forces[0, HEAVE] = force
    return forces


load_later("tympan.formulas", FORMULAS)
