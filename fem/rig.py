"""Test rig around the specimen: gravity, extra mass, spring, amplifier, displacement sensor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, is_dataclass, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Key, fields_of, number, read, takes_units, write
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Rule, Table
from tympan.fem.circuit import Circuit
from tympan.fem.membrane.biases import BIASES, Bias, JoinedFilm, Spring
from tympan.fem.membrane.loading import Guide, Loading

_GAIN: Rule = (lambda x: -1 < x < 10, "must be above -1 and below 10")
_SAG: Rule = (lambda x: x >= 1, "must be at least 1 V; inf for none")

_LEAKAGE: Rule = (lambda x: x > 0, "must be positive; inf for none")

_AIR: Rule = (lambda x: 0 <= x <= 1000, "must be from 0 (none) to 1000 kg/m^3")

_SHARE: Rule = (lambda x: 0 <= x <= 1, "must be from 0 to 1")

#: Settings of the rig that act on a plate.
_OF_PLATE = ("unaccounted_mass", "spring", "guide", "weight_offset", "plate_pressure", "biases",
             "friction", "plate_damping", "added_mass")

#: Settings whose effect depends on the direction of plate or voltage.
AGAINST_THE_WAY = ("friction", "lag_voltage")
#: Settings that only a tester that holds the plate needs.
OF_TESTER = ("gauge_zero", "gauge_gain", "displacement_zero", "tester_compliance")

#: Highest nominal voltage [V] that inputs and searches may use: no such film is tested above.
MOST_VOLTAGE = 1e6

#: Largest nominal mass [kg] of inputs and searches.
MOST_MASS = 100.0

#: Rules for loads that such a film could bear; larger ones are unit errors.
MASS_RULE: Rule = (lambda x: 0 <= x <= MOST_MASS, f"must be from 0 to {MOST_MASS:g} kg")
VOLTAGE_RULE: Rule = (lambda x: 0 <= x <= MOST_VOLTAGE,
                      f"must be from 0 to {MOST_VOLTAGE / 1e3:g} kV")

#: Rule for gas pressures. They may exceed an atmosphere: a stiff film of a few millimetres bears
#: some 10 MPa.
PRESSURES: Rule = (lambda x: -1e8 <= x <= 1e8, "must be from -100 to 100 MPa")

GAS_SIGN = ("positive gas pressure now lifts film and plate, against the weight: in files written "
            "before this version, change its sign")

#: Signs of the direction of a voltage, by its name in datasets; "" means that it is unknown.
DIRECTIONS = {"up": 1.0, "down": -1.0, "": 0.0}


#: Number of corrections of the plate's deflection in a compliant tester. Few are enough, since a
#: film's force is nearly linear.
_CORRECTIONS = 5


@takes_units
@dataclass(frozen=True)
class Rig:
    """Test rig; the default values describe an ideal rig."""

    gravity: Annotated[float, Key("fall acceleration", "acceleration", POSITIVE)] = 9.80665
    unaccounted_mass: Annotated[float, Key("on the plate beside the nominal mass", "mass")] = 0.0
    spring: Annotated[float, Key("stiffness of a spring between plate and ground",
                                 "stiffness per length", NON_NEGATIVE)] = 0.0
    amplifier_gain: Annotated[float, Key("k: the film sees (1+k) U", rule=_GAIN)] = 0.0
    sag_voltage: Annotated[float, Key("U_s: the film sees U/(1+(U/U_s)²)", "voltage", _SAG)] = inf
    sensor_gain: Annotated[float, Key("k: readings are (1+k) y", rule=_GAIN)] = 0.0
    sensor_zero: Annotated[float, Key("what the sensor shows at no deflection", "length")] = 0.0
    drift: Annotated[float, Key("how fast readings wander", "speed")] = 0.0
    guide: Annotated[Guide, Key("how the plate may move: freely, without tilting, up and down "
                                "only, not at all")] = "free"
    weight_offset: Annotated[tuple[float, float], Key(
        "where the mass hangs, from the plate's centre", "length")] = (0.0, 0.0)
    plate_pressure: Annotated[float, Key(
        "loads the plate like a weight of pressure times area", "stress")] = 0.0
    gas_pressure: Annotated[float, Key(
        "of the gas below film and plate, which follows them: positive lifts them against the "
        "weight", "stress", PRESSURES)] = 0.0
    biases: Annotated[tuple[Bias, ...], Key(
        "further mechanisms between plate and ground", name="bias", kinds=BIASES)] = ()
    lag_voltage: Annotated[float, Key("by how much the film is behind a rising or falling voltage",
                                      "voltage", NON_NEGATIVE)] = 0.0
    friction: Annotated[float, Key("by which the plate rubs against the way it came", "force",
                                   NON_NEGATIVE)] = 0.0

    plate_damping: Annotated[float, Key("of the plate's motion up and down", "damping",
                                        NON_NEGATIVE)] = 0.0
    added_mass: Annotated[float, Key("moves with the plate but does not weigh on it, such as air",
                                     "mass", NON_NEGATIVE)] = 0.0
    series_resistance: Annotated[float, Key("through which the film charges", "resistance",
                                            NON_NEGATIVE)] = 0.0
    leakage_resistance: Annotated[float, Key("between the electrodes", "resistance",
                                             _LEAKAGE)] = inf
    sensor_lag: Annotated[float, Key("in which the sensor follows, by a factor e", "time",
                                     NON_NEGATIVE)] = 0.0
    air: Annotated[float, Key("density of the still air that swings with film and plate in modes "
                              "and frequencies, on both sides, as if frame and stand were a wall; "
                              "mass for motions up and down, inertia for tilts, none for "
                              "slides; 0 for none", "density", _AIR)] = 0.0
    width_held: Annotated[float, Key("of strips in tests said to be uniaxial, how far the grips "
                                     "hold their width: 0 not at all, 1 as in pure shear",
                                     rule=_SHARE)] = 0.0
    width_let: Annotated[float, Key("of strips in tests said to be in pure shear, how far the "
                                    "grips let them narrow: 0 not at all, 1 as in a uniaxial test",
                                    rule=_SHARE)] = 0.0
    gauge_zero: Annotated[float, Key("what a tester's gauge shows at no force", "force")] = 0.0
    gauge_gain: Annotated[float, Key("k: a tester's gauge reads (1+k) F", rule=_GAIN)] = 0.0
    displacement_zero: Annotated[float, Key("what a tester's displacement shows at the flat film",
                                            "length")] = 0.0
    tester_compliance: Annotated[float, Key(
        "by which a tester yields between its own displacement and the plate", "compliance",
        NON_NEGATIVE)] = 0.0

    @classmethod
    def from_table(cls, table: Table) -> Self:
        """Read a rig from a table; every key is optional."""
        return read(cls, table)

    @classmethod
    def read(cls, file: Path | str) -> Self:
        """Read a rig from a TOML file."""
        return read(cls, Table.read(file, "rig"))

    def pressed(self, pressure: float | str | None) -> Rig:
        """Set the gas pressure below the film, if a value is given."""
        if pressure is None:
            return self
        value, (holds, words) = number(pressure, "stress", "pressure"), PRESSURES
        if not holds(value):
            raise InputError(words, key="pressure", given=pressure)
        return replace(self, gas_pressure=value)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences that belong to every result on this rig.

        The sentence about the gas is for files from before 26 November 2026, when the solver's sign
        was opposite to the documentation. It is removed with the first release.
        """
        return (GAS_SIGN,) if self.gas_pressure else ()

    @property
    def in_motion(self) -> tuple[str, ...]:
        """Sentences about the settings that a motion on this rig neglects."""
        left_out = [f"{key} of the rig changes readings at rest and is left out in time"
                    for key in AGAINST_THE_WAY if getattr(self, key)]
        if any(isinstance(bias, JoinedFilm) for bias in self.biases):
            left_out.append("the film that a rod joins to the plate follows without mass and with "
                            "relaxed branches: the mass of its plate belongs to the mass of the "
                            "load")
        return tuple(left_out)

    @property
    def loading(self) -> Loading:
        """Actions on film and plate other than force, voltage and gas pressure."""
        springs = (Spring(self.spring),) if self.spring else ()
        return Loading((*springs, *self.biases), self.weight_offset, self.guide, self.gravity)

    def require_none_of_plate(self) -> None:
        """Raise InputError if a setting acts on a plate; the film has none."""
        for name in _OF_PLATE:
            field = next(item for item in fields_of(type(self)) if item.name == name)
            if getattr(self, name) != field.default:
                raise InputError("has no place: the film has no plate", key=field.key,
                                 given=getattr(self, name))

    @property
    def circuit(self) -> Circuit:
        """Resistances between supply and film."""
        return Circuit(self.series_resistance, self.leakage_resistance)

    @property
    def source(self) -> Rig:
        """Rig without leakage: its steady film voltage is the voltage of the source in time."""
        return replace(self, leakage_resistance=inf)

    def record(self) -> dict[str, Any]:
        """Collect all settings by name, as a study stores them."""
        return {**asdict(replace(self, biases=())), "biases": [
            {"law": bias.law, **_recorded(bias)} for bias in self.biases]}

    def force(self, mass: Any, plate_area: Any = 0.0) -> Any:
        """Compute the force on the plate [N] from a nominal mass [kg] and the plate area [m²]."""
        return (mass + self.unaccounted_mass) * self.gravity + self.plate_pressure * plate_area

    def rubbed(self, force: Any, direction: Any = 0.0) -> Any:
        """Subtract friction from a force on the plate [N]; friction never changes its sign.

        ``direction`` is that of the voltage. If the voltage or the weight moves the plate down,
        friction holds it up. If the voltage falls, friction holds it down.

        Examples
        --------
        >>> [Rig(friction=0.01).rubbed(0.18, direction) for direction in (1.0, 0.0, -1.0)]
        [0.16999999999999998, 0.18, 0.19]
        """
        if isinstance(self.friction, float) and self.friction == 0:
            return force
        return _not_turned(force, force - direction * self.friction)

    def film_voltage(self, voltage: Any, direction: Any = 0.0) -> Any:
        """Compute the film's voltage [V] from a nominal one: (1+k) U/(1+(U/U_s)²) minus lag.

        A leak past the film leaves the share R_l/(R_l + R) behind the series resistance R. The lag
        never changes the sign. Arguments are numbers or arrays. ``direction`` is 1 for a rising
        voltage, -1 for a falling one, 0 if unknown.

        Examples
        --------
        >>> Rig(sag_voltage=7000.0).film_voltage(7000.0)
        3500.0
        >>> [Rig(lag_voltage=100.0).film_voltage(3000.0, direction) for direction in (1.0, -1.0)]
        [2900.0, 3100.0]
        >>> Rig(amplifier_gain=0.5).film_voltage(-1000.0)
        -1500.0
        >>> Rig(series_resistance=1e8, leakage_resistance=1e9).film_voltage(1100.0)
        1000.0
        """
        # The lag belongs to the film: it applies after the supply's effects.
        sag = voltage / self.sag_voltage
        # A product, since numbers and arrays round a power differently.
        supplied = self.circuit.share * (1 + self.amplifier_gain) * voltage / (1 + sag * sag)
        if isinstance(self.lag_voltage, float) and self.lag_voltage == 0:
            return supplied
        return _not_turned(supplied, supplied - direction * self.lag_voltage)

    @property
    def most_voltage(self) -> float:
        """Nominal voltage [V], up to :data:`MOST_VOLTAGE`, with the largest film voltage.

        An amplifier with sag has its largest output at ``sag_voltage``.
        """
        return min(self.sag_voltage, MOST_VOLTAGE)

    def most_film_voltage(self, direction: float = 0.0) -> float:
        """Compute the largest film voltage [V] over all nominal voltages."""
        return float(self.film_voltage(self.most_voltage, direction))

    def nominal_voltage(self, film_voltage: Any, direction: float = 0.0) -> Any:
        """Find the lowest nominal voltage [V] for film voltages [V], numbers or arrays.

        Infinite if no nominal voltage gives a film voltage; values that are not finite stay
        unchanged.

        Examples
        --------
        >>> Rig(sag_voltage=7000.0, amplifier_gain=0.1).film_voltage(4000.0)
        3316.923...
        >>> Rig(sag_voltage=7000.0, amplifier_gain=0.1).nominal_voltage(3316.9230769)
        3999.99...
        >>> Rig(sag_voltage=7000.0).nominal_voltage([3500.0, 3600.0])
        array([7000.,   inf])
        """
        film = np.asarray(film_voltage, dtype=float)
        supplied = (film + direction * self.lag_voltage) / self.circuit.share
        gain = 1 + self.amplifier_gain
        with np.errstate(invalid="ignore"):
            # gain U = supplied (1 + (U/U_s)²), its smaller root.
            square = gain**2 - (2 * supplied / self.sag_voltage) ** 2
            root = 2 * supplied / (gain + np.sqrt(np.maximum(square, 0.0)))
        nominal = np.where(square >= 0, root, inf)
        nominal = np.where(np.isfinite(film), nominal, film)
        return nominal if nominal.ndim else float(nominal)

    def shown_voltage(self, film_voltage: float, direction: float = 0.0) -> float:
        """Find the nominal voltage [V] that the supply displays for a film voltage [V].

        The result is limited to 0 and :attr:`most_voltage`. Rounding at the supply's largest output
        and a lag therefore cannot exceed these limits.

        Examples
        --------
        >>> Rig(sag_voltage=7000.0).shown_voltage(3500.0 * (1 + 1e-15))
        7000.0
        >>> Rig(lag_voltage=100.0).shown_voltage(50.0, direction=-1.0)
        0.0
        """
        nominal = self.nominal_voltage(film_voltage, direction)
        return float(max(min(nominal, self.most_voltage), 0.0))

    def gauged(self, force: Callable[[Any], Any], stiffness: Callable[[Any], Any],
               displacement: Any) -> Any:
        """Compute the force [N] that a tester's gauge shows at a displacement [m] that it shows.

        ``force`` and ``stiffness`` give the film's force on the plate and its slope at deflections
        of the plate. The plate is where tester and film are in equilibrium.
        """
        at, yields = displacement - self.displacement_zero, self.tester_compliance
        plate = at
        for _ in range(_CORRECTIONS if yields else 0):
            off = plate + yields * force(plate) - at
            plate = plate - off / (1 + yields * stiffness(plate))
        return (1 + self.gauge_gain) * force(plate) + self.gauge_zero

    def reading(self, deflection: Any, elapsed: Any = 0.0) -> Any:
        """Compute the sensor's reading [m] at a deflection [m] and a time since the start [s]."""
        return (1 + self.sensor_gain) * deflection + self.sensor_zero + self.drift * elapsed


def _recorded(bias: Bias) -> dict[str, Any]:
    """Collect the settings of a mechanism by name; settings that are None are omitted."""
    settings = {field.name: getattr(bias, field.name) for field in fields_of(type(bias))}
    return {name: write(value, plain=True) if is_dataclass(value) else value
            for name, value in settings.items() if value is not None}


def _not_turned(before: Any, after: Any) -> Any:
    """Return the changed value, or zero if the change reversed its sign."""
    return after * (np.real(after) * (1 - 2 * (np.real(before) < 0)) > 0)


def checked_load(mass: float, voltage: float, gas_pressure: float = 0.0) -> None:
    """Raise InputError for a load outside MASS_RULE, VOLTAGE_RULE or PRESSURES."""
    for option, load, unit, (holds, words) in (("--mass", mass, "kg", MASS_RULE),
                                               ("--voltage", voltage, "V", VOLTAGE_RULE),
                                               ("gas_pressure", gas_pressure, "Pa", PRESSURES)):
        if not holds(load):
            raise InputError(words, key=option, given=f"{load:g} {unit}")
