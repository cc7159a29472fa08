"""SWEEP.toml: grids, lists and samples of values, checked whole before anything is solved."""

from __future__ import annotations

import copy
import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Key, Special, read
from tympan.base.paths import element
from tympan.base.points import Drawing, drawn_points
from tympan.base.read_file import file_text
from tympan.base.toml_reader import Rule, Table, one_of
from tympan.base.units import DIMENSIONS, any_quantity, quantity, range_ends, written_range
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import MASS_RULE, VOLTAGE_RULE, Rig
from tympan.geometry.specimen import Specimen, Unbuildable
from tympan.studies.alpha import AlphaSettings
from tympan.studies.case import Case, Settings
from tympan.studies.driven import by_segment, drives_by_name
from tympan.studies.shipped import specimen_tables
from tympan.studies.sweep.asked import QUESTIONS, Ask
from tympan.studies.sweep.reduced import in_families
from tympan.studies.sweep.task import SweepTask, solver
from tympan.studies.tolerance.given import Tolerances, tolerances_under

#: Raw TOML values by dotted key: the differences of one specimen of a sweep.
Choice = dict[str, Any]

#: Most specimens; a larger number is a typing error.
MOST = 1_000_000
#: Most keys that specimens differ in; a larger number is a typing error.
_MOST_KEYS = 1000
#: Most values of the keys that differ, of all specimens together; a larger number is a typing
#: error.
_MOST_VALUES = 2_000_000
#: Most cases, which are specimens under loads; a larger number is a typing error.
_MOST_CASES = 10_000_000

#: Keys of a choice that are loads with their rules, and the prefix of its keys of the rig. All
#: other keys belong to the specimen.
_LOADS = {"mass": MASS_RULE, "voltage": VOLTAGE_RULE}
_RIG = "rig."
#: Prefix of the keys of a choice that are voltages of segments [V], before the segment's name.
_SEGMENT = "voltage_"

_SPECIMENS: Rule = (lambda x: 1 <= x <= MOST and x == int(x),
                    f"must be a whole number from 1 to {MOST}")
_SEED: Rule = (lambda x: 0 <= x < 2**32 and x == int(x),
               "must be a whole number from 0 to 4294967295")

#: Relative tolerance for finding one of a sweep's voltages, over the largest one.
_SAME = 1e-9


@dataclass(frozen=True)
class Sample:
    """Points drawn in ranges of keys."""

    method: Annotated[Drawing, Key("way to draw them")]
    count: Annotated[int, Key("specimens that are drawn", rule=_SPECIMENS)]
    ranges: Annotated[Table, Key("lowest and highest value of each key, by its dotted name")]
    seed: Annotated[int, Key("of the random numbers", rule=_SEED)] = 0


@dataclass(frozen=True)
class SweepFile:
    """Keys of a sweep's file; tables whose keys are names are kept as written."""

    specimen: Annotated[tuple[Table, ...], Key(
        "a specimen: its file, one of the paper's by name, or its tables; or a list of them")]
    mass: Annotated[Any, Key("load on the plate: a mass, a list, a range, or from, to and count",
                             default="required where it does not vary")] = None
    voltage: Annotated[Any, Key("nominal voltage: likewise; a list ascends",
                                default="required where it does not vary")] = None
    grid: Annotated[Table | None, Key(
        "values of keys of the specimen, of mass, voltage or the rig, by their dotted names; all "
        "combinations are solved")] = None
    columns: Annotated[Table | None, Key(
        "the same, of lists of one length: their first values make a specimen, and so on",
        name="list")] = None
    sample: Annotated[Sample | None, Key("points drawn in ranges of such keys")] = None
    rig: Annotated[Table | None, Key("of the actuator: its keys, or the name of their file",
                                     default="that of the specimen")] = None
    tolerances: Annotated[Tolerances | None, Key(
        "also the spread between films made to these: their tables, or the name of their file")
        ] = None
    ask: Annotated[tuple[str, ...], Key("what is asked beside the cases: names listed below")] = ()
    circles: Annotated[int, Key("circles that stand for a specimen, where that is asked")
                       ] = AlphaSettings.circles
    radii: Annotated[str, Key("which radii these have")] = AlphaSettings.radii
    fields: Annotated[bool, Key("keep the fields of all equilibria, as VTU files")] = False
    figures: Annotated[bool, Key("keep what a picture of each film needs")] = False


@dataclass(frozen=True)
class Entry:
    """One specimen of a sweep: its name, the name of its file, and its differences.

    Entries that differ only in keys of the grid share a name. ``task`` is None where the specimen
    cannot be built; ``reason`` says why.
    """

    name: str
    base: str
    choice: Choice
    masses: tuple[float, ...]
    voltages: tuple[float, ...]
    task: SweepTask | None
    reason: str = ""


