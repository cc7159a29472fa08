"""CSV tables with the unit in the columns' names; one list of columns writes and reads a file.

Columns may stand in any order, and any unit of the right dimension may stand in a name:
``displacement_um`` reads as ``displacement_mm`` does, because the name says which it is. Inside,
numbers are SI.
"""

from __future__ import annotations

import csv
import difflib
import hashlib
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.geometry.toml_reader import FINITE, Rule
from tympan.geometry.units import quantity, unit_factor
from tympan.studies.files import read_text, write_csv

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+(?:[eE][-+]?\d+)?", re.ASCII)


@dataclass(frozen=True)
class NumberColumn:
    """A column of numbers.

    ``unit`` is the usual one, with ``_per_`` for a quotient, and ``dimension`` that of
    :mod:`tympan.geometry.units`, both "" for plain numbers; ``rule`` holds for SI values. Only
    columns that are not ``required`` may be left out or have blank cells, which read as nan;
    ``absent`` is how nan is written, and read besides blanks.
    """

    name: str
    unit: str = ""
    dimension: str = ""
    rule: Rule = FINITE
    required: bool = True
    absent: str = ""
    blank = math.nan

    @property
    def title(self) -> str:
        """The usual name in the first line."""
        return f"{self.name}_{self.unit}" if self.unit else self.name

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

    def texts(self, values: Sequence[float]) -> list[str]:
        """Cells of SI values, with the digits that read back to 12 places."""
        factor = self.factor(self.title)
        return [self.absent if math.isnan(value) else f"{value / factor:.12g}" for value in values]

    def parse(self, sheet: Sheet, factor: float) -> NDArray[Any]:
        """SI values of the cells, shape (rows,)."""
        holds, words = self.rule
        values = np.full(len(sheet), self.blank)
        for row, cell in enumerate(sheet.texts(self.name)):
            if not self.required and cell in ("", self.absent):
                continue
            if not _NUMBER.fullmatch(cell):
                raise sheet.error(row, self.name, _no_number(cell))
            values[row] = value = float(cell) * factor
            if not math.isfinite(value):
                raise sheet.error(row, self.name, "must be finite")
            if not holds(value):
                raise sheet.error(row, self.name, words)
        return values


@dataclass(frozen=True)
class LabelColumn:
    """A column of texts, of ``choices`` if there are any.

    Blank cells, where allowed, read as "".
    """

    name: str
    choices: tuple[str, ...] = ()
    required: bool = True
    blank = ""

    @property
    def title(self) -> str:
        """The name in the first line."""
        return self.name

    def claims(self, title: str) -> bool:
        """Whether a name of the first line is this column's."""
        return title == self.name

    def factor(self, title: str) -> float:
        """Texts have no unit."""
        return 1.0

    def texts(self, values: Sequence[str]) -> list[str]:
        """Cells of texts."""
        return list(values)

    def parse(self, sheet: Sheet, factor: float) -> NDArray[Any]:
        """The cells, checked, shape (rows,)."""
        cells = sheet.texts(self.name)
        for row, cell in enumerate(cells):
            if not cell and not self.required:
                continue
            if self.choices and cell not in self.choices:
                blank = "" if self.required else ", or blank"
                raise sheet.error(row, self.name,
                                  f"must be one of {', '.join(self.choices)}{blank}")
            if not cell:
                raise sheet.error(row, self.name, "must not be blank")
        return np.array(cells)


Column = NumberColumn | LabelColumn


@dataclass(frozen=True, eq=False)
class Sheet:
    """A file that was read: SI values by column name, and where each row stood.

    Columns are attributes too, as in pandas: ``sheet.mass`` is ``sheet["mass"]``. ``sha256`` is of
    the bytes read, ``line`` the line of each row (the first line of a file is 1), ``titles`` the
    names of the columns as written, ``places`` where each stands, ``cells`` the rows as written,
    without blanks around the cells.
    """

    file: Path
    sha256: str
    line: NDArray[np.int64]
    values: dict[str, NDArray[Any]]
    titles: tuple[str, ...]
    places: dict[str, int]
    cells: list[list[str]]

    def __len__(self) -> int:
        return len(self.line)

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.values[name]

    def __getattr__(self, name: str) -> NDArray[Any]:
        values: dict[str, NDArray[Any]] = self.__dict__.get("values", {})
        if name not in values:
            raise AttributeError(name)
        return values[name]

    def texts(self, name: str) -> list[str]:
        """A column as written."""
        return [cells[self.places[name]] for cells in self.cells]

    def error(self, row: int, name: str, allowed: str) -> InputError:
        """An error about one cell."""
        place = self.places[name]
        return InputError(allowed, file=self.file, given=self.cells[row][place],
                          key=f"line {self.line[row]}, column {place + 1} ({self.titles[place]})")

    def identical(self) -> list[tuple[int, int]]:
        """Rows that are the same as an earlier one in every cell, each with that one."""
        first: dict[tuple[str, ...], int] = {}
        pairs = ((row, first.setdefault(tuple(cells), row)) for row, cells in enumerate(self.cells))
        return [(row, earlier) for row, earlier in pairs if row != earlier]


