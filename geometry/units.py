"""Quantities with units at the border; SI floats inside."""

from __future__ import annotations

import re
from functools import cache
from typing import TYPE_CHECKING

from tympan.geometry.errors import InputError

if TYPE_CHECKING:
    import pint

#: What may be asked of a quantity: its name, the SI unit the code uses inside, and an example for
#: messages.
DIMENSIONS: dict[str, tuple[str, str]] = {
    "length": ("m", "1 mm"),
    "mass": ("kg", "17.9 g"),
    "stress": ("Pa", "16 kPa"),
    "voltage": ("V", "3.5 kV"),
    "acceleration": ("m/s^2", "9.80665 m/s^2"),
    "stiffness per length": ("N/m", "5 N/m"),
    "density": ("kg/m^3", "960 kg/m^3"),
    "force": ("N", "0.2 N"),
    "field": ("V/m", "30 MV/m"),
    "speed": ("m/s", "1 um/min"),
    "time": ("s", "30 s"),
    "viscosity": ("Pa s", "62.4 kPa s"),
    "capacitance": ("F", "800 pF"),
    "angle": ("rad", "5 mrad"),
}

METRE = 1e3  #: in cadquery's model unit, the millimetre

_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?inf)\s*(.*?)\s*",
                       re.ASCII)


@cache
def _registry() -> pint.UnitRegistry:
    import pint

    return pint.UnitRegistry()


@cache
def _factor(unit: str, dimension: str) -> float:
    """SI value of one ``unit``; raises pint's errors when it is no unit or of another dimension."""
    registry = _registry()
    return float(registry.Quantity(1.0, registry.Unit(unit)).to(DIMENSIONS[dimension][0]).magnitude)


def quantity(text: object, dimension: str) -> float:
    """The SI value of a quantity written as number and unit.

    Parameters
    ----------
    text
        Such as ``"4.5 cm"``; any unit pint knows, also compound ones (``"20 g/mm/s^2"`` is a
        stress).
    dimension
        A key of :data:`DIMENSIONS`.

    Raises
    ------
    InputError
        When the unit is missing, unknown or of another dimension, or the number cannot be read.

    Examples
    --------
    >>> quantity("4.5 cm", "length"), quantity("20 g/mm/s^2", "stress"), quantity("inf kV", "voltage")
    (0.045, 20.0, inf)
    """
    import pint

    _, example = DIMENSIONS[dimension]
    allowed = f'must be a {dimension} with its unit, such as "{example}"'
    if not isinstance(text, str):
        raise InputError(f"has no unit: {allowed}", given=text)
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise InputError(allowed, given=text)
    number, unit = match.groups()
    if not unit:
        raise InputError(f"has no unit: {allowed}", given=text)
    try:
        return float(number) * _factor(unit, dimension)
    except pint.DimensionalityError:
        raise InputError(f"wrong dimension: {allowed}", given=text) from None
    except Exception:  # pint's parser raises whatever its tokeniser, evaluator or assertions raise
        raise InputError(f"unknown unit: {allowed}", given=text) from None


def unit_factor(unit: str, dimension: str) -> float:
    """The SI value of one ``unit``, a name of letters only.

    Raises
    ------
    InputError
        When it is no unit, or one of another dimension.

    Examples
    --------
    >>> unit_factor("kV", "voltage"), unit_factor("min", "time")
    (1000.0, 60.0)
    """
    import pint

    example = DIMENSIONS[dimension][1].split()[1]
    try:
        if not unit.isalpha():
            raise ValueError
        return _factor(unit, dimension)
    except pint.DimensionalityError:
        raise InputError(f"wrong dimension: must be a unit of {dimension}, such as {example}",
                         given=unit) from None
    except Exception:  # as in quantity()
        raise InputError(f"unknown unit: must be a unit of {dimension}, such as {example}",
                         given=unit) from None