@dataclass(frozen=True)
class Sweep:
    """All specimens of a sweep, with equal numbers of masses and of voltages.

    ``grid`` has the values of the grid's keys. For each name all their combinations stand together;
    the last key's values change first. ``at`` is the nominal voltage [V] at which maps and best
    cases compare films, None for the highest.
    """

    entries: tuple[Entry, ...]
    source: str
    grid: dict[str, list[Any]] = field(default_factory=dict)
    ask: Ask = field(default_factory=Ask)
    figures: bool = False
    at: float | None = None

    def compared_at(self, at: float | str) -> Sweep:
        """Choose one of the sweep's voltages at which maps and best cases compare films."""
        first = self.entries[0]
        if "voltage" in first.choice:
            raise InputError("the sweep's voltages differ from specimen to specimen: each is "
                             "compared at its own", key="voltage", given=at)
        return replace(self, at=voltage_of(first.voltages, at))

    @property
    def cases(self) -> int:
        """Number of rows of its table."""
        return sum(len(entry.masses) * len(entry.voltages) for entry in self.entries)


def read_sweep(file: Path, settings: Settings = Settings(), exact: bool = False,
               tolerances: Tolerances | None = None) -> Sweep:
    """Read a sweep's file and check all its specimens; its file names are relative to its folder.

    Many specimens that differ only in numbers are solved by one family of reduced films, unless
    ``exact`` is true. With ``tolerances`` the sweep also asks for bands.

    Unknown keys, wrong units and values out of range, of the sweep and of any specimen, are errors.
    A combination of allowed values that cannot be built becomes an entry without a task; it is an
    error only where no combination can be built.
    """
    table = Table.read(file, "sweep")
    given = read(SweepFile, table, _READERS)
    ask = _ask(table, given)
    tolerances = tolerances or given.tolerances
    if tolerances is not None:
        ask = ask.banded(tolerances)
    bases = {_base_name(base): base for base in given.specimen}
    if len(bases) < len(given.specimen):
        names = Counter(map(_base_name, given.specimen))
        raise table.error("specimen", "must be specimens of different names",
                          names.most_common(1)[0][0])
    grid, rows = choices(table, given)
    loads = _common_loads(table, given, {*grid, *rows[0]}, rows[0],
                          [base.data for base in bases.values()])
    grid = {key: values for key, values in grid.items() if key not in loads}
    points = [dict(zip(grid, values, strict=True)) for values in product(*grid.values())]
    places = [(number, {**row, **point}) for number, row in enumerate(rows) for point in points]
    digits = len(str(max(len(rows) - 1, 1)))

    def entry(base: str, number: int, choice: Choice, rig: Rig) -> Entry:
        name = f"{base}-{number:0{digits}}" if len(rows) > 1 else base
        masses, voltages = (loads.get(load) or (_load(table, load, choice[load]),)
                            for load in _LOADS)
        try:
            specimen = _specimen(table, bases[base], choice)
        except Unbuildable as error:
            reason = str(InputError(error.allowed, key=error.key, given=error.given))
            return Entry(name, base, choice, masses, voltages, None, reason)
        ask.check(specimen)
        if specimen.plate is None:
            for mass in masses:
                Case(specimen, mass=mass, rig=rig)  # refuses loads that need a plate
        # A copy has no cached values of the check: for a spline they have 100 kB.
        task = SweepTask(copy.deepcopy(specimen), rig, masses, voltages, settings, given.fields,
                         solver(), given.figures, ask)
        return Entry(name, base, choice, masses, voltages, task)

    specimens = len(bases) * len(places)
    _limit(table, "specimen", "specimens", specimens, MOST)
    _limit(table, "voltage", "cases", specimens * math.prod(map(len, loads.values())), _MOST_CASES)
    entries = tuple(
        entry(base, *place, rig) for base, its in bases.items() for place, rig in zip(
            places, _rigs(table, given.rig or its.table_or_file("rig"),
                          [choice for _, choice in places]), strict=True))
    if all(entry.task is None for entry in entries):
        raise InputError(f"none of the specimens can be built; the first one: {entries[0].reason}",
                         file=file)
    if not exact:
        related = in_families([entry.task for entry in entries])
        entries = tuple(replace(entry, task=task)
                        for entry, task in zip(entries, related, strict=True))
    return Sweep(entries, file_text(file), grid, ask, given.figures)


