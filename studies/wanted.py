"""Wanted quantities of films: their values, bounds of these, and by how much films miss them.

`[want]` of requirements and of tolerances, `--want` and ``want=`` are read here: a bound is the
same in all of them.

    stroke = "2 mm"                                   # at least: more of a stroke is better
    deflection = ["at least 3 mm", "at most 6 mm"]    # of a deflection it is said which
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Registry
from tympan.base.toml_reader import POSITIVE, Rule, Table, one_of
from tympan.base.units import DIMENSIONS, quantity_text, unit_factor
from tympan.geometry.outlines import area, perimeter
from tympan.geometry.specimen import Specimen

_MARGIN: Rule = (lambda x: 1 <= x <= 10, "must be a margin from 1 to 10")

#: Margin to the loss of tension where none is asked for: the film bears its voltage, no more.
TENSION = "tension_margin"
#: Margin to breakdown.
BREAKDOWN = "breakdown_margin"
#: Voltage of the first limit.
LIMIT = "limit"

#: Sense of a bound.
Sense = Literal["at least", "at most"]

_SENSED = re.compile(r"\s*(?:at\s+(least|most)\s)?\s*(.+?)\s*", re.DOTALL)
#: Relative difference from a bound that is none: reduced films, by which is searched, and finite
#: elements differ by less.
_NEAR = 1e-3


class Loaded(Protocol):
    """Films without voltage, under theirs, and under that times a margin: (films, states) each.

    Of a film that has lost tension the numbers are those of one that bears compression; nan of one
    without equilibrium. ``force`` that the film carries [N], ``blocked_force`` that the voltage
    takes from a plate held where it is without [N], (films,); lowest ``frequency`` of the first
    two [Hz], (films,); ``limit``: over the voltage, that of the first loss of tension or of
    pull-in; ``first_limit``: nominal voltage of the first limit of any kind [V].
    """

    @property
    def specimens(self) -> Sequence[Specimen | None]: ...
    @property
    def voltage(self) -> Array: ...
    @property
    def deflection(self) -> Array: ...
    @property
    def capacitance(self) -> Array: ...
    @property
    def force(self) -> Array: ...
    @property
    def stress(self) -> Array: ...
    @property
    def tension(self) -> Array: ...
    @property
    def electric(self) -> Array: ...
    @property
    def breakdown(self) -> Array: ...
    @property
    def blocked_force(self) -> Array: ...
    @property
    def frequency(self) -> Array: ...
    @property
    def limit(self) -> Array: ...
    @property
    def first_limit(self) -> Array: ...


@dataclass(frozen=True)
class Quantity:
    """A quantity of loaded films: its ``name`` in files, its ``words``, and its values.

    ``gain``: whether more of it is better, or less; None where a bound must say whether it is the
    least or the largest value. ``of`` answers its values for films, (films,). ``scatters``: films
    of one drawing differ in it. ``missed``: by what share films miss a bound, where that is not by
    its value. A search keeps bounds of a quantity that is ``sought``. One ``of_plate`` needs a
    plate. ``label``: what tables and figures call it, where that is not its name.
    """

    name: str
    words: str
    dimension: str
    gain: bool | None
    of: Callable[[Loaded], Array]
    scatters: bool = True
    rule: Rule = POSITIVE
    missed: Callable[[Loaded], Array] | None = None
    sought: bool = True
    of_plate: bool = False
    label: str = ""

    @property
    def title(self) -> str:
        """Name for people."""
        return self.label or self.name.replace("_", " ")

    @property
    def column(self) -> str:
        """Name of a column that holds it: its SI unit ends it."""
        return self.name + (DIMENSIONS[self.dimension].suffix if self.dimension else "")

    @property
    def unit(self) -> str:
        """SI unit, "1" of plain numbers."""
        return DIMENSIONS[self.dimension].si if self.dimension else "1"

    @property
    def table_unit(self) -> str:
        """Unit of its values in tables, "" of plain numbers."""
        return DIMENSIONS[self.dimension].table_unit if self.dimension else ""

    @property
    def per_si(self) -> float:
        """Value in :attr:`table_unit` of 1 in SI."""
        return 1 / unit_factor(self.table_unit, self.dimension) if self.dimension else 1.0

    @property
    def example(self) -> str:
        """A bound as a file has it."""
        value = DIMENSIONS[self.dimension].example if self.dimension else "1.2"
        return f'"at least {value}"' if self.gain is None else f'"{value}"'


@dataclass(frozen=True)
class Bound:
    """Bound of a quantity, by its ``name``: at least, or at most, a ``value`` [SI]."""

    name: str
    value: float
    least: bool

    @property
    def quantity(self) -> Quantity:
        """The quantity."""
        return QUANTITIES[self.name]

    @property
    def key(self) -> str:
        """Key among others: the quantity's name, with the sense where that is not the usual one."""
        return self.name if self.least == self.quantity.gain else f"{self.name} {self.sense}"

    @property
    def sense(self) -> Sense:
        """Words of its sense."""
        return "at least" if self.least else "at most"

    @property
    def text(self) -> str:
        """The bound as people read it: "stroke at least 2 mm"."""
        dimension = self.quantity.dimension
        value = quantity_text(self.value, dimension) if dimension else f"{self.value:g}"
        return f"{self.name.replace('_', ' ')} {self.sense} {value}"

    def misses(self, films: Loaded) -> Array:
        """Share by which films miss it, (films,): not above 0 where they keep it, nan unknown."""
        missed = self.quantity.missed
        return self.missed(self.quantity.of(films)) if missed is None else missed(films)

    def missed(self, values: Array) -> Array:
        """Share by which values of the quantity miss it."""
        share = np.asarray(values) / self.value
        return np.asarray(1 - share if self.least else share - 1)

    def kept_by(self, value: float) -> bool:
        """Whether a value keeps it, as nearly as reduced films know it."""
        return bool(self.missed(np.array(value)) <= _NEAR)

    def at(self, missed: float) -> float:
        """Value that misses it by a share."""
        return self.value * (1 - missed if self.least else 1 + missed)

    def better(self, one: float, other: float) -> bool:
        """Whether one value keeps it more easily than another."""
        return one > other if self.least else one < other

    def relaxed_to(self, value: float | None) -> Bound | None:
        """The bound at another value; None where that is no weaker, or could not be asked for."""
        if value is None or not self.better(self.value, value) or not self.quantity.rule[0](value):
            return None
        return Bound(self.name, value, self.least)

    def relaxed_by(self, share: float) -> Bound | None:
        """The bound with a value weaker by a share of itself; None where there is none."""
        return self.relaxed_to(self.at(share))


