"""The whole rig: the sum of its records, in one file with flat keys."""

from __future__ import annotations

from dataclasses import asdict, dataclass, is_dataclass, replace
from pathlib import Path
from typing import Any, Self

from tympan.base.errors import InputError
from tympan.base.fields import changed, fields_of, read, takes_units, write
from tympan.base.toml_reader import Table
from tympan.fem.membrane.biases import Bias, JoinedFilm
from tympan.fem.rig.direction import HYSTERESIS
from tympan.fem.rig.grips import Grips
from tympan.fem.rig.loads import MASS_RULE, PRESSURES, Loads
from tympan.fem.rig.sensor import Sensor
from tympan.fem.rig.supply import VOLTAGE_RULE, Supply
from tympan.fem.rig.tester import Tester


# The fields of the last base come first in files.
@takes_units
@dataclass(frozen=True, kw_only=True)
class Rig(Grips, Tester, Sensor, Supply, Loads):
    """Test rig; the default values describe an ideal rig."""

    @classmethod
    def from_table(cls, table: Table) -> Self:
        """Read a rig from a table; every key is optional."""
        return read(cls, table)

    @classmethod
    def read(cls, file: Path | str) -> Self:
        """Read a rig from a TOML file."""
        return read(cls, Table.read(file, "rig"))

    @property
    def hysteresis(self) -> tuple[str, ...]:
        """Names of the settings in use whose effect depends on the direction."""
        return tuple(field.name for field in changed(self) if HYSTERESIS in field.marks)

    @property
    def in_motion(self) -> tuple[str, ...]:
        """Sentences about the settings that a motion on this rig neglects."""
        left_out = [f"{key} of the rig changes readings at rest and is left out in time"
                    for key in self.hysteresis]
        if any(isinstance(bias, JoinedFilm) for bias in self.biases):
            left_out.append("the film that a rod joins to the plate follows without mass and with "
                            "relaxed branches: the mass of its plate belongs to the mass of the "
                            "load")
        return tuple(left_out)

    def record(self) -> dict[str, Any]:
        """Collect all settings by name, as a study stores them."""
        return {**asdict(replace(self, biases=())), "biases": [
            {"law": bias.law, **_recorded(bias)} for bias in self.biases]}


def _recorded(bias: Bias) -> dict[str, Any]:
    """Collect the settings of a mechanism by name; settings that are None are omitted."""
    settings = {field.name: getattr(bias, field.name) for field in fields_of(type(bias))}
    return {name: write(value, plain=True) if is_dataclass(value) else value
            for name, value in settings.items() if value is not None}


def checked_load(mass: float, voltage: float, gas_pressure: float = 0.0) -> None:
    """Raise InputError for a load outside MASS_RULE, VOLTAGE_RULE or PRESSURES."""
    for option, load, unit, (holds, words) in (("--mass", mass, "kg", MASS_RULE),
                                               ("--voltage", voltage, "V", VOLTAGE_RULE),
                                               ("gas_pressure", gas_pressure, "Pa", PRESSURES)):
        if not holds(load):
            raise InputError(words, key=option, given=f"{load:g} {unit}")
