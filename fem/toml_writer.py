"""Specimens and rigs as TOML that ``solve`` takes and that reads back equal."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from tympan.fem.film.laws import STRETCH_RANGE, inadmissible_stretch
from tympan.fem.film.laws.scaled import STRESSES
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_writer import law_content, quantity_text, specimen_content, toml

#: Dimensions of the constants of laws and of bias mechanisms; a constant that is not here is a
#: plain number.
_LAWS = dict.fromkeys(STRESSES, "stress")
_BIASES = {"stiffness": "stiffness per length", "rest": "length", "force": "force", "gap": "length",
           "decay": "length"}

#: Dimensions of the keys of a rig file.
_RIG = {"gravity": "acceleration", "unaccounted_mass": "mass", "spring": "stiffness per length",
        "sag_voltage": "voltage", "sensor_zero": "length", "drift": "speed",
        "weight_offset": "length",
        "plate_pressure": "stress", "gas_pressure": "stress", "lag_voltage": "voltage"}

#: Ranges of stretch to state for a law that is not admissible over all of them, the widest first.
_RANGES = (STRETCH_RANGE, (0.7, 5.0), (0.8, 4.0), (1.0, 4.0), (1.0, 3.0), (1.0, 2.5), (1.0, 2.0),
           (1.0, 1.5))


def specimen_to_toml(specimen: Specimen) -> str:
    """A specimen file; :func:`tympan.fem.film.library.load_specimen` reads the equal specimen from it.

    Raises
    ------
    InputError
        When the material is not admissible over any range that holds the prestretch, so that no
        file can state it.
    """
    return toml(specimen_content(specimen, _material))


def rig_to_toml(rig: Rig) -> str:
    """A rig file; :meth:`tympan.fem.rig.Rig.read` reads the equal rig from it.

    Examples
    --------
    >>> print(rig_to_toml(Rig(spring=5.0)).splitlines()[2])
    spring = "5 N/m"
    """
    content = {item.name: _rig_value(item.name, getattr(rig, item.name))
               for item in fields(rig) if item.name != "biases"}
    return toml({**content, "bias": [law_content(bias, _BIASES) for bias in rig.biases]}
                if rig.biases else content)


def _rig_value(name: str, value: Any) -> Any:
    if isinstance(value, str):
        return value
    if isinstance(value, tuple):
        return [quantity_text(item, _RIG[name]) for item in value]
    return quantity_text(value, _RIG[name]) if name in _RIG else float(value)


def _material(specimen: Specimen) -> dict[str, Any]:
    """The table of a film's material, with ``range`` where the law is not admissible over the usual one."""
    material, most = specimen.membrane.material, max(specimen.membrane.prestretch)
    for low, high in _RANGES:
        if high > most and inadmissible_stretch(material, low, high) is None:
            table = law_content(material, _LAWS)
            return table if (low, high) == STRETCH_RANGE else {**table, "range": [low, high]}
    raise InputError("cannot be written as a specimen file: true stress falls with stretch near the prestretch",
                     key="membrane.material", given=str(material))