def _common_loads(table: Table, given: SweepFile, varied: Collection[str], row: Choice,
                  specimens: Iterable[Mapping[str, Any]]) -> dict[str, tuple[float, ...]]:
    """Read the masses [kg] and voltages [V] under which all specimens are solved.

    A load in ``row``, of the list or the sample or by the names of segments, is each specimen's
    own, and is left out here.
    """
    loads = dict[str, tuple[float, ...]]()
    if not _plates(specimens, varied) and "mass" not in (*varied, *table.data):
        loads["mass"] = (0.0,)  # without a plate there is no mass
    for name in _LOADS:
        if name in varied and name in table and not by_segment(table.data[name]):
            raise table.error(name, "is also varied in [grid], [list] or [sample]: only one of "
                                    "both")
        if name not in (*row, *loads):
            loads[name] = _loads(given.grid if given.grid and name in varied else table, name)
    return loads


def _plates(specimens: Iterable[Mapping[str, Any]], varied: Iterable[str]) -> bool:
    """Test whether a specimen's table has a plate, or a key of a plate varies."""
    return any("plate" in table for table in specimens) or any(
        key.partition(".")[0] == "plate" for key in varied)


def voltage_of(voltages: Sequence[float], at: float | str | None) -> float:
    """Find one of a sweep's ascending voltages [V]; by default the highest."""
    if at is None:
        return float(voltages[-1])
    try:
        volts = quantity(at, "voltage") if isinstance(at, str) else float(at)
    except InputError as error:
        raise error.located(key="voltage") from None
    near = int(np.argmin(np.abs(np.asarray(voltages) - volts)))
    if abs(voltages[near] - volts) > _SAME * voltages[-1]:
        raise InputError("must be one of the sweep's voltages: " + ", ".join(
            f"{number / 1e3:.6g}" for number in voltages) + " kV", key="voltage", given=at)
    return float(voltages[near])


def _ask(table: Table, given: SweepFile) -> Ask:
    """Read the questions on every specimen, and the settings of its circles."""
    try:
        return Ask(given.ask, AlphaSettings(circles=given.circles, radii=given.radii))
    except InputError as error:
        raise error.located(file=table.file, key=error.key) from None


def _asked(table: Table, key: str) -> tuple[str, ...]:
    """Read the names of questions."""
    names = table.value(key, [])
    if not isinstance(names, list) or len(set(map(repr, names))) < len(names):
        raise table.error(key, f"must be a list of different ones of {', '.join(QUESTIONS.known)}, "
                               'such as ["limits"]', names)
    for name in names:
        if not isinstance(name, str) or name not in QUESTIONS.known:
            raise table.error(key, one_of(name, QUESTIONS.known), name)
    return tuple(names)


def choices(table: Table, given: SweepFile) -> tuple[dict[str, list[Any]], list[Choice]]:
    """Read the grid's values by key, and join every row of the list with every sampled point."""
    driven = _driven(table, given)
    grid = _columns(given.grid, without=("voltage",) if driven else ())
    for key, values in grid.items():
        if len(set(map(repr, values))) < len(values):
            raise table.error(f"grid.{key}", "must be different values", values)
    parts: tuple[list[Choice], ...] = (_list(given.columns), _sample(table, given.sample))
    keys = [*grid, *(key for part in parts for key in part[0])]
    for key in keys:
        if keys.count(key) > 1:
            raise table.error(key, "must stand in one of [grid], [list] and [sample] only")
        if any(other != key and other.startswith(f"{key}.") for other in keys):
            raise table.error(key, "is varied as a whole and by its parts: only one of both")
    if driven and "voltage" in keys:
        raise table.error("voltage", "must stand in one of voltage, [grid], [list] and [sample] "
                                     "only")
    parts = (*parts, driven or [{}])
    together = math.prod([*map(len, grid.values()), *map(len, parts)])
    _limit(table, "grid", "specimens", together, MOST)
    _limit(table, "grid", "values", together * len(keys), _MOST_VALUES)
    return grid, [{key: value for part in row for key, value in part.items()}
                  for row in product(*parts)]


def _driven(table: Table, given: SweepFile) -> list[Choice]:
    """List the voltages by the names of segments; none where voltages are not given so.

    Each has the voltages of all segments that some of them name, and the highest, the film's.
    """
    written = given.grid.value("voltage", given.voltage) if given.grid else given.voltage
    if written is None or not by_segment(written):
        return []
    try:
        sets = drives_by_name(written, shares=False)
    except InputError as error:
        raise table.error("voltage", error.allowed, error.given) from None
    names = dict.fromkeys(name for each in sets for name in each)
    return [{"voltage": f"{max(each.values()):.17g} V"} | {
        f"{_SEGMENT}{name}": f"{each.get(name, 0.0):.17g} V" for name in names} for each in sets]


