"""Cited material constants, by name; and names that are refused, with the reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Annotated, Any

from tympan.base.errors import InputError
from tympan.base.fields import Content, Key, Special, read, read_some
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Library, Table, one_of
from tympan.fem.film.admissibility import STRETCH_RANGE, checked
from tympan.fem.film.breakdown import STRENGTH_LIBRARY
from tympan.fem.film.flows import ShearThinning as ShearThinning  # so files may name it
from tympan.fem.film.laws import LAWS
from tympan.geometry.specimen import (
    STRENGTHS,
    Film,
    LibraryEntry,
    Material,
    Specimen,
    Strength,
    ViscousBranch,
    check_range,
)


@dataclass(frozen=True)
class FilmScatter:
    """Scatter of films of one kind: relative standard deviations, None where no source gives it."""

    thickness: Annotated[float | None, Key("of the virgin film", rule=NON_NEGATIVE)] = None
    stiffness: Annotated[float | None, Key("of the whole law", rule=NON_NEGATIVE)] = None
    permittivity: Annotated[float | None, Key("of the film", rule=NON_NEGATIVE)] = None
    source: Annotated[str, Key("where they come from")] = ""


@dataclass(frozen=True)
class LibraryMaterial:
    """A material of the library; what is of the film only where known.

    A film made of it has its law, and what else the library knows of the film and the film itself
    does not say. It also serves as the law, whose constants are its attributes.
    """

    material: Annotated[Material, Key("the law with its constants", kinds=LAWS)]
    source: Annotated[str, Key("where the constants come from")]
    caveat: Annotated[str, Key("what to beware of")]
    branches: Annotated[tuple[ViscousBranch, ...], Key(
        "viscous branches beside the law", name="branch")] = ()
    density: Annotated[float | None, Key("of the film", "density")] = None
    relative_permittivity: Annotated[float | None, Key("of the film")] = None
    breakdown: Annotated[str, Key("name of the film's electric strength")] = ""
    film_source: Annotated[str, Key("where density and permittivity come from")] = ""
    scatter: Annotated[FilmScatter, Key("how films differ")] = FilmScatter()
    law_range: Annotated[tuple[float, float] | None, Key(
        "principal stretches the law was tested at, thickness included", rule=POSITIVE,
        name="range")] = None

    @property
    def of_film(self) -> dict[str, Any]:
        """Properties of a film that states none of its own, by the names of its fields."""
        known: dict[str, Any] = {"branches": self.branches}
        if self.breakdown:
            known["strength"] = library_strength(self.breakdown)
        if self.relative_permittivity is not None:
            known["relative_permittivity"] = self.relative_permittivity
        if self.law_range is not None:
            known["law_range"] = self.law_range
        return known

    def holds(self, prestretch: tuple[float, float]) -> bool:
        """Check that the law was tested at a prestretch; True if it has no range of stretches."""
        l1, l2 = prestretch
        low, high = self.law_range or (0.0, float("inf"))
        return low <= min(l1, l2, 1 / (l1 * l2)) and max(l1, l2) <= high

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name == "material":  # as unpickling does
            raise AttributeError(name)
        return getattr(self.material, name)


@dataclass(frozen=True)
class StatedMaterial:
    """A law with what its table or file states of films of it, by the names of the film's fields.

    So the principal stretches that the law is meant for, ``law_range``.
    """

    material: Material
    of_film: dict[str, Any]


DEFAULT = "vhb-4910"

#: End of the name of a file; other names of materials are of the library.
_OF_FILE = ".toml"
#: What a file states of a material's films besides the law, by the names of a film's fields.
_OF_MATERIAL = ("branches", "relative_permittivity", "strength", "density", "temperature_power")

_FILE = Path(__file__).with_name("library.toml")


def _with_films(library: Content) -> Content:
    """Find the tables of materials, each with what is known of the film that is made of it."""
    films: dict[str, Content] = library["films"]

    def known(film: str, **entry: Any) -> Content:
        return films[film] | entry

    return {name: known(**entry) for name, entry in library["materials"].items()}


MATERIALS = Library(_FILE, _with_films, partial(read, LibraryMaterial))

#: Reasons why some constants cannot make a film; and their laws, which can be examined.
REFUSED: Library[str] = Library(_FILE, itemgetter("refused"), lambda table: table.data["reason"])
EXAMINED: Library[Material] = Library(_FILE, itemgetter("refused"),
                                      lambda table: LAWS.read(table.table("material")))


def read_material(table: Table, key: str) -> Material | LibraryEntry:
    """Read the material under a key: a name of the library, or a table of a ``law`` with constants.

    ``range`` in the table are the principal stretches the law is meant for, such as those of the
    tests it was fitted to, the thickness included. The law must be admissible over in-plane
    stretches in it, by default in :data:`~tympan.fem.film.admissibility.STRETCH_RANGE`. A solution
    that visits stretches beyond warns: see :func:`~tympan.fem.film.admissibility.failures`.
    """
    return _read(table, key, checked)


def library_material(name: str) -> LibraryMaterial:
    """Find a material by its name; an :class:`InputError` if it is refused or unknown."""
    if name in REFUSED:
        raise InputError(f"cannot be a membrane material: {REFUSED[name]}", key="material",
                         given=name)
    if name not in MATERIALS:
        raise InputError(one_of(name, MATERIALS), key="material", given=name)
    return MATERIALS[name]


def material_named(name: str) -> LibraryMaterial | StatedMaterial:
    """Find a material of the library by its name, or read one from a file NAME.toml."""
    return (_of_file(Table.read(name), checked) if name.endswith(_OF_FILE)
            else library_material(name))


def material_name(film: Film) -> str | None:
    """Find the name of the library's material that a film is made of, None if there is none.

    A file or constructor that gives this name and the film's other properties makes an equal film.
    """
    def shared(entry: LibraryMaterial) -> list[bool]:
        return [getattr(film, key) == known for key, known in entry.of_film.items()]

    made = [name for name, entry in MATERIALS.items()
            if (entry.material, entry.law_range) == (film.material, film.law_range)
            and all(same or getattr(film, key)  # what a file leaves out would be the library's
                    for key, same in zip(entry.of_film, shared(entry), strict=True))]
    return max(made, key=lambda name: sum(shared(MATERIALS[name])), default=None)


def library_strength(name: str) -> Strength:
    """Find a strength by its name; an :class:`InputError` if it is unknown."""
    if name not in STRENGTH_LIBRARY:
        raise InputError(one_of(name, STRENGTH_LIBRARY), key="breakdown", given=name)
    return STRENGTH_LIBRARY[name].strength


LAWS.by_name = material_named
STRENGTHS.by_name = library_strength


def examine_material(table: Table, key: str) -> Material | LibraryEntry:
    """Read the material under a key for examination: inadmissible and refused ones, too."""
    name = table.value(key)
    if isinstance(name, str) and name in EXAMINED:
        return EXAMINED[name]
    return _read(table, key, lambda material, *_: material)


def _read(table: Table, key: str, check: Callable[..., Material]) -> Material | LibraryEntry:
    name = table.value(key)
    if isinstance(name, str) and name.endswith(_OF_FILE):
        return _of_file(Table.read(table.beside(key)), check)
    if isinstance(name, str):
        return table.named(key, library_material)
    constants = table.table(key)
    stated = "range" in constants
    low, high = constants.numbers("range", "", STRETCH_RANGE, POSITIVE, 2)
    try:
        check_range(low, high)
    except InputError as error:
        raise constants.error("range", error.allowed, [low, high]) from None
    material = LAWS.read(constants)
    try:
        law = check(material, low, high)
    except InputError as error:
        raise error.located(file=table.file, key=constants.where) from None
    return StatedMaterial(law, {"law_range": (low, high)}) if stated else law


def _of_file(file: Table, check: Callable[..., Material]) -> StatedMaterial:
    """Read a material from a file of it, as ``material fit`` writes, or of a specimen.

    Thickness, prestretch and other properties of a specimen's film are not of its material.
    """
    film = file.table("membrane")
    law: Any = _read(film, "material", check)
    known = law.of_film if isinstance(law, LibraryMaterial | StatedMaterial) else {}
    return StatedMaterial(law.material if known else law,
                          known | read_some(Film, film, _OF_MATERIAL))


#: Readers of values of a film that a file may also give by name.
READERS: Special = {(Film, "material"): read_material}


def load_specimen(source: Table | Path | str) -> Specimen:
    """Read the specimen of a TOML file or table, with the known laws and the library."""
    table = source if isinstance(source, Table) else Table.read(source, "specimen")
    return read(Specimen, table, READERS)
