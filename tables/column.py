"""A column of a table: its name and unit, its cells, and other names for it."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from typing import Any, Self

from tympan.base.errors import InputError
from tympan.base.toml_reader import FINITE, Rule
from tympan.base.units import SPELLED, USUAL, any_quantity, bounded, quantity, unit_factor
from tympan.tables.formats import DECIMAL_COMMA, THOUSANDS

#: Cells that mean that a reading was not made.
_NOTHING_READ = ("", "-", "–", "n/a", "na")

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
#: A number with thousands separators, which is ambiguous.
_GROUPED = re.compile(r"[-+]?\d{1,3}(?:([.,' \u2019\u00a0\u202f])\d{3})(?:\1\d{3})*(?:[.,]\d+)?")


#: Words in headings that do not describe the column.
_EMPTY_WORDS = frozenset((
    "engineering", "nominal", "nominale", "nenn", "technische", "technisch", "measured", "gemessen",
    "gemessene", "mesure", "mesuree", "axial", "axiale", "value", "wert", "the", "der", "die",
    "das", "le", "la", "de", "du"))
#: Units of plain numbers, with their values.
_PLAIN_UNITS = {"": 1.0, "-": 1.0, "1": 1.0, "mm/mm": 1.0, "m/m": 1.0, "in/in": 1.0, "%": 0.01}
#: The degree Celsius, which is no multiple of another unit.
CELSIUS = "C"
_BRACKETS = re.compile(r"(.*?)[\s_,/]*[\[(<]\s*([^\[\](){}<>]*?)\s*[\])>]")
#: Brackets with a unit and possibly more words, which other words may follow.
_UNIT_AND_WORDS = re.compile(r"(.*?)[\s_]*[\[(]\s*([^\s,;\[\]()]+)[\s,;]*([^\[\]()]*)[\])](.*)")
_UNIT_LAST = re.compile(r"(.*?)(?:\s*[/,_]\s*|\s+in\s+|\s+en\s+|\s+)([^\s_,]+)")
_UNIT_NAME = re.compile(r"[A-Za-z]+")
#: Units that name a channel where they stand behind a word alone: "Kanal 1", "Channel A".
_NAMES = ("1", "A", "F")
#: Number of headings kept: a table is read several times.
_KEPT = 4096
#: Full-width brackets of Chinese and Japanese, and the plain ones.
_WIDE = str.maketrans("（）［］／", "()[]/")
#: Least length of a word that is recognised inside another: shorter ones occur by chance.
_INSIDE = 5
#: Least length of a word that is recognised at the end of another: "Weg" of "Plattenweg".
_AT_END = 3


@dataclass(frozen=True)
class Heading:
    """A heading of another writer's table: ``words`` in small plain letters, and its ``unit``."""

    words: str
    unit: str = ""

    @classmethod
    def of(cls, title: str) -> Self:
        """Split a heading into words and unit.

        Examples
        --------
        >>> Heading.of("Déplacement / µm"), Heading.of("Engineering Stress (N/mm²)")
        (Heading(words='deplacement', unit='um'), Heading(words='stress', unit='N/mm^2'))
        >>> Heading.of("Weg (mm) Mitte"), Heading.of("Displacement [mm, up]")
        (Heading(words='weg mitte', unit='mm'), Heading(words='displacement up', unit='mm'))
        """
        return cls(*_words_and_unit(title.translate(_WIDE)))


@lru_cache(_KEPT)
def _words_and_unit(title: str) -> tuple[str, str]:
    match = _BRACKETS.fullmatch(title)
    if match and (unit := usual_unit(match[2])) is not None:
        return plain_words(match[1]), unit
    more = _UNIT_AND_WORDS.fullmatch(title)
    if more and (unit := usual_unit(more[2])):
        return plain_words(" ".join((more[1], more[3], more[4]))), unit
    if match:
        return plain_words(match[1]), match[2]
    match = _UNIT_LAST.fullmatch(title)
    if match and (unit := usual_unit(match[2])) and ("/" in title or unit not in _NAMES):
        return plain_words(match[1]), unit
    return plain_words(title), ""


