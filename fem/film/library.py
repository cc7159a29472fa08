"""Cited material constants, by name; and names that are refused, with the reason."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tympan.fem.film.admissibility import STRETCH_RANGE, checked
from tympan.fem.film.breakdown import STRENGTH_LIBRARY
from tympan.fem.film.flows import ShearThinning as ShearThinning  # so files may name it
from tympan.fem.film.laws import LAWS
from tympan.geometry.errors import InputError
from tympan.geometry.fields import Key, Special, read
from tympan.geometry.specimen import (
    STRENGTHS,
    Film,
    Material,
    Specimen,
    Strength,
    ViscousBranch,
)
from tympan.geometry.toml_reader import POSITIVE, Table


@dataclass(frozen=True)
class LibraryMaterial:
    """A material of the library; what is of the film only where known."""

    material: Annotated[Material, Key("the law with its constants", kinds=LAWS)]
    source: Annotated[str, Key("where the constants come from")]
    caveat: Annotated[str, Key("what to beware of")]
    branches: Annotated[tuple[ViscousBranch, ...], Key(
        "viscous branches beside the law", name="branch")] = ()
    density: Annotated[float | None, Key("of the film", "density")] = None
    relative_permittivity: Annotated[float | None, Key("of the film")] = None
    breakdown: Annotated[str, Key("name of the film's electric strength")] = ""
    film_source: Annotated[str, Key("where density and permittivity come from")] = ""


DEFAULT = "vhb-4910"

_FILE = Path(__file__).with_name("library.toml")
_LIBRARY = tomllib.loads(_FILE.read_text(encoding="utf-8"))

MATERIALS: dict[str, LibraryMaterial] = {
    name: read(LibraryMaterial,
               Table(_FILE, _LIBRARY["films"][entry.pop("film")] | entry, plain=True))
    for name, entry in _LIBRARY["materials"].items()}

#: Why no film can be made of some constants; and these as laws, to be examined.
REFUSED: dict[str, str] = {name: entry["reason"] for name, entry in _LIBRARY["refused"].items()}
EXAMINED: dict[str, Material] = {name: LAWS.read(Table(_FILE, entry["material"], plain=True))
                                 for name, entry in _LIBRARY["refused"].items()}


def read_material(table: Table, key: str) -> Material:
    """The material under a key: a name of the library, or a table with ``law`` and its constants.

    ``range`` in the table are the in-plane stretches the law is meant for, such as those of the
    tests it was fitted to: it must be admissible over them, by default over
    :data:`~tympan.fem.film.admissibility.STRETCH_RANGE`. What a solution visits beyond is checked
    then and told in its warnings.
    """
    name = table.value(key)
    if isinstance(name, str) and name in REFUSED:
        raise table.error(key, f"cannot be a membrane material: {REFUSED[name]}", name)
    return _read(table, key, checked)


def examine_material(table: Table, key: str) -> Material:
    """The material under a key, admissible or not, also of the refused names: to look at only."""
    name = table.value(key)
    if isinstance(name, str) and name in EXAMINED:
        return EXAMINED[name]
    return _read(table, key, lambda material, *_: material)


def _read(table: Table, key: str, check: Callable[..., Material]) -> Material:
    if isinstance(table.value(key), str):
        return table.choice(key, MATERIALS).material
    constants = table.table(key)
    low, high = constants.numbers("range", "", STRETCH_RANGE, POSITIVE, 2)
    if not low < high <= 20:
        raise constants.error("range", "must be two stretches, the smaller first, at most 20",
                              [low, high])
    material = LAWS.read(constants)
    try:
        return check(material, low, high)
    except InputError as error:
        raise error.located(file=table.file, key=constants.where) from None


def read_strength(table: Table, key: str) -> Strength | None:
    """The strength under a key: a name of the library, or a table with ``law`` and its constants.

    Without the key that of the library material named in the same table, None where there is none.
    """
    if key not in table:
        table.asked.add(key)
        film = MATERIALS.get(str(table.data.get("material")))
        return STRENGTH_LIBRARY[film.breakdown].strength if film and film.breakdown else None
    if isinstance(table.value(key), str):
        return table.choice(key, STRENGTH_LIBRARY).strength
    strength: Strength = STRENGTHS.read(table.table(key))
    return strength


def read_branches(table: Table, key: str) -> tuple[ViscousBranch, ...]:
    """The branches under a key; without it those of the library material named in the table."""
    if key not in table:
        table.asked.add(key)
        film = MATERIALS.get(str(table.data.get("material")))
        return film.branches if film else ()
    return tuple(read(ViscousBranch, branch) for branch in table.tables(key))


#: Readers of what of a film a file may also name.
READERS: Special = {(Film, "material"): read_material, (Film, "strength"): read_strength,
                    (Film, "branches"): read_branches}


def load_specimen(source: Table | Path | str) -> Specimen:
    """The specimen of a TOML file or table, with the laws and the library known here."""
    return read(Specimen, source if isinstance(source, Table) else Table.read(source), READERS)
