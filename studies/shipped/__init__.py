"""Files that come with tympan: the source paper's three actuators, and a study of them.

Their sizes and loads are the paper's. Their material is from the library: the paper's own
constants give no stable membrane (``fem/film/library.toml``).
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from tympan.base.toml_reader import Table
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import load_actuator
from tympan.geometry.specimen import Specimen

#: File of each actuator by its name, the circle first, the large ellipse last.
FILES = {name: Path(__file__).with_name(f"{name}.toml")
         for name in ("circular", "elliptical-small", "elliptical-large")}

#: Study of the three actuators under the paper's loads.
STUDY = Path(__file__).with_name("study.toml")


#: What a file may give in place of a specimen.
_SPECIMEN = f"a specimen: its file, the paper's {', '.join(FILES)}, or the tables of one"


def specimen_tables(table: Table, key: str) -> tuple[Table, ...]:
    """Read the tables of specimens that a file names, or contains, one or several under a key.

    A name is that of a file, relative to the table's own, or of one of the paper's actuators. It
    may also be the only key of a table, ``file``.
    """
    return tuple(_specimen_table(table, key, part) for part in table.parts(key, _SPECIMEN))


def _specimen_table(table: Table, key: str, part: str | Table) -> Table:
    if isinstance(part, Table) and "file" in part:
        others = [key for key in part.data if key != "file"]
        if others:
            raise part.error("file", "must stand alone, or the specimen's own keys without it: "
                                     f"there is also {', '.join(others)}", part.data["file"])
        return Table.read(part.beside("file"), "specimen")
    if isinstance(part, Table):
        part.knows("file", ("specimen", "path"), "the name of a specimen's own file")
        return part
    return Table.read(FILES[part] if part in FILES else table.named_file(key, part), "specimen")


def load_named(given: Path | str) -> Specimen:
    """Load a specimen from its file, or one of the paper's actuators by its name.

    A file of that name comes first.
    """
    named = FILES.get(str(given))
    return load_actuator(given if named is None or Path(given).exists() else named)


@cache
def actuators() -> tuple[Specimen, ...]:
    """Load the three actuators, the circle first."""
    return tuple(map(load_specimen, FILES.values()))
