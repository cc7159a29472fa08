"""CSV tables with the unit in the columns' names.

Columns may stand in any order, and any unit of the right dimension may stand in a name:
``displacement_um`` is read like ``displacement_mm``, since the name gives the unit. Numbers in the
program are SI.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import islice
from pathlib import Path

import numpy as np

from tympan.base.arrays import AnyArray, Numbers
from tympan.base.errors import InputError
from tympan.base.read_file import file_bytes
from tympan.tables.cell_units import with_units_above
from tympan.tables.column import Column as Column
from tympan.tables.formats import Row, TwoMarks, read_rows, unfolded, unread
from tympan.tables.layouts import Layout, Reader, Source

#: Rows of a table that are texts at one time: as numbers they take a tenth of the memory.
TOGETHER = 10_000


@dataclass(frozen=True, eq=False)
class Sheet:
    """A file that was read: SI values by column name, and the line of each row.

    Columns are attributes too, as in pandas: ``sheet.mass`` is ``sheet["mass"]``. ``sha256`` is
    that of the bytes read, ``line`` the line of each row (the first of a file is 1), ``titles`` the
    headings as written, ``sources`` the place, unit and sign of each column, by its name. ``rows``
    makes the rows as written, that of the titles first. In a ``wide`` table, which was unfolded,
    several rows have one line. ``remarks`` say how other writers' headings were read.
    """

    file: Path
    sha256: str
    line: Numbers
    values: dict[str, AnyArray]
    titles: tuple[str, ...]
    sources: dict[str, Source]
    rows: Callable[[], Iterable[Row]]
    wide: bool = False
    remarks: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.line)

    def __getitem__(self, name: str) -> AnyArray:
        return self.values[name]

    def __getattr__(self, name: str) -> AnyArray:
        values: dict[str, AnyArray] = self.__dict__.get("values", {})
        if name not in values:
            raise AttributeError(name)
        return values[name]

    @cached_property
    def places(self) -> dict[str, int]:
        """Places of the columns, except those with one value for the whole file."""
        return {name: source.place for name, source in self.sources.items()
                if source.place is not None}

    def heading(self, name: str) -> str:
        """Find the heading of a column as written; its usual name where it has one value."""
        place = self.places.get(name)
        return self.sources[name].column.title if place is None else self.titles[place]

    @cached_property
    def cells(self) -> list[list[str]]:
        """Rows as written, without blanks around the cells."""
        return [cells for _, cells in self.rows()][1:]

    def error(self, row: int, name: str, allowed: str) -> InputError:
        """Make an error about one cell."""
        cells = next(islice(self.rows(), row + 1, None))[1]
        return self.error_in(int(self.line[row]), cells, name, allowed)

    def error_in(self, line: int, cells: Sequence[str], name: str, allowed: str) -> InputError:
        """Make an error about one cell of a row that was just read."""
        place = self.places.get(name)
        if place is None:  # one value holds for the whole file
            return InputError(allowed, file=self.file, key=f"line {line}, {name}")
        column = f"column {place + 1} ({self.titles[place]})"
        if self.wide:
            load = f"{float(cells[self.places['mass']]) * 1e3:g} g"
            column = f"{cells[self.places['specimen']]} {load} {self.titles[place]}"
        return InputError(allowed, file=self.file, given=cells[place], key=f"line {line}, {column}")


def read_sheet(file: Path | str, columns: Sequence[Column], some: bool = False,
               layout: Layout = Layout(), table: str = "", usual: Mapping[str, str] | None = None
               ) -> Sheet:
    """Read a table that may have the given columns, in any of the formats.

    ``some``: only these columns are read, by their titles. Other writers' headings are recognised
    (:mod:`tympan.tables.layouts`), or follow a ``layout``; ``table`` is its name in a dataset.toml,
    and ``usual`` are values that hold where no heading gives them. A wide table of specimens is
    unfolded (:func:`tympan.tables.formats.unfolded`). An :class:`InputError` names line and column
    of the fault, the value given and the values allowed.
    """
    file = Path(file)
    raw = file_bytes(file)
    def rows() -> Iterable[Row]:
        return with_units_above(read_rows(file, raw, layout.decimal))

    wide = False
    reader = Reader(file, columns, layout, table, usual or {})
    try:
        if any(column.name == "specimen" for column in columns):
            lines = list(rows())
            long = unfolded(file, lines)
            wide = long is not None
            rows = partial(iter, lines if long is None else long)
        sheet = sheet_of(reader, raw, rows, wide, some)
    except TwoMarks as error:
        raise InputError(error.allowed + reader.advice_on_marks(str(error.given)), file=file,
                         key=error.key, given=error.given) from None
    if left := unread(file, raw):
        sheet = replace(sheet, remarks=(*sheet.remarks, f"{file.name}: {left}"))
    if not len(sheet):
        raise InputError("; ".join(["has no readings below the names of its columns",
                                    *sheet.remarks]), file=sheet.file)
    return sheet


def sheet_of(reader: Reader, raw: bytes, rows: Callable[[], Iterable[Row]], wide: bool = False,
             some: bool = False) -> Sheet:
    """Convert a table, maybe without rows, with a limited number of rows as texts at a time."""
    file, columns = reader.file, reader.columns
    header = reader.chosen(rows()) if some else reader.header(rows())
    remarks = (*header.remarks, *reader.left_out(header, rows))
    rows = partial(header.rows, rows)
    below, titles = islice(rows(), 1, None), header.titles
    sources = {source.column.name: source for source in header.sources}
    sheet = Sheet(file, hashlib.sha256(raw).hexdigest(), np.zeros(0, np.int64), {}, titles,
                  sources, rows, wide, remarks)
    lines, parts = [sheet.line], {source.column.name: list[AnyArray]()
                                  for source in header.sources}
    while batch := list(islice(below, TOGETHER)):
        for line, cells in batch:
            if len(cells) != len(titles):
                comma = "; a decimal comma splits a number: write decimal points"
                more = comma if len(cells) > len(titles) else ""
                where = "the first line" if header.line == 1 else f"line {header.line}"
                raise InputError(f"must have {len(titles)} cells, as {where} has{more}",
                                 file=file, key=f"line {line}", given=f"{len(cells)} cells")
        lines.append(np.array([line for line, _ in batch], np.int64))
        for source in header.sources:
            parts[source.column.name].append(_values(sheet, batch, source, reader))
    stood = np.concatenate(lines)
    values = {column.name: np.full(len(stood), column.blank) for column in columns}
    values |= {name: np.concatenate(part) for name, part in parts.items() if part}
    return replace(sheet, line=stood, values=values)


def _values(sheet: Sheet, rows: Sequence[Row], source: Source, reader: Reader) -> AnyArray:
    """Convert a column's cells in some rows."""
    column, values = source.column, []
    if source.place is None:
        try:
            return np.full(len(rows), column.value(source.constant, source.factor))
        except InputError as error:
            raise InputError(f"{error.allowed}: write the one of the whole file, or the heading of "
                             "its column", file=sheet.file, given=source.constant,
                             key=f"columns.{reader.table}.{column.title}") from None
    for line, cells in rows:
        try:
            values.append(column.value(cells[source.place], source.factor, source.offset))
        except InputError as error:
            raise sheet.error_in(line, cells, column.name,
                                 error.allowed + reader.advice_on(cells[source.place], line,
                                                                  sheet.titles[source.place])
                                 ) from None
    return np.array(values)