@dataclass(frozen=True)
class Meaning:
    """One of the meanings of a column's headings, and the conversion to the column's values.

    ``words`` are those of headings. Numbers in a unit like ``unit`` ("" for plain ones) are divided
    by the size of the test piece that ``per`` names, "area" or "length"; then ``offset`` is added.
    """

    words: frozenset[str]
    unit: str = ""
    per: str = ""
    offset: float = 0.0

    @classmethod
    def of(cls, words: str, unit: str = "", per: str = "", offset: float = 0.0) -> Self:
        """Make the meaning of words separated by commas."""
        return cls(frozenset(map(plain_words, words.split(","))), unit, per, offset)

    def alluded(self, words: str) -> bool:
        """Check whether one of its words is among those of a heading, or part of one.

        Examples
        --------
        >>> weg = Meaning.of("weg, auslenkung", "mm")
        >>> [weg.alluded(words) for words in ("weg mitte", "plattenauslenkung", "wegener")]
        [True, True, False]
        """
        return _alluded(self.words, words)

    def factor(self, unit: str) -> float | None:
        """Compute the factor that converts a unit to SI; None if the unit does not fit."""
        if self.unit == CELSIUS:
            return 1.0 if unit == CELSIUS else None
        if not self.unit:
            return _PLAIN_UNITS.get(unit)
        return _fitting_factor(unit, dimension_of(self.unit))


@lru_cache(_KEPT)
def _alluded(known: frozenset[str], words: str) -> bool:
    parts = words.split()
    return any(f" {word} " in f" {words} "
               or ((len(word) >= _INSIDE or not word.isascii()) and word in words)
               or (len(word) >= _AT_END and any(part.endswith(word) for part in parts))
               for word in known)


def plain_words(text: str) -> str:
    """Write words in small letters without accents, without those that do not describe."""
    plain = unicodedata.normalize("NFKD", text.casefold())
    letters = "".join(mark if mark.isalnum() else " " for mark in plain
                      if not unicodedata.combining(mark))
    for double, single in (("ae", "a"), ("oe", "o"), ("ue", "u")):
        letters = letters.replace(double, single)
    return " ".join(word for word in letters.split() if word not in _EMPTY_WORDS)


@cache
def usual_unit(text: str) -> str | None:
    """Write a unit of a heading as quantities spell it; None if it is no unit."""
    unit = unicodedata.normalize("NFKC", text.strip().replace("²", "^2").replace("³", "^3"))
    unit = unit.replace("\u03bc", "u").replace("\u00b0C", CELSIUS)
    unit = SPELLED.get(unit.rstrip(".").casefold(), unit)
    if unit in _PLAIN_UNITS or unit == CELSIUS:
        return unit
    names = _UNIT_NAME.findall(unit)
    known = bool(names) and all(name in USUAL for name in names)
    return unit if known and any_quantity(f"1 {unit}") else None


@cache
def quantity_of(unit: str) -> str:
    """Find the dimension of a heading's unit; "" for plain numbers, degrees, and no unit.

    Examples
    --------
    >>> quantity_of("µm"), quantity_of("%"), quantity_of("°C"), quantity_of("of 4")
    ('length', '', '', '')
    """
    usual = usual_unit(unit) if unit else None
    plain = not usual or usual in _PLAIN_UNITS or usual == CELSIUS
    return "" if plain else dimension_of(str(usual))


@cache
def _fitting_factor(unit: str, dimension: str) -> float | None:
    known = usual_unit(unit)
    try:
        return unit_factor(known, dimension) if known and known not in _PLAIN_UNITS else None
    except InputError:
        return None


