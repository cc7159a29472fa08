"""View of a film at one moment, as the page shows it, and the controls that change it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

from tympan.base.errors import InputError
from tympan.base.fields import Field, field_at
from tympan.base.paths import at, numbers, with_number
from tympan.base.toml_reader import Table
from tympan.base.units import quantity, table_unit
from tympan.fem.film.laws.stiffened import scaled
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig, checked_load
from tympan.fem.toml_writer import specimen_content
from tympan.geometry.outlines import Outline, reshaped
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case

#: Units of the controls, by dimension, and their number in one SI unit.
_UNITS = {"": ("", 1.0), "angle": ("deg", 180 / 3.141592653589793)} | {
    dimension: table_unit(dimension) for dimension in ("length", "mass", "voltage")}

#: Most numbers of an outline with controls; an outline with more is changed in its file.
_MOST_NUMBERS = 8

#: Least value on the sliders of sizes and factors, over the initial one.
_LEAST = 0.5
#: Largest value on the sliders of sizes and factors, over the initial one: inverse of the least.
_MOST = 2.0

#: Largest mass on the slider by default [kg]: about twice the source paper's larger load.
_MASS = 50e-3
#: Largest voltage on the slider by default [V]: the range of common high-voltage amplifiers.
_VOLTAGE = 10e3

#: Keys of a view that do not belong to its specimen.
_LOADS = ("mass", "voltage", "stiffness")

#: Parts whose shape can be chosen.
SHAPED = ("frame", "plate.outline")

#: Key of the control of a segment's voltage, by the segment's number.
_SEGMENT = re.compile(r"electrode\.segments\.(\d+)\.voltage", re.ASCII)

#: Approximate number of positions of a slider.
_POSITIONS = 400

_NUMBER = re.compile(r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*", re.ASCII)


@dataclass(frozen=True)
class FilmView:
    """A specimen on its rig under a mass [kg] and a voltage [V].

    ``stiffness`` is a factor on all stresses of its material's law.
    """

    specimen: Specimen
    rig: Rig = Rig()
    mass: float = 0.0
    voltage: float = 0.0
    stiffness: float = 1.0

    @cached_property
    def actuator(self) -> Specimen:
        """The specimen with its factor."""
        if self.stiffness == 1:
            return self.specimen
        film = self.specimen.membrane
        return replace(self.specimen, membrane=replace(
            film, material=scaled(film.material, self.stiffness)))

    @property
    def case(self) -> Case:
        """Case to solve."""
        return Case(self.actuator, mass=self.mass, voltage=self.voltage, rig=self.rig)


@dataclass(frozen=True)
class Control:
    """A slider and a number field for a value of a view.

    ``key`` names the value; ``low``, ``high`` and ``step`` are the slider's, in its ``unit``, of
    which ``factor`` make the SI unit; the field takes other values too.
    """

    key: str
    label: str
    dimension: str
    low: float
    high: float
    step: float

    @property
    def unit(self) -> str:
        """Unit after the number."""
        return _UNITS[self.dimension][0]

    @property
    def factor(self) -> float:
        """Number of its units that make the SI unit."""
        return _UNITS[self.dimension][1]

    def value(self, view: FilmView) -> float:
        """Read the value in a view, in its unit."""
        return self.factor * control_value(view, self.key)

    def position(self, view: FilmView) -> float:
        """Compute the position of its slider."""
        value = min(max(self.value(view), self.low), self.high)
        return _on(value - self.low, self.step, self.low)

    def text(self, view: FilmView) -> str:
        """Write the number in the field."""
        return f"{self.value(view):.6g}"

    def parsed(self, text: str) -> float:
        """Convert a number in the field's unit, or a quantity with its own unit, to SI.

        Raises
        ------
        InputError
            When it is neither, naming the key.
        """
        if _NUMBER.fullmatch(text):
            return float(text) / self.factor
        if not self.dimension:
            raise InputError("must be a number", key=self.key, given=text)
        try:
            return quantity(text, self.dimension)
        except InputError as error:
            raise error.located(key=self.key) from None


def control_value(view: FilmView, key: str) -> float:
    """Read the value of a control with this key in a view, in SI."""
    if key in _LOADS:
        return float(getattr(view, key))
    if segment := _SEGMENT.fullmatch(key):
        return float(view.specimen.electrode.segments[int(segment[1])].share) * view.voltage
    return float(at(view.specimen, key.split(".")))


def changed(view: FilmView, key: str, value: float) -> FilmView:
    """Change a value [SI] of a view.

    Raises
    ------
    InputError
        When such a film cannot be made, with the message of reading it from a file.
    """
    if segment := _SEGMENT.fullmatch(key):
        return _with_voltage(view, int(segment[1]), value)
    if key not in _LOADS:
        return replace(view, specimen=as_read(with_number(view.specimen, key.split("."), value)))
    if key == "stiffness":
        if not 0.01 <= value <= 100:
            raise InputError("must be from 0.01 to 100", key=key, given=f"{value:g}")
        return replace(view, stiffness=value)
    if key == "mass":
        checked_load(value, 0.0)
        return replace(view, mass=value)
    checked_load(0.0, value)
    return replace(view, voltage=value)


def _with_voltage(view: FilmView, number: int, value: float) -> FilmView:
    """Give a segment a voltage [V]; the others keep theirs, and the highest is the film's."""
    checked_load(0.0, value)
    electrode = view.specimen.electrode
    voltages = electrode.voltages(view.voltage) | {electrode.names[number]: value}
    wired, top = electrode.driven(voltages)
    return replace(view, specimen=replace(view.specimen, electrode=wired), voltage=top)