def by_key(bounds: Iterable[Bound]) -> dict[str, Bound]:
    """Bounds by their keys, of several by one key the last."""
    return {bound.key: bound for bound in bounds}


def read_bounds(name: str, given: object) -> tuple[Bound, ...]:
    """Bounds of a quantity as they are given: "2 mm", "at most 2 mm", 1.2, or a list of these.

    Raises
    ------
    InputError
        When there is no such quantity, or the bounds cannot be used; the key is the name.
    """
    if name not in QUANTITIES:
        raise InputError(one_of(name, QUANTITIES), key=name, given=given)
    several = list(given) if isinstance(given, list | tuple) else [given]
    if not several:
        raise InputError("must be a bound, such as " + QUANTITIES[name].example, key=name,
                         given=given)
    found = [_bound(name, each) for each in several]
    if len({bound.least for bound in found}) < len(found):
        raise InputError("must be at most one bound of each sense, such as "
                         '["at least …", "at most …"]', key=name, given=given)
    low, high = (next((bound.value for bound in found if bound.least == least), end)
                 for least, end in ((True, -np.inf), (False, np.inf)))
    if not low <= high:
        raise InputError("must not have a least value above the largest", key=name, given=given)
    return tuple(found)


def _bound(name: str, given: object) -> Bound:
    wanted, least, value = QUANTITIES[name], QUANTITIES[name].gain, given
    if isinstance(given, str) and (match := _SENSED.fullmatch(given)):
        sense, value = match.groups()
        least = least if sense is None else sense == "least"
    if least is None:
        raise InputError(f"must say whether it is the least or the largest value: {wanted.example}",
                         key=name, given=given)
    if wanted.rule is _MARGIN and not least:
        raise InputError("must be a least value: a margin can hardly be too large", key=name,
                         given=given)
    # A number without unit is a text on a command line.
    number = value if not isinstance(value, str) or wanted.dimension else _plain(value)
    table = Table("", {name: number})
    try:
        return Bound(name, table.number(name, wanted.dimension, rule=wanted.rule), least)
    except InputError as error:
        raise InputError(error.allowed, key=name, given=given) from None