def with_choice(content: Mapping[str, Any], choice: Choice, table: Table) -> dict[str, Any]:
    """Copy nested tables with a choice's values.

    Elements of a list are named by their number, or by their own name.
    """
    changed = copy.deepcopy(dict(content))
    for key, value in choice.items():
        *path, last = key.split(".")
        inner: Any = changed
        for number, name in enumerate(path):
            inner = (inner[_index(inner, name, key, table)] if isinstance(inner, list)
                     else inner.setdefault(name, {}))
            if not isinstance(inner, dict | list):
                raise table.error(key, f"unknown key: {'.'.join(path[:number + 1])} is no table",
                                  inner)
        place = _index(inner, last, key, table) if isinstance(inner, list) else last
        inner[place] = copy.deepcopy(value)
    return changed


def read_quantity(value: Any) -> tuple[float, str] | None:
    """Read SI value and SI unit ("" of a plain number); None if it is not a quantity.

    Examples
    --------
    >>> read_quantity("8 mm"), read_quantity(2), read_quantity("ellipse")
    ((0.008, 'm'), (2.0, ''), None)
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value), ""
    read = any_quantity(value)
    return None if read is None else (read[0], DIMENSIONS[read[1]].si)


def _index(items: list[Any], name: str, key: str, table: Table) -> int:
    try:
        return element(items, name)
    except LookupError:
        names = [str(item["name"]) for item in items if isinstance(item, dict) and "name" in item]
        known = f", by name {', '.join(names)}" * bool(names)
        raise table.error(key, f"unknown key: a list has the elements 0 to {len(items) - 1}{known}",
                          name) from None


def _limit(table: Table, key: str, what: str, count: int, most: int) -> None:
    """Refuse too large a count before anything of that size is made."""
    if count > most:
        raise InputError(f"there must be at most {most} {what}", file=table.file,
                         key=table.path(key).strip("."), given=f"{count} of them")


def _spread(table: Table, key: str, ends: bool) -> Any:
    """Read the value of a key; of a range all values, or its ``ends`` alone."""
    value = table.value(key)
    try:
        spread = (range_ends(value) if ends else None) or written_range(value)
    except InputError as error:
        raise table.error(key, error.allowed, value) from None
    return value if spread is None else spread


def _columns(table: Table | None, ends: bool = False, without: Collection[str] = ()
             ) -> dict[str, list[Any]]:
    """Read the lists of a table by key; keys must be dotted names in quotation marks.

    A range stands for its values, or for its ``ends``.
    """
    if table is None:
        return {}
    columns = {key: _spread(table, key, ends) for key in table.data if key not in without}
    _limit(table, "", "keys", len(columns), _MOST_KEYS)
    for key, values in columns.items():
        if isinstance(values, Mapping):
            raise table.error(key, "must be a list or a range; write a dotted key in quotation "
                                   f'marks, such as "{key}.…" = […]')
        if not isinstance(values, list) or not values:
            raise table.error(key, "must be a list of values, at least one", values)
    return columns


def _list(table: Table | None) -> list[Choice]:
    columns = _columns(table)
    if table is None or not columns:
        return [{}]
    length = len(next(iter(columns.values())))
    for key, values in columns.items():
        if len(values) != length:
            raise table.error(key, f"must be as long as the first list of [list], {length}",
                              len(values))
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def _sample(table: Table, given: Sample | None) -> list[Choice]:
    if given is None:
        return [{}]
    ranges = given.ranges
    limits = {key: _range(ranges, key, values)
              for key, values in _columns(ranges, ends=True).items()}
    if not limits:
        raise table.error("sample.ranges", "must name at least one key", {})
    _limit(table, "sample.count", "values", given.count * len(limits), _MOST_VALUES)
    points = drawn_points(len(limits), given.count, given.seed, given.method)
    choices: list[Choice] = [{} for _ in points]
    for (key, (low, high, unit)), shares in zip(limits.items(), points.T.tolist(), strict=True):
        for choice, share in zip(choices, shares, strict=True):
            value = low + share * (high - low)
            choice[key] = f"{value!r} {unit}" if unit else value
    return choices


def _range(table: Table, key: str, values: list[Any]) -> tuple[float, float, str]:
    """Read low, high and SI unit."""
    read = [read_quantity(value) for value in values]
    first, *others = read
    if len(read) != 2 or first is None or others[0] is None or first[1] != others[0][1]:
        raise table.error(key, "must be two values of one kind, the smaller first, such as "
                               '["8 mm", "15 mm"]; one element of a list has its number in the key',
                          values)
    (low, unit), (high, _) = first, others[0]
    if not -np.inf < low < high < np.inf:
        raise table.error(key, "must be two finite values, the smaller first", values)
    return low, high, unit


def _base_name(base: Table) -> str:
    """Name a specimen by its file, or by its name where it has none of its own."""
    return str(base.data.get("name", "specimen")) if base.where else Path(base.file).stem


def _specimen(table: Table, base: Table, choice: Choice) -> Specimen:
    """Load a specimen with changes, without its rig; files that it names are next to its own.

    An error names the sweep if the sweep varies the key or a key next to it, else the file.
    """
    changes = {key: value for key, value in choice.items()
               if key not in _LOADS and not key.startswith((_RIG, _SEGMENT))}
    content = {key: value for key, value in base.data.items() if key != "rig"}
    changed = with_choice(content, changes, table) if changes else content
    # If the sweep varies the name of a file, the name is relative to the sweep's folder.
    names = any(key.rpartition(".")[2] == "file" for key in changes)
    voltages = {key.removeprefix(_SEGMENT): quantity(value, "voltage")
                for key, value in choice.items() if key.startswith(_SEGMENT)}
    try:
        specimen = load_specimen(Table(table.file if names else base.file, changed, base.where))
        if not voltages:
            return specimen
        electrode, _ = specimen.electrode.driven(voltages)
        return replace(specimen, electrode=electrode)
    except Unbuildable:
        raise
    except InputError as error:
        key = error.key or ""
        of_sweep = any(key == name or key.startswith(f"{name}.") or name.startswith(f"{key}.")
                       or name.rpartition(".")[0] == key.rpartition(".")[0] for name in changes)
        of_sweep |= key in _LOADS
        raise InputError(error.allowed, file=table.file if of_sweep else base.file, key=key,
                         given=error.given) from None


def _rigs(table: Table, rig: Table, choices: Sequence[Choice]) -> list[Rig]:
    """Make the rig of each choice; all choices have the same keys."""
    if any(key.startswith(_RIG) for key in choices[0]):
        return [_rig(table, rig, choice) for choice in choices]
    return [Rig.from_table(rig)] * len(choices)


def _rig(table: Table, rig: Table, choice: Choice) -> Rig:
    """Make the rig of a choice; an error in its keys is an error of the sweep."""
    changes = {key.removeprefix(_RIG): value for key, value in choice.items()
               if key.startswith(_RIG)}
    try:
        return Rig.from_table(Table(rig.file, with_choice(rig.data, changes, table), "rig"))
    except InputError as error:
        raise InputError(error.allowed, file=table.file, key=error.key, given=error.given
                         ) from None


def _load(table: Table, name: str, value: Any) -> float:
    """Read one mass [kg] or voltage [V]."""
    return replace(table, data={**table.data, name: value}).number(name, name, rule=_LOADS[name])


def _loads(table: Table, name: str) -> tuple[float, ...]:
    """Read all masses [kg], which must differ, or all voltages [V], which must ascend."""
    value = table.value(name)
    loads = table.numbers(name, name, rule=_LOADS[name])
    if name == "mass" and len(set(loads)) < len(loads):
        raise table.error(name, "must be different masses", value)
    if name == "voltage" and list(loads) != sorted(set(loads)):
        raise table.error(name, "must ascend", value)
    return loads


def _raw(table: Table, key: str) -> Any:
    """Read the value of a key that may have several forms; None where it is missing."""
    return table.value(key, None)


def _own_table(table: Table, key: str) -> Table | None:
    """Read a table or the file of its keys; None where it is missing."""
    return None if table.value(key, None) is None else table.table_or_file(key)


def _subtable(table: Table, key: str) -> Table:
    """Read a table; it is empty where it is missing."""
    return table.table(key, {})


def _drawn(table: Table, key: str) -> Sample | None:
    """Read the sample; None where there is no sample."""
    inner = table.table(key, {})
    return read(Sample, inner, {(Sample, "ranges"): Table.table}) if inner.data else None


#: Readers of keys that accept more forms than their declaration.
_READERS: Special = {
    (SweepFile, "specimen"): specimen_tables,
    (SweepFile, "mass"): _raw,
    (SweepFile, "voltage"): _raw,
    (SweepFile, "grid"): _subtable,
    (SweepFile, "columns"): _subtable,
    (SweepFile, "sample"): _drawn,
    (SweepFile, "rig"): _own_table,
    (SweepFile, "tolerances"): tolerances_under,
    (SweepFile, "ask"): _asked,
}
