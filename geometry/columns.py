"""CSV tables with the unit in the columns' names.

Columns may stand in any order, and any unit of the right dimension may stand in a name:
``displacement_um`` reads as ``displacement_mm`` does, because the name says which it is. Inside,
numbers are SI.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError, did_you_mean
from tympan.geometry.formats import (
    DECIMAL_COMMA,
    THOUSANDS,
    Row,
    read_rows,
    readers,
    unfolded,
)
from tympan.geometry.read_file import file_bytes
from tympan.geometry.toml_reader import FINITE, Rule
from tympan.geometry.units import any_quantity, bounded, quantity, unit_factor

#: How a reading that was not made is written.
_NOTHING_READ = ("", "-", "–", "n/a", "na")

#: Rows of a table that are texts at a time: as numbers they take a tenth of the memory.
TOGETHER = 10_000

#: So much of a line is shown.
_SHOWN = 80
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
#: A number with thousands separators, which no program reads by itself.
_GROUPED = re.compile(r"[-+]?\d{1,3}(?:([.,' \u2019\u00a0\u202f])\d{3})(?:\1\d{3})*(?:[.,]\d+)?")


@dataclass(frozen=True)
class Column:
    """A column of numbers, or one of texts as :meth:`labels` makes it.

    ``unit`` is the usual one, with ``_per_`` for a quotient, "" for plain numbers; ``rule`` holds
    for SI values. Only columns that are not ``required`` may be left out or have blank cells, which
    read as nan or ""; ``absent`` is how nan is written, and read besides blanks. ``choices`` are
    None for numbers, and empty where any text will do.
    """

    name: str
    unit: str = ""
    rule: Rule = FINITE
    required: bool = True
    absent: str = ""
    choices: tuple[str, ...] | None = None

    @classmethod
    def labels(cls, name: str, choices: Iterable[str] = (), required: bool = True) -> Column:
        """A column of texts, of ``choices`` if there are any."""
        return cls(name, required=required, choices=tuple(choices))

    @property
    def title(self) -> str:
        """The usual name in the first line."""
        return f"{self.name}_{self.unit}" if self.unit else self.name

    @property
    def dimension(self) -> str:
        """One of :data:`tympan.geometry.units.DIMENSIONS`, "" for plain numbers and texts."""
        return _dimension(self.unit) if self.unit else ""

    @property
    def blank(self) -> float | str:
        """What an empty cell reads as."""
        return math.nan if self.choices is None else ""

    def claims(self, title: str) -> bool:
        """Whether a name of the first line is this column's, with whatever unit."""
        if not self.unit:
            return title == self.name
        start, unit = title[: len(self.name) + 1], title[len(self.name) + 1 :]
        return start == f"{self.name}_" and unit.replace("_per_", "").replace("/", "").isalpha()

    def factor(self, title: str) -> float:
        """SI value of the unit in a name."""
        if not self.unit:
            return 1.0
        unit = title[len(self.name) + 1 :]
        quotient = unit.replace("_per_", "/")
        if "/" in quotient:
            return quantity(f"1 {quotient}", self.dimension)
        return unit_factor(unit, self.dimension)

    def texts(self, values: Sequence[Any]) -> list[str]:
        """Cells of SI values, with the digits that read back to 12 places, or of texts."""
        if self.choices is not None:
            return list(values)
        factor = self.factor(self.title)
        return [self.absent if math.isnan(value) else f"{value / factor:.12g}" for value in values]

    def value(self, cell: str, factor: float) -> float | str:
        """The text or SI value of a cell, or an :class:`InputError` that says what it must be."""
        if not self.required and cell in ("", self.absent):
            return self.blank
        if self.choices is not None:
            if self.choices and cell not in self.choices:
                blank = "" if self.required else ", or blank"
                raise InputError(f"must be one of {', '.join(self.choices)}{blank}")
            if not cell:
                raise InputError("must not be blank")
            return cell
        if not _NUMBER.fullmatch(cell):
            raise InputError(_no_number(cell))
        value = bounded(float(cell) * factor)
        holds, words = self.rule
        if not holds(value):
            raise InputError(words)
        return value


@dataclass(frozen=True, eq=False)
class Sheet:
    """A file that was read: SI values by column name, and where each row stood.

    Columns are attributes too, as in pandas: ``sheet.mass`` is ``sheet["mass"]``. ``sha256`` is of
    the bytes read, ``line`` the line of each row (the first of a file is 1), ``titles`` the names
    of the columns as written, ``places`` where each stands. ``rows`` makes the rows as written,
    that of the titles first. Of a ``wide`` table, which was unfolded, several rows have one line.
    """

    file: Path
    sha256: str
    line: NDArray[np.int64]
    values: dict[str, NDArray[Any]]
    titles: tuple[str, ...]
    places: dict[str, int]
    rows: Callable[[], Iterable[Row]]
    wide: bool = False

    def __len__(self) -> int:
        return len(self.line)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.values[name]

    def __getattr__(self, name: str) -> NDArray[Any]:
        values: dict[str, NDArray[Any]] = self.__dict__.get("values", {})
        if name not in values:
            raise AttributeError(name)
        return values[name]

    @cached_property
    def cells(self) -> list[list[str]]:
        """The rows as written, without blanks around the cells."""
        return [cells for _, cells in self.rows()][1:]

    def error(self, row: int, name: str, allowed: str) -> InputError:
        """An error about one cell."""
        cells = next(islice(self.rows(), row + 1, None))[1]
        return self.error_in(int(self.line[row]), cells, name, allowed)

    def error_in(self, line: int, cells: Sequence[str], name: str, allowed: str) -> InputError:
        """An error about one cell of a row that was read just now."""
        place = self.places[name]
        column = f"column {place + 1} ({self.titles[place]})"
        if self.wide:
            load = f"{float(cells[self.places['mass']]) * 1e3:g} g"
            column = f"{cells[self.places['specimen']]} {load} {self.titles[place]}"
        return InputError(allowed, file=self.file, given=cells[place], key=f"line {line}, {column}")