def read_sheet(file: Path | str, columns: Sequence[Column]) -> Sheet:
    """Read a CSV file that may have the given columns, and no others.

    Blank lines are skipped; a byte-order mark and any line ends are taken.

    Raises
    ------
    InputError
        Naming line and column of what cannot be used, what was given and what is allowed.
    """
    file = Path(file)
    try:
        raw = file.read_bytes()
        text = raw.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from None
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start}): save it as CSV in UTF-8",
                         file=file) from None
    lines = _lines(file, text)
    if not lines:
        raise InputError("is empty: a first line with the names of the columns is needed",
                         file=file)
    (top, titles), *rows = lines
    header = _header(file, top, titles, columns)
    if not rows:
        raise InputError("has no readings below the names of its columns", file=file)
    for line, row in rows:
        if len(row) != len(titles):
            comma = "; a decimal comma splits a number: write decimal points"
            more = comma if len(row) > len(titles) else ""
            raise InputError(f"must have {len(titles)} cells, as the first line has{more}",
                             file=file, key=f"line {line}", given=f"{len(row)} cells")
    sheet = Sheet(file, hashlib.sha256(raw).hexdigest(), np.array([line for line, _ in rows]),
                  {column.name: np.full(len(rows), column.blank) for column in columns},
                  tuple(titles), {column.name: place for place, (column, _) in enumerate(header)},
                  [row for _, row in rows])
    for column, factor in header:
        sheet.values[column.name] = column.parse(sheet, factor)
    return sheet


def write_sheet(file: Path, columns: Sequence[Column], values: Mapping[str, Any]) -> None:
    """Write a CSV file of these columns from SI values by name, shape (rows,) each."""
    cells = [column.texts(values[column.name]) for column in columns]
    write_csv(file, [column.title for column in columns], zip(*cells, strict=True))


def read_own_sheet(file: Path, columns: Sequence[Column]) -> dict[str, NDArray[Any]]:
    """SI values by column name of a file that :func:`write_sheet` wrote.

    Raises
    ------
    InputError
        When the file is missing, is cut short, or is not of these columns.
    """
    if not read_text(file).endswith("\n"):
        raise InputError("is cut short: run the command that wrote the folder again", file=file)
    return read_sheet(file, columns).values


def _lines(file: Path, text: str) -> list[tuple[int, list[str]]]:
    """Number and cells of each line that is not blank."""
    rows = csv.reader(io.StringIO(text), skipinitialspace=True, strict=True)
    lines, begin = [], 1
    try:
        for row in rows:
            cells = [cell.strip() for cell in row]
            if any(cells):
                lines.append((begin, cells))
            begin = rows.line_num + 1
    except csv.Error as error:
        raise InputError(f"is not comma-separated text: {error}; is a quotation mark left open?",
                         file=file, key=f"line {begin}") from None
    return lines


def _header(file: Path, line: int, titles: Sequence[str],
            columns: Sequence[Column]) -> list[tuple[Column, float]]:
    """What each name of the first line stands for, and the SI value of its unit."""
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if any(mark in title for title in titles):
            raise InputError(f"columns must be separated by commas, not {name}: save it with "
                             "commas, and with decimal points in numbers", file=file,
                             key=f"line {line}", given=",".join(titles))
    header: list[tuple[Column, float]] = []
    for place, title in enumerate(titles):
        try:
            column = _column(title, columns)
            if title in titles[:place]:
                raise InputError("is there twice")
            if any(column is other for other, _ in header):
                raise InputError(f"one column of {column.name} only, whatever its unit")
            header.append((column, column.factor(title)))
        except InputError as error:
            raise InputError(error.allowed, file=file, key=f"line {line}, column {place + 1}",
                             given=title) from None
    present = {column.name for column, _ in header}
    missing = [column.title for column in columns if column.required and column.name not in present]
    if missing:
        words = (f"the column {missing[0]} is" if len(missing) == 1
                 else f"the columns {', '.join(missing)} are")
        raise InputError(f"{words} missing", file=file, key=f"line {line}", given=", ".join(titles))
    return header


def _column(title: str, columns: Sequence[Column]) -> Column:
    """The column of a name in the first line."""
    for column in columns:
        if column.claims(title):
            return column
        if title == column.name:
            raise InputError(f"has no unit: write it into the name, such as {column.title}")
    if not title:
        raise InputError("must have a name: every column needs one")
    lower = {column.title.lower(): column.title for column in columns}
    near = difflib.get_close_matches(title.lower(), lower, 1)
    hint = f"did you mean {lower[near[0]]!r}? " if near else ""
    titles = ", ".join(column.title for column in columns)
    raise InputError(f"unknown column: {hint}known are {titles}")


def _no_number(cell: str) -> str:
    """What to write instead of a cell that is no number."""
    if cell.lower().lstrip("+-") in ("nan", "inf", "infinity"):
        return "must be finite"
    if _DECIMAL_COMMA.fullmatch(cell):
        return f"must be a number with a decimal point, such as {cell.replace(',', '.')}"
    start = _NUMBER.match(cell)
    if start and cell[start.end():].strip().isalpha():
        return "must be a number alone: its unit stands in the name of the column"
    return "must be a number"
