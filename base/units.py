"""Quantities with units at the border; SI floats inside."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from math import floor, log10, pi
from typing import Any

from tympan.base.errors import InputError, did_you_mean


@dataclass(frozen=True)
class Dimension:
    """Dimension of a quantity, with its units.

    ``si`` is the unit the code uses inside, ``example`` one for messages, ``usual`` the units
    people write, the preferred one first; ``tabled`` that of tables, where it is not ``si``.
    """

    si: str
    example: str
    usual: tuple[str, ...] = ()
    tabled: str = ""

    @property
    def symbol(self) -> str:
        """The SI unit for people: "kg/m³"."""
        return self.si.replace("^2", "²").replace("^3", "³")

    @property
    def suffix(self) -> str:
        """The SI unit as the end of a name: "_kg_per_m3"."""
        return suffix_of(self.si)

    @property
    def table_unit(self) -> str:
        """The unit of its numbers in tables: "mm"."""
        return self.tabled or self.si


def suffix_of(si: str) -> str:
    """Write an SI unit as the end of a name: "_kg_per_m3"; nothing for "1", of plain numbers."""
    return "" if si == "1" else "_" + si.replace("/", "_per_").replace("^", "").replace(" ", "_")


DIMENSIONS: dict[str, Dimension] = {
    "length": Dimension("m", "1 mm", ("mm", "um"), "mm"),
    "mass": Dimension("kg", "17.9 g", ("g",), "g"),
    "stress": Dimension("Pa", "16 kPa", ("kPa",), "kPa"),
    "voltage": Dimension("V", "3.5 kV", ("kV",), "kV"),
    "acceleration": Dimension("m/s^2", "9.80665 m/s^2"),
    "stiffness per length": Dimension("N/m", "5 N/m"),
    "compliance": Dimension("m/N", "20 um/N", ("um/N",)),
    "density": Dimension("kg/m^3", "960 kg/m^3"),
    "mass per area": Dimension("kg/m^2", "0.03 kg/m^2"),
    "force": Dimension("N", "0.2 N", tabled="mN"),
    "field": Dimension("V/m", "30 MV/m", ("MV/m",), "MV/m"),
    "speed": Dimension("m/s", "1 um/min", ("um/min",)),
    "time": Dimension("s", "30 s"),
    "frequency": Dimension("Hz", "10 Hz"),
    "viscosity": Dimension("Pa s", "62.4 kPa s"),
    "capacitance": Dimension("F", "800 pF", tabled="pF"),
    "length per capacitance": Dimension("m/F", "10 mm/pF", tabled="mm/pF"),
    "angle": Dimension("rad", "5 mrad", ("deg",), "mrad"),
    "area": Dimension("m^2", "3 cm^2"),
    "energy": Dimension("J", "2 mJ"),
    "resistance": Dimension("ohm", "10 MOhm"),
    "damping": Dimension("N s/m", "0.2 N s/m"),
    "voltage rate": Dimension("V/s", "100 V/s"),
    "current": Dimension("A", "5 uA", ("uA",), "uA"),
}

#: Units of results for people, by SI unit, and their number in one SI unit.
BENCH = {"m": ("mm", 1e3), "kg": ("g", 1e3), "V": ("kV", 1e-3), "Pa": ("kPa", 1e-3),
         "V/m": ("MV/m", 1e-6), "F": ("nF", 1e9), "N": ("mN", 1e3), "J": ("mJ", 1e3),
         "rad": ("mrad", 1e3), "m^2": ("mm²", 1e6)}

METRE = 1e3  #: in cadquery's model unit, the millimetre

#: Distances below this [m] are shown as zero: a nanometre.
_NOWHERE = 1e-9

#: Least step between values of a column that has to grow [s or m]: no instrument resolves less, and
#: slopes over smaller steps have no meaning.
LEAST_STEP = 1e-9

#: Most characters of a quantity.
_LONGEST = 100
#: Largest number in a file, in SI: its fourth power is still a float.
LARGEST = 1e30

_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?inf)\s*(.*?)\s*",
                       re.ASCII)
#: A quantity with a decimal comma, and what stands on both sides of it.
_COMMA = re.compile(r"\s*([-+]?\d+),(\d+)([^,]*)", re.ASCII)
#: Commas between quantities. One between digits is a decimal comma, which is refused by name.
_COMMAS = re.compile(r",(?!\d)|(?<!\d),")
#: A range: two ends with dots between them, and how many values it has, if that is said.
_RANGE = re.compile(r"(.+?)\.\.(.+?)(?:\s+in\s+(\d+))?\s*", re.ASCII)
#: Number of values of a range that does not say it: ten steps.
RANGE = 11
#: Most values of a range; more would be a mistake.
_MOST_VALUES = 10_000
#: The start of another quantity after a first one.
_ANOTHER = re.compile(r"[^\W\d_]\s*[;,]\s*[-+]?\.?\d")
#: A factor of a unit: its sign, and a group of factors or a name and its power.
_FACTOR = re.compile(r"\s*([*/·]?)\s*(?:\(([^()]+)\)|([^\W\d]\w*)"
                     r"\s*(?:(?:\^|\*\*)\s*([-+]?\d))?(?!\d))\s*")
_SIGNS = str.maketrans({"²": "^2", "³": "^3", "°": "deg"})


#: Powers of kilogram, metre, second and ampere in the units that people write.
_POWERS = {"kg": (1, 0, 0, 0), "m": (0, 1, 0, 0), "s": (0, 0, 1, 0), "N": (1, 1, -2, 0),
           "Pa": (1, -1, -2, 0), "J": (1, 2, -2, 0), "V": (1, 2, -3, -1), "F": (-1, -2, 4, 2),
           "ohm": (1, 2, -3, -2), "A": (0, 0, 0, 1), "Hz": (0, 0, -1, 0), "rad": (0, 0, 0, 0)}
#: Multiples of the units that people write, as fractions. Any other unit, or a wrong one, is left
#: to pint.
_MULTIPLES: dict[str, dict[str, tuple[float, int]]] = {
    "kg": {"kg": (1, 1), "g": (1, 1000), "mg": (1, 10**6)},
    "m": {"m": (1, 1), "cm": (1, 100), "mm": (1, 1000), "um": (1, 10**6), "km": (1000, 1)},
    "s": {"s": (1, 1), "ms": (1, 1000), "us": (1, 10**6), "min": (60, 1), "h": (3600, 1)},
    "N": {"N": (1, 1), "mN": (1, 1000), "kN": (1000, 1), "gf": (980665, 10**8),
          "kgf": (980665, 10**5)},
    "Pa": {"Pa": (1, 1), "kPa": (1000, 1), "MPa": (10**6, 1), "GPa": (10**9, 1)},
    "J": {"J": (1, 1), "mJ": (1, 1000)},
    "V": {"V": (1, 1), "mV": (1, 1000), "kV": (1000, 1), "MV": (10**6, 1)},
    "F": {"F": (1, 1), "pF": (1, 10**12), "nF": (1, 10**9)},
    "ohm": {"ohm": (1, 1), "Ohm": (1, 1), "kOhm": (1000, 1), "MOhm": (10**6, 1),
            "GOhm": (10**9, 1)},
    "A": {"A": (1, 1), "mA": (1, 1000), "uA": (1, 10**6)},
    "Hz": {"Hz": (1, 1), "kHz": (1000, 1)},
    "rad": {"rad": (1, 1), "mrad": (1, 1000), "deg": (pi, 180)},
}
USUAL = {name: (*fraction, _POWERS[base]) for base, names in _MULTIPLES.items()
         for name, fraction in names.items()}
#: Spellings of units that people and testers use, and the unit that each stands for.
SPELLED = {"sec": "s", "sek": "s", "sekunden": "s", "seconds": "s", "secondes": "s", "volt": "V",
           "volts": "V", "kilovolt": "kV", "kvolt": "kV", "kvolts": "kV", "gramm": "g",
           "gram": "g", "grams": "g", "grammes": "g", "newton": "N", "hertz": "Hz",
           "kilovolts": "kV", "kv": "kV", "chilovolt": "kV", "kilovoltios": "kV", "voltios": "V",
           "kilogram": "kg", "kilograms": "kg", "kilogramm": "kg", "kilogrammes": "kg",
           "grammi": "g", "gramos": "g", "newtons": "N", "millinewton": "mN",
           "millinewtons": "mN", "millimeter": "mm", "millimeters": "mm", "millimetre": "mm",
           "millimetres": "mm", "millimètre": "mm", "millimètres": "mm", "millimetri": "mm",
           "milímetros": "mm", "mikrometer": "um", "micrometers": "um", "micrometres": "um",
           "micromètres": "um", "micron": "um", "microns": "um", "milliseconds": "ms",
           "millisekunden": "ms", "millisecondes": "ms", "minutes": "min", "minuten": "min",
           "г": "g", "кг": "kg", "мм": "mm", "мкм": "um", "кв": "kV", "в": "V", "мн": "mN"}


class WrongDimension(ValueError):
    """A unit of another dimension."""


class AnglePerTime(ValueError):
    """An angle in place of the 1 in 1/s: the frequency would be wrong by a factor of 2π."""


@cache
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry()
    registry.define("@alias ohm = Ohm")  # as most people write it
    return registry


@cache
def _factor(unit: str, dimension: str) -> float:
    plain = unit.translate(_SIGNS)
    usual, wanted = _product(plain), _product(DIMENSIONS[dimension].si)
    if usual is None or wanted is None:
        return pint_factor(unit, dimension)
    if usual[1] != wanted[1]:
        raise WrongDimension(unit)
    if dimension == "frequency" and any(name in _MULTIPLES["rad"] for name, _ in _powers(plain)):
        raise AnglePerTime(unit)
    return usual[0]


def _product(unit: str) -> tuple[float, tuple[int, ...]] | None:
    """Multiply usual units to their SI value and powers; None where another unit is among them.

    Loading pint takes longer than reading a file.
    """
    above, below, powers = 1.0, 1.0, [0, 0, 0, 0]
    for name, power in _powers(unit):
        if name not in USUAL:
            return None
        numerator, denominator, base = USUAL[name]
        above *= (numerator if power > 0 else denominator) ** abs(power)
        below *= (denominator if power > 0 else numerator) ** abs(power)
        powers = [whole + power * part for whole, part in zip(powers, base, strict=True)]
    return above / below, tuple(powers)


def pint_factor(unit: str, dimension: str) -> float:
    """Convert one unit of a dimension to SI.

    Raises :class:`WrongDimension`, :class:`AnglePerTime` or as pint does.
    """
    import pint

    registry, powers = _registry(), Counter[str]()
    for name, power in _powers(unit.translate(_SIGNS)):
        powers[registry.get_name(name)] += power
    whole = registry.Quantity(1.0, registry.UnitsContainer(powers))
    try:
        value = float(whole.to(DIMENSIONS[dimension].si).magnitude)
    except pint.DimensionalityError:
        raise WrongDimension(unit) from None
    # Pint regards radians and counts as numbers.
    if dimension == "frequency" and dict(whole.to_root_units().unit_items()) != {"second": -1}:
        raise AnglePerTime(unit)
    return value


def _powers(unit: str, sign: int = 1) -> Iterator[tuple[str, int]]:
    """Split a unit into names and their powers; the text is never evaluated."""
    factors = list(_FACTOR.finditer(unit))
    if "".join(factor.group() for factor in factors) != unit:
        raise ValueError(f"no unit: {unit}")
    for mark, group, name, power in (factor.groups() for factor in factors):
        side = -sign if mark == "/" else sign
        if group is None:
            yield name, side * int(power or 1)
        else:
            yield from _powers(group, side)


def _si_value(unit: str, dimension: str, allowed: str, given: str) -> float:
    try:
        return _factor(unit, dimension)
    except Exception as error:  # pint raises many kinds, from its tables of names and offsets
        wrong = ("wrong dimension: " if isinstance(error, WrongDimension)
                 else f"unknown unit: {_hint(unit, dimension)}")
        raise InputError(wrong + allowed, given=given) from None


def _hint(unit: str, dimension: str) -> str:
    """Ask for the unit of a dimension that was probably meant; empty if none is near."""
    spelled = {name: name for name in USUAL} | SPELLED
    wanted = _product(DIMENSIONS[dimension].si)
    return did_you_mean(unit, {word: repr(name) for word, name in spelled.items()
                               if wanted and USUAL[name][2] == wanted[1]})


def quantity(text: object, dimension: str) -> float:
    """Convert a quantity, written as number and unit, to SI; pint knows the names of units.

    ``dimension`` is a key of :data:`DIMENSIONS`. A unit that is missing, unknown or of another
    dimension is an :class:`InputError`.

    Examples
    --------
    >>> quantity("4.5 cm", "length"), quantity("20 g/mm/s^2", "stress")
    (0.045, 20.0)
    """
    article = "an" if dimension[0] in "aeiou" else "a"
    allowed = (f"must be {article} {dimension} with its unit, such as "
               f'"{DIMENSIONS[dimension].example}"')
    if not isinstance(text, str):
        raise InputError(f"has no unit: {allowed}", given=text)
    match = _QUANTITY.fullmatch(text) if len(text) <= _LONGEST else None
    if match is None:
        raise InputError(allowed, given=text)
    number, unit = match.groups()
    if comma := _COMMA.fullmatch(text):
        whole, rest, unit = comma.groups()
        either = f' or "{whole}{rest}{unit}"' if len(rest) == 3 else ""  # thousands
        raise InputError(f'must have a decimal point, no comma: "{whole}.{rest}{unit}"{either}',
                         given=text)
    if not unit:
        raise InputError(f"has no unit: {allowed}", given=text)
    if _ANOTHER.search(unit):
        raise InputError(f'must be one {dimension} with its unit, such as '
                         f'"{DIMENSIONS[dimension].example}": here are several', given=text)
    value = float(number) * _si_value(unit, dimension, allowed, text)
    if number.endswith("inf"):
        return value
    try:
        return bounded(value)
    except InputError as error:
        raise InputError(error.allowed, given=text) from None


def quantities(text: str, dimension: str) -> tuple[float, ...]:
    """Convert quantities with commas between them to SI; a range has two dots.

    A range has both ends and values at equal distances between them: :data:`RANGE` in all, or as
    many as it says.

    Examples
    --------
    >>> quantities("10 g, 0.02 kg", "mass"), quantities("0 kV..2 kV in 3", "voltage")
    ((0.01, 0.02), (0.0, 1000.0, 2000.0))
    >>> len(quantities("0 kV..5 kV", "voltage"))
    11
    """
    if ";" in text:
        raise InputError("must have commas between quantities, such as "
                         f'"{", ".join(part.strip() for part in text.split(";"))}"', given=text)
    found = list[float]()
    for part in filter(str.strip, _COMMAS.split(text)):
        span = _RANGE.fullmatch(part)
        if span is None:
            found.append(quantity(part, dimension))
            continue
        low, high = (quantity(span[end].strip(), dimension) for end in (1, 2))
        found += evenly(low, high, RANGE if span[3] is None else int(span[3]))
    return tuple(found)


def range_ends(text: object) -> list[str] | None:
    """Split a range into its two ends; None if it is no range without a count.

    Examples
    --------
    >>> range_ends("6 mm..14 mm"), range_ends("6 mm..14 mm in 5"), range_ends("6 mm")
    (['6 mm', '14 mm'], None, None)
    """
    span = _RANGE.fullmatch(text) if isinstance(text, str) else None
    return None if span is None or span[3] else [span[1].strip(), span[2].strip()]


def span_of(span: Mapping[Any, Any]) -> tuple[Any, Any, int]:
    """Read the ends and the count of a range that is a mapping: ``from``, ``to``, ``count``."""
    if not {"from", "to"} <= {*span} <= {"from", "to", "count"}:
        raise InputError("of a range there are from, to and count", given=str(span))
    count = span.get("count", RANGE)
    if isinstance(count, bool) or not isinstance(count, int):
        raise InputError("must be a whole number", key="count", given=count)
    return span["from"], span["to"], count


def written_range(value: object) -> list[str | float] | None:
    """Write the values of a range one by one, in the unit of its first end; None if it is none.

    Examples
    --------
    >>> written_range("6 mm..1.4 cm in 3"), written_range({"from": 2, "to": 3, "count": 2})
    (['6 mm', '10 mm', '14 mm'], [2.0, 3.0])
    >>> written_range("6 mm")
    """
    span = _RANGE.fullmatch(value) if isinstance(value, str) else None
    if span is not None:
        low, high, count = span[1], span[2], int(span[3] or RANGE)
    elif isinstance(value, Mapping) and {"from", "to"} <= {*value}:
        low, high, count = span_of(value)
    else:
        return None
    ends = [_QUANTITY.fullmatch(str(end)) for end in (low, high)]
    if None in ends:
        raise InputError("must be a range of numbers or quantities", given=value)
    (first, unit), (last, other) = ((float(end[1]), end[2]) for end in ends if end)
    if unit != other:
        sizes = [size for each in (unit, other) if (size := any_quantity(f"1 {each}"))]
        if len(sizes) < 2 or sizes[0][1] != sizes[1][1]:
            raise InputError("must have one kind of unit at both ends", given=value)
        last *= sizes[1][0] / sizes[0][0]
    numbers = evenly(first, last, count)
    return [f"{number:.12g} {unit}" if unit else number for number in numbers]


def evenly(low: float, high: float, count: int) -> list[float]:
    """List numbers at equal distances from one end to another; both ends are exact."""
    if not 2 <= count <= _MOST_VALUES:
        raise InputError(f"a range must have from 2 to {_MOST_VALUES} values", given=count)
    return [*(low + number * (high - low) / (count - 1) for number in range(count - 1)), high]


def bounded(value: float) -> float:
    """Check that a number of a file [SI] is not too large to compute with."""
    if not abs(value) <= LARGEST:
        raise InputError(f"must be finite, at most {LARGEST:g} in SI units", given=value)
    return value


def unit_factor(unit: str, dimension: str) -> float:
    """Convert one ``unit`` to SI; an :class:`InputError` if it is not of the dimension.

    Examples
    --------
    >>> unit_factor("kV", "voltage"), unit_factor("min", "time")
    (1000.0, 60.0)
    """
    example = DIMENSIONS[dimension].example.split()[1]
    return _si_value(unit, dimension, f"must be a unit of {dimension}, such as {example}", unit)


def table_unit(dimension: str) -> tuple[str, float]:
    """Find the unit of a dimension's numbers in tables, and their number in one SI unit.

    >>> table_unit("length"), table_unit("frequency")
    (('mm', 1000.0), ('Hz', 1.0))
    """
    unit = DIMENSIONS[dimension].table_unit
    return unit, 1 / unit_factor(unit, dimension)


def quantity_text(value: float, dimension: str) -> str:
    """Write a quantity as number and unit that :func:`quantity` reads back as the same number.

    Examples
    --------
    >>> quantity_text(0.045, "length"), quantity_text(float("inf"), "voltage")
    ('45 mm', 'inf kV')
    >>> quantity_text(1 / 3, "stress")
    '0.3333333333333333 Pa'
    """
    value, units = float(value), DIMENSIONS[dimension]
    for unit in (*units.usual, units.si):
        text = f"{value / quantity(f'1 {unit}', dimension):.12g} {unit}"
        if quantity(text, dimension) == value:
            return text
    return f"{value!r} {units.si}"


def quantities_text(values: Iterable[float], dimension: str) -> str:
    """Write quantities [SI] for people, each as :func:`quantity_text` does.

    Examples
    --------
    >>> quantities_text((0.04, 0.0), "length")
    '40 mm, 0 mm'
    """
    return ", ".join(quantity_text(value, dimension) for value in values)


def segment_words(segment: str | None) -> str:
    """Write the segments at a place, as in "x 17.1 mm, y 0.0 mm, segment B".

    Examples
    --------
    >>> segment_words("B"), segment_words("A, B"), segment_words(None)
    (', segment B', ', segments A and B', '')
    """
    if segment is None:
        return ""
    *others, last = segment.split(", ")
    return f", segments {', '.join(others)} and {last}" if others else f", segment {last}"


def drive_words(voltages: Mapping[str, float]) -> str:
    """Write the voltages [V] of an electrode's segments, where they differ.

    Examples
    --------
    >>> drive_words({"A": 6200.0, "B": 0.0}), drive_words({"A": 3e3, "B": 3e3}), drive_words({})
    ('A 6.2 kV, B 0 kV', '', '')
    """
    if len(set(voltages.values())) < 2:
        return ""
    return ", ".join(f"{name} {voltage / 1e3:.4g} kV" for name, voltage in voltages.items())


def place_text(x: float, y: float) -> str:
    """Write a place on a film [m] in millimetres, to three or four digits of the larger coordinate.

    A distance of less than a nanometre is written as zero.

    Examples
    --------
    >>> place_text(3.64e-3, -1.7457e-17), place_text(-0.1234e-3, 0.04e-3), place_text(0.0, 0.0)
    ('x 3.64 mm, y 0.00 mm', 'x -0.123 mm, y 0.040 mm', 'x 0.0 mm, y 0.0 mm')
    >>> place_text(31.7e-3, -1e-7)
    'x 31.7 mm, y 0.0 mm'
    """
    x_mm, y_mm = (value * METRE if abs(value) >= _NOWHERE else 0.0 for value in (x, y))
    larger = max(abs(x_mm), abs(y_mm))
    decimals = max(1, 2 - floor(log10(larger))) if larger else 1
    # Adding zero turns minus zero into zero.
    return ", ".join(f"{axis} {round(value, decimals) + 0.0:.{decimals}f} mm"
                     for axis, value in (("x", x_mm), ("y", y_mm)))


def millimetres(*metres: float) -> tuple[float, ...]:
    """Round lengths to the femtometre, so that equal sizes in any unit give equal CAD."""
    return tuple(round(metre * METRE, 12) for metre in metres)


def any_quantity(text: object) -> tuple[float, str] | None:
    """Convert a quantity of any dimension to SI, with its dimension; None if it is no quantity.

    Examples
    --------
    >>> any_quantity("8 mm"), any_quantity("ellipse")
    ((0.008, 'length'), None)
    """
    for dimension in DIMENSIONS:
        with suppress(InputError):
            return quantity(text, dimension), dimension
    return None


def unit_of(name: str) -> str | None:
    """Find the SI unit that ends a name; None if no unit does.

    Examples
    --------
    >>> unit_of("max_field_V_per_m"), unit_of("mass_kg"), unit_of("max_stretch")
    ('V/m', 'kg', None)
    """
    fitting = (item for item in DIMENSIONS.values() if name.endswith(item.suffix))
    longest = max(fitting, key=lambda item: len(item.suffix), default=None)
    return None if longest is None else longest.si
