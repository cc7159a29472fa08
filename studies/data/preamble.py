"""Statements outside a table's columns: above its headings, between its blocks, in its name."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tympan.base.errors import InputError
from tympan.base.units import quantity
from tympan.tables.column import NUMBER, Heading, Meaning, plain_words, quantity_of, usual_unit
from tympan.tables.formats import Row, decimal_point
from tympan.tables.meanings import SIZES, SPECIMENS

#: A number and its possible unit.
_QUANTITY = re.compile(r"(?<![\w.,])(\d+(?:[.,]\d+)?)\s*([A-Za-zµμ]+)(?![A-Za-z])")
#: A blank between digits.
_SPLIT = re.compile(r"(?<=\d) (?=\d)")
#: Marks that begin a comment or end a name.
_AROUND = "#%;:* "
_SPECIMENS = Meaning.of(SPECIMENS)
#: A name, a mark behind it, and what it names.
_NAMED = re.compile(r"([^:=]+?)\s*[:=]\s*(.+)")
#: Longest statement that is quoted.
_SHOWN = 40


@dataclass(frozen=True)
class Statement:
    """A quantity outside the columns: its place, its words, and its SI value."""

    where: str
    words: str
    value: float

    @property
    def text(self) -> str:
        """Place and words."""
        return f"{self.where} says {self.words[:_SHOWN]!r}"


def stated_quantities(rows: Sequence[Row], dimension: str) -> Iterator[Statement]:
    """Yield quantities of a dimension in rows that are no readings."""
    for line, cells in rows:
        # A decimal comma may have split a number.
        words = _SPLIT.sub(",", " ".join(cell for cell in cells if cell))
        heading = Heading.of(cells[0].strip(_AROUND))
        number = next((cell for cell in map(decimal_point, cells[1:])
                       if NUMBER.fullmatch(cell)), None)
        pairs = [(number, heading.unit)] if number and heading.unit else _QUANTITY.findall(words)
        for value, unit in pairs:
            if (read := _read(value, unit, dimension)) is not None:
                yield Statement(f"line {line}", words, read)


def named_quantities(file: Path, dimension: str) -> Iterator[Statement]:
    """Yield quantities of a dimension in the name of a file: 20 g in "oval_20g.csv"."""
    for value, unit in _QUANTITY.findall(file.stem.replace("_", " ")):
        if (read := _read(value, unit, dimension)) is not None:
            yield Statement("the file's name", file.stem, read)


def _read(value: str, unit: str, dimension: str) -> float | None:
    """Convert a number in a unit to SI; None if the dimension differs."""
    if quantity_of(unit) == dimension:
        with suppress(InputError):  # a number with about 30 digits
            return quantity(f"{decimal_point(value)} {usual_unit(unit)}", dimension)
    return None


def stated_specimen(rows: Sequence[Row]) -> tuple[int, str] | None:
    """Find line and name of the specimen that is named above a table."""
    for line, cells in rows:
        name, _, rest = cells[0].strip(_AROUND).partition(":")
        values = [cell for cell in (rest.strip(), *cells[1:]) if cell]
        if len(values) == 1 and plain_words(name) in _SPECIMENS.words:  # else it is a title
            return line, values[0]
    return None


def explained_columns(rows: Sequence[Row], titles: Sequence[str], count: bool
                      ) -> dict[int, tuple[int, str]]:
    """Find lines that say what columns are, by index: "CH1: HV (kV)", or one that lists all.

    A list counts where the columns have no headings (``count``): "U in kV, s in mm, m in g".
    """
    found: dict[int, tuple[int, str]] = {}
    for line, cells in rows:
        text = ", ".join(cell for cell in cells if cell).strip(_AROUND)
        named = _NAMED.match(text)
        name, rest = (named[1], named[2]) if named else ("", "")
        for place, title in enumerate(titles):
            if name and name.casefold() == title.strip(_AROUND).casefold():
                found[place] = line, rest
        pieces = [piece.strip() for piece in re.split(r"[,;|]", rest or text)]
        if count and len(pieces) == len(titles) > 1:
            found |= {place: (line, piece) for place, piece in enumerate(pieces)}
    return found


def stated_sizes(rows: Sequence[Row]) -> dict[str, float]:
    """Read sizes of a test piece [m] by name; a symbol may follow, as in "Probendicke a0"."""
    sizes: dict[str, float] = {}
    for _, row in rows:
        first, colon, value = row[0].lstrip(_AROUND).partition(":")
        number, _, unit = value.strip().partition(" ")
        cells = [first, number, unit] if colon and number else [first, *row[1:]]
        heading = Heading.of(first.rstrip())
        shorter = heading.words.rpartition(" ")[0]
        name = next((key for key, size in SIZES.items()
                     if heading.words in size.words or (shorter and shorter in size.words)), None)
        numbers = map(decimal_point, cells[1:])
        size_text = next((cell for cell in numbers if NUMBER.fullmatch(cell)), None)
        unit = heading.unit or next((cell for cell in cells[2:] if cell), "mm")
        size = _read(size_text, unit, "length") if name and size_text else None
        if name and size is not None:
            sizes.setdefault(name, size)
    return sizes