@dataclass(frozen=True)
class Column:
    """A column of numbers, or one of texts as :meth:`labels` makes it.

    ``unit`` is the usual one, with ``_per_`` for a quotient, "" for plain numbers; ``rule`` holds
    for SI values. Only columns that are not ``required`` may be left out or have blank cells, which
    read as nan or ""; ``absent`` is how nan is written, and also read as blank. ``choices`` are
    None for numbers, and empty where any text is allowed; ``example`` is one of these. ``also`` are
    meanings of other writers' headings, the best first.
    """

    name: str
    unit: str = ""
    rule: Rule = FINITE
    required: bool = True
    absent: str = ""
    choices: Collection[str] | None = field(default=None, hash=False)
    also: tuple[Meaning, ...] = ()
    example: str = "1"

    @classmethod
    def labels(cls, name: str, choices: Collection[str] = (), required: bool = True,
               also: str = "") -> Column:
        """Make a column of texts, of ``choices`` if there are any; of a registry those it has."""
        meanings = (Meaning.of(also),) if also else ()
        return cls(name, required=required, choices=choices, also=meanings)

    @property
    def title(self) -> str:
        """The usual name in the first line."""
        return f"{self.name}_{self.unit}" if self.unit else self.name

    @property
    def dimension(self) -> str:
        """Dimension of :data:`tympan.base.units.DIMENSIONS`, "" for plain numbers and texts."""
        return dimension_of(self.unit) if self.unit else ""

    @property
    def blank(self) -> float | str:
        """Value of an empty cell."""
        return math.nan if self.choices is None else ""

    def knows(self, words: str) -> bool:
        """Check whether all words of a heading are those of one of its meanings."""
        return any(words in meaning.words for meaning in self.also)

    def alludes(self, words: str) -> bool:
        """Check for a word of its meanings among those of a heading, or as part of one."""
        return any(meaning.alluded(words) for meaning in self.also)

    def claims(self, title: str) -> bool:
        """Check whether a name of the first line is this column's, with any unit."""
        if not self.unit:
            return title == self.name
        start, unit = title[: len(self.name) + 1], title[len(self.name) + 1 :]
        return start == f"{self.name}_" and unit.replace("_per_", "").replace("/", "").isalpha()

    def factor(self, title: str) -> float:
        """Find the SI value of the unit in a name."""
        if not self.unit:
            return 1.0
        unit = title[len(self.name) + 1 :]
        written = _written(unit)
        if written != unit:
            return quantity(f"1 {written}", self.dimension)
        return unit_factor(unit, self.dimension)

    def texts(self, values: Sequence[Any]) -> list[str]:
        """Write cells of SI values, with the digits that read back to 12 places, or of texts."""
        if self.choices is not None:
            return list(values)
        factor = self.factor(self.title)
        return [self.absent if math.isnan(value) else f"{value / factor:.12g}" for value in values]

    def value(self, cell: str, factor: float, offset: float = 0.0) -> float | str:
        """Read the text or SI value of a cell; an :class:`InputError` says what it must be."""
        if not self.required and cell in ("", self.absent):
            return self.blank
        if self.choices is not None:
            if self.choices and cell not in self.choices:
                blank = "" if self.required else ", or blank"
                raise InputError(f"must be one of {', '.join(self.choices)}{blank}")
            if not cell:
                raise InputError("must not be blank")
            return cell
        if not NUMBER.fullmatch(cell):
            raise InputError(_no_number(cell))
        value = bounded(float(cell) * factor + offset)
        holds, words = self.rule
        if not holds(value):
            raise InputError(words)
        return value


def _written(unit: str) -> str:
    """Write the unit that ends a name as a quantity has it: "kg/m^3" for "kg_per_m3"."""
    return re.sub(r"(?<=[a-z])(?=[23]\b)", "^", unit.replace("_per_", "/"))


@cache
def dimension_of(unit: str) -> str:
    """Find the dimension of a unit, with ``_per_`` for a quotient."""
    number = any_quantity(f"1 {_written(unit)}")
    if number is None:
        raise ValueError(f"no unit: {unit}")
    return number[1]


def _no_number(cell: str) -> str:
    if cell.lower() in _NOTHING_READ:
        return "must be a number; leave out what was not read"
    if cell.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        return "must be finite"
    if THOUSANDS.fullmatch(cell):
        return (f"must be a number without a thousands separator and with a decimal point: "
                f"{cell.replace(',', '')} or {cell.replace(',', '.')}")
    if _GROUPED.fullmatch(cell):
        return "must be a number without thousands separators and with a decimal point"
    if DECIMAL_COMMA.fullmatch(cell):
        return f"must be a number with a decimal point, such as {cell.replace(',', '.')}"
    start = NUMBER.match(cell)
    if start and cell[start.end():].strip().isalpha():
        return "must be a number alone: its unit stands in the name of the column"
    return "must be a number"