def _plain(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def wanted_bounds(given: Mapping[str, object] | str) -> tuple[Bound, ...]:
    """Bounds of a mapping, or of a text such as "stroke = 2 mm, deflection = at most 6 mm".

    Raises
    ------
    InputError
        When some bound cannot be used; the key is ``want``, with the quantity's name.
    """
    pairs = _pairs(given) if isinstance(given, str) else given
    if not pairs:
        raise InputError('must be bounds, such as "stroke = 2 mm"', key="want", given=given)
    try:
        return tuple(by_key(bound for name, value in pairs.items()
                            for bound in read_bounds(name, value)).values())
    except InputError as error:
        raise InputError(f"{error.key}: {error.allowed}", key="want",
                         given=error.given) from None


def _pairs(text: str) -> Mapping[str, object]:
    pairs: dict[str, list[str]] = {}
    for part in filter(None, map(str.strip, text.split(","))):
        name, equals, value = map(str.strip, part.partition("="))
        if not (name and equals and value):
            raise InputError('must be "quantity = bound", such as "stroke = 2 mm", with commas '
                             "between several", key="want", given=text)
        name = name.replace(" ", "_")
        pairs[name] = [*pairs.get(name, ()), value.strip("\"'")]
    return pairs


def table_bounds(table: Table) -> tuple[Bound, ...]:
    """Bounds of a table, all of whose keys are quantities."""
    found = list[Bound]()
    for name, given in table.data.items():
        table.asked.add(name)
        try:
            found += read_bounds(name, given)
        except InputError as error:
            raise table.error(name, error.allowed, error.given) from None
    return tuple(found)


def _of_specimen(measure: Callable[[Specimen], float]) -> Callable[[Loaded], Array]:
    def values(films: Loaded) -> Array:
        return np.array([np.nan if specimen is None else measure(specimen)
                         for specimen in films.specimens])
    return values


def _extent(axis: int) -> Callable[[Specimen], float]:
    return lambda specimen: float(np.ptp(specimen.frame.points(720)[axis]))


def _film_mass(specimen: Specimen) -> float:
    film, frame = specimen.membrane, float(area(specimen.frame))
    free = frame - float(specimen.plate_area)
    per_area = film.density * film.volume_per_area + film.layers * specimen.electrode.mass
    return float(free * per_area)


def _stroke(films: Loaded) -> Array:
    return np.asarray(np.abs(films.deflection[:, 1] - films.deflection[:, 0]))


def _work(films: Loaded) -> Array:
    return np.asarray(np.abs(films.force[:, :2].mean(1)) * _stroke(films))


def _breakdown_margin(films: Loaded) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(1 / films.breakdown[:, 1])


def _tension_missed(films: Loaded) -> Array:
    """The margin is looked at where tension must not be lost yet: by what is left of it there."""
    return np.asarray(-films.tension.min(1) / films.stress.max(1))


#: All quantities that loaded films may be asked for: bounds of tolerances and of designs, and what
#: a sweep may ask. Whoever registers one here can ask for it everywhere.
QUANTITIES: Registry[Quantity] = Registry("name")
for _quantity in (
    Quantity("deflection", "deflection under the voltage", "length", None,
             lambda films: films.deflection[:, 1]),
    Quantity("stroke", "stroke", "length", True, _stroke),
    Quantity("blocked_force", "blocked force", "force", True, lambda films: films.blocked_force,
             of_plate=True),
    Quantity("work", "work", "energy", True, _work, of_plate=True),
    Quantity("frequency", "frequency", "frequency", True, lambda films: films.frequency,
             of_plate=True),
    Quantity(TENSION, "margin to the loss of tension or pull-in", "", True,
             lambda films: films.limit, rule=_MARGIN, missed=_tension_missed),
    Quantity(BREAKDOWN, "margin to breakdown", "", True, _breakdown_margin, rule=_MARGIN),
    Quantity(LIMIT, "voltage of the first limit", "voltage", True,
             lambda films: films.first_limit, sought=False, label="first limit"),
    Quantity("capacitance", "capacitance under the voltage", "capacitance", None,
             lambda films: films.capacitance[:, 1]),
    Quantity("gap", "gap between plate and frame", "length", True,
             _of_specimen(lambda specimen: specimen.gap), scatters=False),
    Quantity("voltage", "voltage", "voltage", False, lambda films: films.voltage, scatters=False),
    Quantity("max_field", "largest field", "field", False, lambda films: films.electric[:, 1]),
    Quantity("max_true_stress", "largest true stress", "stress", False,
             lambda films: films.stress[:, :2].max(1)),
    Quantity("film_mass", "mass of film and electrodes", "mass", False,
             _of_specimen(_film_mass), scatters=False),
    Quantity("frame_area", "area of the frame", "area", False,
             _of_specimen(lambda specimen: float(area(specimen.frame))),
             scatters=False),
    Quantity("frame_perimeter", "perimeter of the frame", "length", False,
             _of_specimen(lambda specimen: float(perimeter(specimen.frame))),
             scatters=False),
    Quantity("width", "width of the frame", "length", False, _of_specimen(_extent(0)),
             scatters=False),
    Quantity("height", "height of the frame", "length", False, _of_specimen(_extent(1)),
             scatters=False),
):
    QUANTITIES.register(_quantity)


def scattering() -> tuple[str, ...]:
    """Names of the quantities that differ between films of one drawing."""
    return tuple(name for name, quantity in QUANTITIES.items() if quantity.scatters)
