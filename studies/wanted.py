"""Wanted quantities of films: their values, bounds on them, and how much films miss them.

This module reads `[want]` of requirements and of tolerances, `--want` and ``want=``. A bound has
the same form in all of them.

    stroke = "2 mm"                                   # at least: a larger stroke is better
    deflection = ["at least 3 mm", "at most 6 mm"]    # a deflection needs "at least" or "at most"
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
from tympan.studies.variables import VARIABLES, Variable

_MARGIN: Rule = (lambda x: 1 <= x <= 10, "must be a margin from 1 to 10")

#: Margin to the loss of tension. Without a requested margin the film only bears its voltage.
TENSION = "tension_margin"
#: Missed share of a film whose least stress equals the largest one.
_EVEN = -1.0
#: Margin to breakdown.
BREAKDOWN = "breakdown_margin"
#: Voltage of the first limit.
LIMIT = "limit"

#: Sense of a bound.
Sense = Literal["at least", "at most"]

_SENSED = re.compile(r"\s*(?:at\s+(least|most)\s)?\s*(.+?)\s*", re.DOTALL)
#: Relative difference from a bound that is neglected: reduced films, which the search uses, differ
#: from finite elements by less.
_NEAR = 1e-3


class Loaded(Protocol):
    """Films at 0 V, at their voltage, and at that times a margin: arrays (films, states).

    A film that has lost tension has the numbers of a film that bears compression. A film
    without equilibrium has nan. ``shown`` computes any variable of the states. ``stroke`` [m],
    (films,), is the deflection under the voltage less that without. ``blocked_force`` [N],
    (films,), is the force that the voltage takes from a plate held where it is without voltage.
    ``frequency`` [Hz], (films,), is the lowest frequency of the first two states. ``limit`` is the
    voltage of the first loss of tension or of pull-in, over the voltage. ``first_limit`` [V] is the
    nominal voltage of the first limit of any kind.
    """

    def shown(self, variable: Variable) -> Array: ...
    @property
    def specimens(self) -> Sequence[Specimen | None]: ...
    @property
    def voltage(self) -> Array: ...
    @property
    def deflection(self) -> Array: ...
    @property
    def stroke(self) -> Array: ...
    @property
    def capacitance(self) -> Array: ...
    @property
    def force(self) -> Array: ...
    @property
    def stress(self) -> Array: ...
    @property
    def tension(self) -> Array: ...
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
    least or the largest value. ``of`` computes its values for films, (films,). ``scatters``: films
    of one drawing differ in it. ``missed`` computes the share by which films miss a bound, where
    that does not follow from the value. A search keeps bounds of a quantity that is ``sought``. A
    quantity ``of_plate`` needs a plate. ``label`` is its name in tables and figures, where that is
    not ``name``.
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
        """Name of its column, which ends in its SI unit."""
        return self.name + (DIMENSIONS[self.dimension].suffix if self.dimension else "")

    @property
    def unit(self) -> str:
        """SI unit, "1" for plain numbers."""
        return DIMENSIONS[self.dimension].si if self.dimension else "1"

    @property
    def table_unit(self) -> str:
        """Unit of its values in tables, "" for plain numbers."""
        return DIMENSIONS[self.dimension].table_unit if self.dimension else ""

    @property
    def per_si(self) -> float:
        """Value of 1 SI unit in :attr:`table_unit`."""
        return 1 / unit_factor(self.table_unit, self.dimension) if self.dimension else 1.0

    @property
    def example(self) -> str:
        """Example of a bound in a file."""
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
        """Quantity of the bound."""
        return QUANTITIES[self.name]

    @property
    def key(self) -> str:
        """Key among bounds: the quantity's name, with the sense if that is not the usual one."""
        return self.name if self.least == self.quantity.gain else f"{self.name} {self.sense}"

    @property
    def sense(self) -> Sense:
        """Sense in words."""
        return "at least" if self.least else "at most"

    @property
    def text(self) -> str:
        """The bound in words: "stroke at least 2 mm"."""
        dimension = self.quantity.dimension
        value = quantity_text(self.value, dimension) if dimension else f"{self.value:g}"
        return f"{self.name.replace('_', ' ')} {self.sense} {value}"

    def misses(self, films: Loaded) -> Array:
        """Compute the share by which films miss it, (films,): 0 or less if kept, nan if unknown."""
        missed = self.quantity.missed
        return self.missed(self.quantity.of(films)) if missed is None else missed(films)

    def missed(self, values: Array) -> Array:
        """Compute the share by which values of the quantity miss it."""
        share = np.asarray(values) / self.value
        return np.asarray(1 - share if self.least else share - 1)

    def kept_by(self, value: float) -> bool:
        """Test whether a value keeps it within the accuracy of reduced films."""
        return bool(self.missed(np.array(value)) <= _NEAR)

    def at(self, missed: float) -> float:
        """Compute the value that misses it by a share."""
        return self.value * (1 - missed if self.least else 1 + missed)

    def better(self, one: float, other: float) -> bool:
        """Test whether one value keeps it more easily than another."""
        return one > other if self.least else one < other

    def relaxed_to(self, value: float | None) -> Bound | None:
        """Weaken the bound to a value; None where that is no weaker, or not an allowed value."""
        if value is None or not self.better(self.value, value) or not self.quantity.rule[0](value):
            return None
        return Bound(self.name, value, self.least)

    def relaxed_by(self, share: float) -> Bound | None:
        """Weaken the bound by a share of its value; None where that is not possible."""
        return self.relaxed_to(self.at(share))