def as_read(specimen: Specimen) -> Specimen:
    """Read a specimen again from its own file's content, which checks all limits of its keys."""
    return load_specimen(Table("", specimen_content(specimen)))


def outline_of(view: FilmView, part: str) -> Outline:
    """Look up the outline of a part of :data:`SHAPED`."""
    outline: Outline = at(view.specimen, part.split("."))
    return outline


def shape_of(view: FilmView, part: str) -> str:
    """Name the shape of a part."""
    return outline_of(view, part).shape


def with_shape(view: FilmView, part: str, template: Outline) -> FilmView:
    """Give frame or plate of a view a template's shape, at its size.

    Raises
    ------
    InputError
        When such a film cannot be made.
    """
    outline = reshaped(outline_of(view, part), template)
    return replace(view, specimen=as_read(with_number(view.specimen, part.split("."), outline)))


def controls(view: FilmView, most_voltage: float = _VOLTAGE, most_mass: float = 0.0
             ) -> tuple[Control, ...]:
    """Make the controls of a film about its values; ``most_...`` [SI] end the loads' sliders."""
    reach = 1.0 if most_voltage <= 0 else most_voltage
    names = view.specimen.electrode.names
    loads = (_control("voltage", "highest voltage" if names else "voltage", "voltage", 0.0, reach),
             *(_control(f"electrode.segments.{number}.voltage", f"voltage of {name}", "voltage",
                        0.0, reach) for number, name in enumerate(names)),
             _control("mass", "mass", "mass", 0.0, max(2 * view.mass, most_mass) or _MASS))
    sizes = [_of_number(view, path) for path in _paths(view.specimen)]
    factor = _control("stiffness", "stiffness factor", "", _LEAST, _MOST)
    return (*loads, *sizes[:2], factor, *sizes[2:])


def _paths(specimen: Specimen) -> Iterator[str]:
    """List the paths of the numbers that have controls: film, frame, plate."""
    yield "membrane.prestretch.0"
    yield "membrane.prestretch.1"
    yield "membrane.relative_permittivity"
    yield "membrane.thickness"
    for part in SHAPED:
        inner = numbers(at(specimen, part.split(".")), part)
        if len(inner) <= _MOST_NUMBERS:
            yield from inner
    yield "plate.offset.0"
    yield "plate.offset.1"


def _of_number(view: FilmView, path: str) -> Control:
    keys = tuple(path.split("."))
    field, value = field_at(view.specimen, keys), control_value(view, path)
    dimension = field.says.dimension if field is not None else ""
    low, high = _LEAST * value, _MOST * value
    if keys[-2] == "offset":
        high = max(abs(value), 0.5 * view.specimen.gap)
        low = -high
    elif "prestretch" in keys:
        low, high = 1.0, max(6.0, value)
    elif value == 0:
        low, high = (-180 / 57.3, 180 / 57.3) if dimension == "angle" else (0.0, 1.0)
    return _control(path, _label(keys, field), dimension, min(low, high), max(low, high))


def _control(key: str, label: str, dimension: str, low: float, high: float) -> Control:
    """Make a control from ``low`` to ``high`` [SI], in round steps."""
    factor = _UNITS[dimension][1]
    low, high = factor * low, factor * high
    step = _round((high - low) / _POSITIONS)
    return Control(key, label, dimension, _on(low, step), _on(high, step), step)


def _round(step: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten."""
    power = 10.0 ** (len(f"{int(step)}") - 1)
    while power > step:
        power /= 10
    return float(f"{max(size * power for size in (1, 2, 5) if size * power <= step):.0e}")


def _on(value: float, step: float, start: float = 0.0) -> float:
    """Find the nearest multiple of a step, as a browser does."""
    return float(f"{start + round(value / step) * step:.12g}")


def _label(keys: tuple[str, ...], field: Field | None) -> str:
    """Label a control with the part, the key, and the axis of a pair."""
    part = {"membrane": "film"}.get(keys[0], keys[0])
    name = (field.key if field is not None else keys[-1]).replace("_", " ")
    axis = ""
    if field is not None and field.count == 2:
        axis = f" {'xy'[int(keys[-1])]}"
    elif keys[-1].isdecimal():
        axis = f" {int(keys[-1]) + 1}"
    plain = name in ("prestretch", "relative permittivity")
    return f"{name}{axis}" if plain else f"{part}: {name}{axis}"
