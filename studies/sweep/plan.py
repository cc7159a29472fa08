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
from tympan.geometry.toml_reader import Rule, Table
from tympan.geometry.units import quantity
from tympan.studies.case import Settings
from tympan.studies.sweep.parameters import Choice, choices, with_choice
from tympan.studies.sweep.task import SweepTask, solver

#: Keys of a choice that are no keys of the specimen: its load, and what begins with this, keys of
#: the rig.
_LOADS = ("mass", "voltage")
_RIG = "rig."

_COUNT: Rule = (lambda x: 2 <= x <= 10_000 and x == int(x),
                "must be a whole number from 2 to 10000")


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
    """All specimens of a sweep, each with as many masses and as many voltages as the others."""

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
    fields = table.truth("fields", False)
    given = table.value("specimen")
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise table.error("specimen", "must be a specimen file or a list of them", given)
    bases = {file.parent / name: Table.read(file.parent / name).data for name in names}
    stems = [Path(name).stem for name in names]
    for stem in stems:
        if stems.count(stem) > 1:
            raise table.error("specimen", "must be files of different names", stem)
    rows = choices(table)
    loads = {name: None if any(name in row for row in rows) else read(table) for name, read in
             (("mass", _masses), ("voltage", _voltages))}
    for name in [name for name in _LOADS if loads[name] is None and name in table]:
        raise table.error(name, "is also varied in [grid], [list] or [sample]: only one of both")
    rigs = [_rig(table, row) for row in rows]
    table.done()
    digits = len(str(max(len(rows) - 1, 1)))

    def entry(base: Path, number: int) -> Entry:
        choice = rows[number]
        name = f"{base.stem}-{number:0{digits}}" if len(rows) > 1 else base.stem
        masses, voltages = (
            loads[load] or (_load(Table(table.file, choice), load, choice[load]),)
            for load in _LOADS)
        try:
            specimen = _specimen(table, base, bases[base], choice)
        except Unbuildable as error:
            reason = str(InputError(error.allowed, key=error.key, given=error.given))
            return Entry(name, base.stem, choice, masses, voltages, None, reason)
        task = SweepTask(specimen, rigs[number], masses, voltages, settings, fields, solver())
        return Entry(name, base.stem, choice, masses, voltages, task)

    entries = tuple(entry(base, number) for base in bases for number in range(len(rows)))
    if all(entry.task is None for entry in entries):
        raise InputError(f"none of the specimens can be built; the first one: {entries[0].reason}",
                         file=file)
    return Sweep(entries, file.read_text(encoding="utf-8-sig"))


def _specimen(table: Table, file: Path, content: Mapping[str, Any], choice: Choice) -> Specimen:
    """The specimen of a file, changed.

    An error is told of the sweep if that varies the key or one beside it, else of the file.
    """
    changes = {key: value for key, value in choice.items()
               if key not in _LOADS and not key.startswith(_RIG)}
    if not changes:
        return load_specimen(file)
    changed = with_choice(content, changes, table)
    try:
        return load_specimen(Table(table.file, changed))
    except Unbuildable:
        raise
    except InputError as error:
        key = error.key or ""
        if any(key == name or key.startswith(f"{name}.") or name.startswith(f"{key}.")
               or name.rpartition(".")[0] == key.rpartition(".")[0] for name in changes):
            raise
        raise InputError(error.allowed, file=file, key=key, given=error.given) from None


def _rig(table: Table, choice: Choice) -> Rig:
    """The rig of a choice; one of a file of its own is told of that unless the sweep changes it."""
    changes = {key.removeprefix(_RIG): value for key, value in choice.items()
               if key.startswith(_RIG)}
    given = table.value("rig", {})
    if not isinstance(given, str):
        content = table.table("rig", {}).data
        return Rig.from_table(Table(table.file, with_choice(content, changes, table), "rig"))
    rig = Table.read(Path(table.file).parent / given)
    if not changes:
        return Rig.from_table(rig)
    return Rig.from_table(Table(table.file, with_choice(rig.data, changes, table), "rig"))


def _load(table: Table, name: str, value: Any) -> float:
    """One mass [kg] or voltage [V]."""
    try:
        number = quantity(value, name)
        checked_load(*((number, 0.0) if name == "mass" else (0.0, number)))
    except InputError as error:
        raise InputError(error.allowed, file=table.file, key=table.path(name),
                         given=value) from None
    return number


def _loads(table: Table, name: str, value: Any) -> tuple[float, ...]:
    values = value if isinstance(value, list) else [value]
    return tuple(_load(table, name, item) for item in values)


def _masses(table: Table) -> tuple[float, ...]:
    value = table.value("mass")
    masses = _loads(table, "mass", value)
    if not masses or len(set(masses)) < len(masses):
        raise table.error("mass", "must be a mass or a list of different ones", value)
    return masses


def _voltages(table: Table) -> tuple[float, ...]:
    value = table.value("voltage")
    if isinstance(value, Mapping):
        span = table.table("voltage")
        low, high = (_load(span, "voltage", span.value(key)) for key in ("from", "to"))
        count = int(span.number("count", rule=_COUNT))
        span.done()
        voltages = tuple(np.linspace(low, high, count).tolist())
    else:
        voltages = _loads(table, "voltage", value)
    if not voltages or list(voltages) != sorted(set(voltages)):
        raise table.error("voltage", "must ascend", value)
    return voltages
