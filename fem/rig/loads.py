"""Actions on plate and film: masses, spring, mechanisms, guide, friction, gas, air."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Self

from tympan.base.constants import STANDARD_GRAVITY
from tympan.base.errors import InputError
from tympan.base.fields import Key, changed, number, takes_units
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Rule
from tympan.fem.membrane.biases import BIASES, Bias, Spring
from tympan.fem.membrane.loading import Guide, Loading
from tympan.fem.rig.direction import HYSTERESIS, not_turned

_AIR: Rule = (lambda x: 0 <= x <= 1000, "must be from 0 (none) to 1000 kg/m^3")

#: Largest nominal mass [kg] of inputs and searches.
MOST_MASS = 100.0

#: Rule for masses that such a film could bear; larger ones are unit errors.
MASS_RULE: Rule = (lambda x: 0 <= x <= MOST_MASS, f"must be from 0 to {MOST_MASS:g} kg")

#: Rule for gas pressures. They may exceed an atmosphere: a stiff film of a few millimetres bears
#: some 10 MPa.
PRESSURES: Rule = (lambda x: -1e8 <= x <= 1e8, "must be from -100 to 100 MPa")

GAS_SIGN = ("positive gas pressure now lifts film and plate, against the weight: in files written "
            "before this version, change its sign")


@takes_units
@dataclass(frozen=True, kw_only=True)
class Ambient:
    """Gravity, gas and air; they act on a film without plate, too."""

    gravity: Annotated[float, Key("fall acceleration", "acceleration", POSITIVE)] = STANDARD_GRAVITY
    gas_pressure: Annotated[float, Key(
        "of the gas below film and plate, which follows them: positive lifts them against the "
        "weight", "stress", PRESSURES)] = 0.0
    air: Annotated[float, Key("density of the still air that swings with film and plate in modes "
                              "and frequencies, on both sides, as if frame and stand were a wall; "
                              "mass for motions up and down, inertia for tilts, none for "
                              "slides; 0 for none", "density", _AIR)] = 0.0

    def pressed(self, pressure: float | str | None) -> Self:
        """Set the gas pressure below the film, if a value is given."""
        if pressure is None:
            return self
        value, (holds, words) = number(pressure, "stress", "pressure"), PRESSURES
        if not holds(value):
            raise InputError(words, key="pressure", given=pressure)
        return replace(self, gas_pressure=value)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences that belong to every result in this gas.

        The sentence about the gas is for files from before 26 November 2026, when the solver's sign
        was opposite to the documentation. It is removed with the first release.
        """
        return (GAS_SIGN,) if self.gas_pressure else ()


@takes_units
@dataclass(frozen=True, kw_only=True)
class PlateLoads:
    """Actions on a plate; a film without plate has none of them."""

    unaccounted_mass: Annotated[float, Key("on the plate beside the nominal mass", "mass")] = 0.0
    spring: Annotated[float, Key("stiffness of a spring between plate and ground",
                                 "stiffness per length", NON_NEGATIVE)] = 0.0
    guide: Annotated[Guide, Key("how the plate may move: freely, without tilting, up and down "
                                "only, not at all")] = "free"
    weight_offset: Annotated[tuple[float, float], Key(
        "where the mass hangs, from the plate's centre", "length")] = (0.0, 0.0)
    plate_pressure: Annotated[float, Key(
        "loads the plate like a weight of pressure times area", "stress")] = 0.0
    biases: Annotated[tuple[Bias, ...], Key(
        "further mechanisms between plate and ground", name="bias", kinds=BIASES)] = ()
    friction: Annotated[float, Key("by which the plate rubs against the way it came", "force",
                                   NON_NEGATIVE), HYSTERESIS] = 0.0
    plate_damping: Annotated[float, Key("of the plate's motion up and down", "damping",
                                        NON_NEGATIVE)] = 0.0
    added_mass: Annotated[float, Key("moves with the plate but does not weigh on it, such as air",
                                     "mass", NON_NEGATIVE)] = 0.0

    def require_no_plate_loads(self) -> None:
        """Raise InputError if a setting acts on a plate; the film has none."""
        for field in changed(self, PlateLoads):
            raise InputError("has no place: the film has no plate", key=field.key,
                             given=getattr(self, field.name))

    def moving_mass(self, mass: Any) -> Any:
        """Compute the mass that moves with the plate [kg] from a nominal mass [kg]."""
        return mass + self.unaccounted_mass + self.added_mass

    def rubbed(self, force: Any, direction: Any = 0.0) -> Any:
        """Subtract friction from a force on the plate [N]; friction never changes its sign.

        ``direction`` is that of the voltage. If the voltage or the weight moves the plate down,
        friction holds it up. If the voltage falls, friction holds it down.

        Examples
        --------
        >>> [PlateLoads(friction=0.01).rubbed(0.18, direction) for direction in (1.0, 0.0, -1.0)]
        [0.16999999999999998, 0.18, 0.19]
        """
        if isinstance(self.friction, float) and self.friction == 0:
            return force
        return not_turned(force, force - direction * self.friction)


@takes_units
@dataclass(frozen=True, kw_only=True)
class Loads(PlateLoads, Ambient):
    """Actions on plate and film other than nominal mass and voltage."""

    @property
    def loading(self) -> Loading:
        """Actions on film and plate other than force, voltage and gas pressure."""
        springs = (Spring(self.spring),) if self.spring else ()
        return Loading((*springs, *self.biases), self.weight_offset, self.guide, self.gravity)

    def force(self, mass: Any, plate_area: Any = 0.0) -> Any:
        """Compute the force on the plate [N] from a nominal mass [kg] and the plate area [m²]."""
        return (mass + self.unaccounted_mass) * self.gravity + self.plate_pressure * plate_area

    def nominal_mass(self, force: Any, plate_area: Any = 0.0) -> Any:
        """Find the nominal mass [kg] whose :meth:`force` on the plate is a force [N].

        Examples
        --------
        >>> Loads(unaccounted_mass=1e-3).nominal_mass(Loads(unaccounted_mass=1e-3).force(0.25))
        0.25
        """
        return (force - self.force(0.0, plate_area)) / self.gravity
