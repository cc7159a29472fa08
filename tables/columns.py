"""CSV tables with the unit in the columns' names.

Columns may stand in any order, and any unit of the right dimension may stand in a name:
``displacement_um`` reads as ``displacement_mm`` does, because the name says which it is. Inside,
numbers are SI.
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
from tympan.tables.column import Column as Column
from tympan.tables.formats import Row, TwoMarks, read_rows, unfolded, unread
from tympan.tables.layouts import Layout, Reader, Source

#: Values of a column that has to grow are so far apart [s or m]: no instrument tells less, and
#: slopes over smaller steps are no numbers.
LEAST_STEP = 1e-9
#: Rows of a table that are texts at a time: as numbers they take a tenth of the memory.
TOGETHER = 10_000


@dataclass(frozen=True, eq=False)
class Sheet:
    """A file that was read: SI values by column name, and where each row stood.

    Columns are attributes too, as in pandas: ``sheet.mass`` is ``sheet["mass"]``. ``sha256`` is of
    the bytes read, ``line`` the line of each row (the first of a file is 1), ``titles`` the
    headings as written, ``sources`` what each column was read from: place, unit and sign, by its
    name. ``rows`` makes the rows as written, that of the titles first. Of a ``wide`` table, which
    was unfolded, several rows have one line. ``remarks`` say which headings were read as what,
    where they are not ours.
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
        """Places of the columns that are not one value for the whole file."""
        return {name: source.place for name, source in self.sources.items()
                if source.place is not None}

    def heading(self, name: str) -> str:
        """Heading of a column as written; its usual name where one value holds for all rows."""
        place = self.places.get(name)
        return self.sources[name].column.title if place is None else self.titles[place]

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

    ``some``: only these columns, by their titles; others are left aside.
    Other people's headings are found and understood (:mod:`tympan.tables.layouts`), or as a
    ``layout`` says; ``table`` is its name in a dataset.toml, and ``usual`` what holds where no
    heading says so. A wide table of specimens is unfolded
    (:func:`tympan.tables.formats.unfolded`). An :class:`InputError` names line and column of what
    cannot be used, what was given and what is allowed.
    """
    file = Path(file)
    raw = file_bytes(file)
    rows: Callable[[], Iterable[Row]] = partial(read_rows, file, raw, layout.decimal)
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
    """A table that may have no rows; of many, so many are in memory as texts at a time."""
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
    """A column's values in some rows."""
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