def read_sheet(file: Path | str, columns: Sequence[Column], some: bool = False) -> Sheet:
    """Read a table that may have the given columns, and no others, in any of the formats.

    ``some``: only these columns, by their titles; others are left aside.
    A wide table of specimens is unfolded (:func:`tympan.geometry.formats.unfolded`). An
    :class:`InputError` names line and column of what cannot be used, what was given and what is
    allowed.
    """
    file = Path(file)
    raw = file_bytes(file)
    rows: Callable[[], Iterable[Row]] = partial(read_rows, file, raw)
    wide = False
    if any(column.name == "specimen" for column in columns):
        lines = list(rows())
        long = unfolded(file, lines)
        wide = long is not None
        rows = partial(iter, lines if long is None else long)
    sheet = sheet_of(file, raw, columns, rows, wide, some)
    if not len(sheet):
        raise InputError("has no readings below the names of its columns", file=sheet.file)
    return sheet


def sheet_of(file: Path, raw: bytes, columns: Sequence[Column],
             rows: Callable[[], Iterable[Row]], wide: bool = False, some: bool = False) -> Sheet:
    """A table that may have no rows; of many, so many are in memory as texts at a time."""
    below = iter(rows())
    first = next(below, None)
    if first is None:
        raise InputError("is empty: a first line with the names of the columns is needed",
                         file=file)
    top, titles = first
    header = _header(file, top, titles, columns, some)
    places = {column.name: place for place, column, _ in header}
    sheet = Sheet(file, hashlib.sha256(raw).hexdigest(), np.zeros(0, np.int64), {}, tuple(titles),
                  places, rows, wide)
    lines, parts = [sheet.line], {name: list[NDArray[Any]]() for name in places}
    while batch := list(islice(below, TOGETHER)):
        for line, cells in batch:
            if len(cells) != len(titles):
                comma = "; a decimal comma splits a number: write decimal points"
                more = comma if len(cells) > len(titles) else ""
                raise InputError(f"must have {len(titles)} cells, as the first line has{more}",
                                 file=file, key=f"line {line}", given=f"{len(cells)} cells")
        lines.append(np.array([line for line, _ in batch], np.int64))
        for place, column, factor in header:
            parts[column.name].append(_values(sheet, batch, place, column, factor))
    stood = np.concatenate(lines)
    values = {column.name: np.full(len(stood), column.blank) for column in columns}
    values |= {name: np.concatenate(part) for name, part in parts.items() if part}
    return replace(sheet, line=stood, values=values)


def _values(sheet: Sheet, rows: Sequence[Row], place: int, column: Column, factor: float
            ) -> NDArray[Any]:
    """A column's values in some rows."""
    values = []
    for line, cells in rows:
        try:
            values.append(column.value(cells[place], factor))
        except InputError as error:
            raise sheet.error_in(line, cells, column.name, error.allowed) from None
    return np.array(values)


def _header(file: Path, line: int, titles: Sequence[str],
            columns: Sequence[Column], some: bool) -> list[tuple[int, Column, float]]:
    """Where a column stands, which it is, and the SI value of the unit in its name."""
    header: list[tuple[int, Column, float]] = []
    named = {column.title for column in columns}
    if not some and not any(column.claims(title) for column in columns for title in titles):
        names = ", ".join(column.title for column in columns)
        raise InputError(f"is a table that no reader knows: columns are called {names}; or it is "
                         f"written as one of {readers()}", file=file, key=f"line {line}",
                         given=", ".join(titles)[:_SHOWN])
    for place, title in enumerate(titles):
        if some and title not in named:
            continue
        try:
            column = _column(title, columns)
            if title in titles[:place]:
                raise InputError("is there twice")
            if any(column is other for _, other, _ in header):
                raise InputError(f"one column of {column.name} only, whatever its unit")
            header.append((place, column, column.factor(title)))
        except InputError as error:
            raise InputError(error.allowed, file=file, key=f"line {line}, column {place + 1}",
                             given=title) from None
    present = {column.name for _, column, _ in header}
    missing = [column.title for column in columns if column.required and column.name not in present]
    if missing:
        words = (f"the column {missing[0]} is" if len(missing) == 1
                 else f"the columns {', '.join(missing)} are")
        raise InputError(f"{words} missing", file=file, key=f"line {line}", given=", ".join(titles))
    return header


@cache
def _dimension(unit: str) -> str:
    number = any_quantity(f"1 {unit.replace('_per_', '/')}")
    if number is None:
        raise ValueError(f"no unit: {unit}")
    return number[1]


def _column(title: str, columns: Sequence[Column]) -> Column:
    for column in columns:
        if column.claims(title):
            return column
        if title == column.name:
            raise InputError(f"has no unit: write it into the name, such as {column.title}")
    if not title:
        raise InputError("must have a name: every column needs one")
    titles = [column.title for column in columns]
    hint = did_you_mean(title.lower(), {name.lower(): repr(name) for name in titles})
    raise InputError(f"unknown column: {hint}known are {', '.join(titles)}")


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
    start = _NUMBER.match(cell)
    if start and cell[start.end():].strip().isalpha():
        return "must be a number alone: its unit stands in the name of the column"
    return "must be a number"
