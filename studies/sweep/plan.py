"""SWEEP.toml read and checked whole, before anything is solved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig, checked_load
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen, Unbuildable
from tympan.geometry.toml_reader import Table
from tympan.geometry.units import quantity
from tympan.studies.case import Settings
from tympan.studies.sweep.parameters import Choice, choices, with_choice
from tympan.studies.sweep.task import SweepTask, solver

#: Keys of a choice that are no keys of the specimen: its load, and what begins with this, keys of
#: the rig.
_LOADS = ("mass", "voltage")
_RIG = "rig."


@dataclass(frozen=True)
class Entry:
    """One specimen of a sweep: its name, the file's name it comes from, and what it differs in.

    ``task`` is None where no such specimen can be built, for ``reason``.
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
    """All specimens of a sweep.

    Every one has as many masses as the others, and as many voltages.
    """

    entries: tuple[Entry, ...]
    source: str

    @property
    def cases(self) -> int:
        """How many rows its table has."""
        return sum(len(entry.masses) * len(entry.voltages) for entry in self.entries)


def read_sweep(file: Path, settings: Settings = Settings()) -> Sweep:
    """The sweep of a file; files it names lie beside it.

    Raises
    ------
    InputError
        For unknown keys, wrong units and values out of range of the sweep and of all its specimens,
        naming the file and the key; a combination of allowed values that cannot be built is an
        entry without a task instead, unless all are.
    """
    table = Table.read(file)
    reader = _Reader(table, settings, _fields(table))
    bases = [_Base(path, Table.read(path).data) for path in _files(table, file.parent)]
    for base in bases:
        if sum(other.stem == base.stem for other in bases) > 1:
            raise table.error("specimen", "must be files of different names", base.stem)
    rows = choices(table)
    loads = {name: None if any(name in row for row in rows) else read(table) for name, read in
             (("mass", _masses), ("voltage", _voltages))}
    for name in [name for name in _LOADS if loads[name] is None and name in table]:
        raise table.error(name, "is also varied in [grid], [list] or [sample]: only one of both")
    table.done()
    digits = len(str(max(len(rows) - 1, 1)))
    entries = tuple(reader.entry(base, f"{base.stem}-{number:0{digits}}" if len(rows) > 1
                                 else base.stem, row, loads)
                    for base in bases for number, row in enumerate(rows))
    if all(entry.task is None for entry in entries):
        raise InputError(f"none of the specimens can be built; the first one: {entries[0].reason}",
                         file=file)
    return Sweep(entries, file.read_text(encoding="utf-8-sig"))


@dataclass(frozen=True)
class _Base:
    """A specimen file that the sweep changes."""

    file: Path
    content: Mapping[str, Any]

    @property
    def stem(self) -> str:
        return self.file.stem


@dataclass(frozen=True)
class _Reader:
    """Turns choices into entries; ``table`` is the sweep's, for messages."""

    table: Table
    settings: Settings
    fields: bool

    def entry(self, base: _Base, name: str, choice: Choice,
              loads: Mapping[str, tuple[float, ...] | None]) -> Entry:
        """The entry of one choice of values."""
        masses = loads["mass"] or (self._load(choice, "mass"),)
        voltages = loads["voltage"] or (self._load(choice, "voltage"),)
        for_rig = {key.removeprefix(_RIG): value for key, value in choice.items()
                   if key.startswith(_RIG)}
        changes = {key: value for key, value in choice.items() if key not in _LOADS
                   and not key.startswith(_RIG)}
        rig = self._rig(for_rig)
        try:
            specimen = self._specimen(base, changes)
        except Unbuildable as error:
            reason = str(InputError(error.allowed, key=error.key, given=error.given))
            return Entry(name, base.stem, choice, masses, voltages, None, reason)
        task = SweepTask(specimen, rig, masses, voltages, self.settings, self.fields, solver())
        return Entry(name, base.stem, choice, masses, voltages, task)

    def _specimen(self, base: _Base, changes: Choice) -> Specimen:
        if not changes:
            return load_specimen(base.file)
        content = with_choice(base.content, changes, self.table)
        try:
            return load_specimen(Table(self.table.file, content))
        except Unbuildable:
            raise
        except InputError as error:
            raise self._blamed(error, base.file, changes) from None

    def _blamed(self, error: InputError, file: Path, changes: Choice) -> InputError:
        """The error, told of the sweep if it varies that key or one beside it, else of the file."""
        key = error.key or ""
        varied = any(key == name or key.startswith(f"{name}.") or name.startswith(f"{key}.")
                     for name in changes)
        beside = any(name.rpartition(".")[0] == key.rpartition(".")[0] for name in changes)
        return error if varied or beside else InputError(error.allowed, file=file, key=key,
                                                         given=error.given)

    def _rig(self, changes: Choice) -> Rig:
        given = self.table.value("rig", {})
        if isinstance(given, str):
            own = Table.read(Path(self.table.file).parent / given)
            content, file = own.data, own.file
        else:
            content, file = self.table.table("rig", {}).data, self.table.file
        return Rig.from_table(Table(self.table.file if changes else file,
                                    with_choice(content, changes, self.table),
                                    "" if isinstance(given, str) and not changes else "rig"))

    def _load(self, choice: Choice, name: str) -> float:
        return _load(Table(self.table.file, choice), name, choice[name])


def _fields(table: Table) -> bool:
    value = table.value("fields", False)
    if not isinstance(value, bool):
        raise table.error("fields", "must be true or false", value)
    return value


def _files(table: Table, folder: Path) -> list[Path]:
    value = table.value("specimen")
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise table.error("specimen", "must be a specimen file or a list of them", value)
    return [folder / name for name in names]


def _load(table: Table, name: str, value: Any) -> float:
    """One mass [kg] or voltage [V]."""
    try:
        number = quantity(value, name)
        checked_load(*((number, 0.0) if name == "mass" else (0.0, number)))
    except InputError as error:
        raise InputError(error.allowed, file=table.file, key=table.path(name),
                         given=value) from None
    return number


def _masses(table: Table) -> tuple[float, ...]:
    value = table.value("mass")
    masses = tuple(_load(table, "mass", item)
                   for item in (value if isinstance(value, list) else [value]))
    if not masses or len(set(masses)) < len(masses):
        raise table.error("mass", "must be a mass or a list of different ones", value)
    return masses


def _voltages(table: Table) -> tuple[float, ...]:
    value = table.value("voltage")
    if isinstance(value, Mapping):
        span = table.table("voltage")
        low, high = (_load(span, "voltage", span.value(key)) for key in ("from", "to"))
        count = int(span.number("count", rule=(lambda x: 2 <= x <= 10_000 and x == int(x),
                                               "must be a whole number from 2 to 10000")))
        span.done()
        voltages = tuple(np.linspace(low, high, count).tolist())
    else:
        voltages = tuple(_load(table, "voltage", item)
                         for item in (value if isinstance(value, list) else [value]))
    if not voltages or list(voltages) != sorted(set(voltages)):
        raise table.error("voltage", "must ascend", value)
    return voltages