def by_key(bounds: Iterable[Bound]) -> dict[str, Bound]:
    """Index bounds by their keys; the last of several with one key counts."""
    return {bound.key: bound for bound in bounds}


def read_bounds(name: str, given: object) -> tuple[Bound, ...]:
    """Read a quantity's bounds: "2 mm", "at most 2 mm", 1.2, or a list of these.

    Raises
    ------
    InputError
        If the quantity is unknown, or the bounds cannot be used; the key is the name.
    """
    if name not in QUANTITIES.known:
        raise InputError(one_of(name, QUANTITIES.known), key=name, given=given)
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
    # On a command line a number without unit is a text.
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
    """Read bounds from a mapping, or a text such as "stroke = 2 mm, deflection = at most 6 mm".

    Raises
    ------
    InputError
        When a bound cannot be used; the key is ``want``, with the quantity's name.
    """
    pairs = _pairs(given) if isinstance(given, str) else given
    if not pairs:
        raise InputError('must be bounds, such as "stroke = at least 2 mm"', key="want",
                         given=given)
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
        if not (name and equals and value) or name[-1] in "<>":
            raise InputError('must be "quantity = bound", such as "stroke = at least 2 mm" or '
                             '"deflection = at most 6 mm", with commas between several',
                             key="want", given=text)
        name = name.replace(" ", "_")
        pairs[name] = [*pairs.get(name, ()), value.strip("\"'")]
    return pairs


def table_bounds(table: Table) -> tuple[Bound, ...]:
    """Read the bounds of a table, whose keys are all quantities."""
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
    return np.asarray(np.abs(films.stroke))


def _work(films: Loaded) -> Array:
    return np.asarray(np.abs(films.force[:, :2].mean(1)) * _stroke(films))


def _breakdown_margin(films: Loaded) -> Array:
    with np.errstate(divide="ignore"):
        return np.asarray(1 / films.breakdown[:, 1])


class Quantities(Registry[Quantity]):
    """Quantities by name. A variable of states that none of them is, is one by its own name."""

    def __missing__(self, name: str) -> Quantity:
        variable = next((each for each in VARIABLES.values()
                         if each.name == name and each.bounded and each.of is not None), None)
        if variable is None:
            raise KeyError(name)
        return _under_voltage(variable)

    @property
    def known(self) -> dict[str, Quantity]:
        """All quantities: the registered ones, then the variables of states."""
        others = [each.name for each in VARIABLES.values()
                  if each.bounded and each.of is not None and each.name not in self]
        return {**self, **{name: self[name] for name in others}}


def _under_voltage(variable: Variable, words: str = "") -> Quantity:
    """Make the quantity of a variable under the voltage."""
    return Quantity(variable.name, words or variable.meaning, variable.dimension, variable.gain,
                    lambda films: films.shown(variable)[:, 1], of_plate=variable.of_plate)


def _tension_missed(films: Loaded) -> Array:
    """Compute the missed share: least over largest stress up to the margin, sign reversed.

    It is that of an even tension for a film without fields, whose least tension is infinite.
    """
    least = films.tension.min(1)
    return np.where(np.isposinf(least), _EVEN, -least / films.stress.max(1))


#: All quantities of loaded films: for bounds of tolerances and of designs, and for sweeps. A
#: quantity that is registered here is available in all of them, and so is a variable of states.
QUANTITIES = Quantities("name")
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
    _under_voltage(VARIABLES["capacitance_F"], "capacitance under the voltage"),
    Quantity("gap", "gap between plate and frame", "length", True,
             _of_specimen(lambda specimen: specimen.gap), scatters=False),
    Quantity("voltage", "voltage", "voltage", False, lambda films: films.voltage, scatters=False),
    _under_voltage(VARIABLES["max_field_V_per_m"], "largest field"),
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


def by_column() -> dict[str, Quantity]:
    """Index all quantities by their columns."""
    return {quantity.column: quantity for quantity in QUANTITIES.known.values()}


def scattering() -> tuple[str, ...]:
    """List the quantities that differ between films of one drawing."""
    return tuple(name for name, quantity in QUANTITIES.known.items() if quantity.scatters)
