"""Tables in the program's own format, from the fields of records or a list of columns.

Tables of other programs are read by :mod:`tympan.tables.columns`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import fields_of
from tympan.base.read_file import STORED, file_bytes
from tympan.base.units import DIMENSIONS, suffix_of, unit_of
from tympan.studies.files import read_text, write_csv
from tympan.tables.columns import TOGETHER, sheet_of
from tympan.tables.columns import Column as Column
from tympan.tables.columns import Sheet as Sheet
from tympan.tables.columns import read_sheet as read_sheet
from tympan.tables.formats import text_rows
from tympan.tables.layouts import Reader

#: Largest size of a table of our own [bytes]; its number of rows is bounded, but names may be long.
_OWN = 4 * STORED
#: Types of numbers.
_NUMBERS = frozenset((float, int, bool))


def _kinds(record: Any) -> tuple[tuple[str, bool], ...]:
    """List fields that hold a number, a text or a list of numbers, and whether it is a list."""
    cls: Any = type(record)
    return _kinds_of(cls)


@cache
def _kinds_of(cls: Any) -> tuple[tuple[str, bool], ...]:
    found = []
    for item in fields_of(cls):
        origin, kinds = get_origin(item.item), {item.item}
        if item.printed.inline:
            kinds = {*get_args(get_args(item.item)[1])} - {NoneType}
        elif origin is Literal:
            kinds = {str}
        elif origin in (Union, UnionType):
            kinds = {*get_args(item.item)} - {NoneType}
        of_row = _NUMBERS if item.several else _NUMBERS | {str}
        if kinds <= of_row and item.count is None:
            found.append((item.name, item.several))
    return tuple(found)


def cells_of(record: Any) -> dict[str, Any]:
    """Collect the fields of a record that hold one number or text, by name.

    Numbers of a mapping that is stored inline stand in its place, by their keys.
    """
    cells: dict[str, Any] = {}
    for name, several in _kinds(record):
        value = getattr(record, name)
        if isinstance(value, Mapping):
            cells |= value
        elif not several:
            cells[name] = value
    return cells


def rows_of(records: Sequence[Any], **same: Any) -> dict[str, Array]:
    """Make a row for each record, of its fields that hold one number or text, by name.

    Names of numbers end in their SI units. None becomes nan. Columns that are the ``same`` in all
    rows come first.
    """
    return _rows(records, same, [cells_of(record) for record in records])


def lists_of(record: Any) -> dict[str, Array]:
    """Collect the lists of numbers of a record by the names of their fields; None becomes nan."""
    return {name: _column(list(getattr(record, name)))
            for name, several in _kinds(record) if several}


def rows_in(records: Sequence[Any], **same: Any) -> dict[str, Array]:
    """Make a row for each entry of the records' lists, with the record's single numbers and texts.

    Names, None and ``same`` are treated as in :func:`rows_of`.
    """
    rows: list[dict[str, Any]] = []
    for record in records:
        lists = {name: getattr(record, name) for name, several in _kinds(record) if several}
        rows += [cells_of(record) | dict(zip(lists, entry, strict=True))
                 for entry in zip(*lists.values(), strict=True)]
    return _rows(records, same, rows, lists=True)


def _rows(records: Sequence[Any], same: Mapping[str, Any], rows: Sequence[Mapping[str, Any]],
          lists: bool = False) -> dict[str, Array]:
    """Make columns of rows; those that are the ``same`` are there even without rows."""
    names = list[str]()
    for record in records[:1]:
        for name, several in _kinds(record):
            inline = getattr(record, name)
            names += inline if isinstance(inline, Mapping) else [name] * (lists or not several)
    columns: dict[str, Array] = {}
    for name, value in same.items():
        kind = object if isinstance(value, str) else float
        columns[name] = np.full(len(rows), value, dtype=kind)
    return {**columns, **{name: _column([row[name] for row in rows]) for name in names}}


def _column(values: list[Any]) -> Array:
    if any(isinstance(value, str) for value in values):
        return np.array(values, dtype=object)
    return np.array([np.nan if value is None else value for value in values])


def write_rows(file: Path, rows: Mapping[str, Array]) -> None:
    """Write rows as a CSV file: its columns have the units of tables, such as mm for m."""
    columns = [_column_of(name, values) for name, values in rows.items()]
    named = zip(columns, rows.values(), strict=True)
    write_sheet(file, columns, {column.name: values for column, values in named})


def _column_of(name: str, values: Array) -> Column:
    """Make the column of a record's field, in the unit of tables."""
    return Column.labels(name) if values.dtype.kind == "O" else column_of(name)


def column_of(name: str) -> Column:
    """Make the column of numbers of a name that ends in its SI unit, in the unit of tables."""
    si = unit_of(name)
    if si is None:
        return Column(name)
    unit = next(each.table_unit for each in DIMENSIONS.values() if each.si == si)
    return Column(name.removesuffix(suffix_of(si)), suffix_of(unit).removeprefix("_"))


def write_sheet(file: Path, columns: Sequence[Column], values: Mapping[str, Any]) -> None:
    """Write a CSV file of these columns from SI values by name, shape (rows,) each."""
    arrays = [np.asarray(values[column.name]) for column in columns]

    def rows() -> Iterator[tuple[str, ...]]:
        for begin in range(0, max(map(len, arrays), default=0), TOGETHER):
            cells = (column.texts(array[begin:begin + TOGETHER].tolist())
                     for column, array in zip(columns, arrays, strict=True))
            yield from zip(*cells, strict=True)

    write_csv(file, [column.title for column in columns], rows())


def as_written(columns: Sequence[Column], values: Mapping[str, Any]) -> dict[str, Array]:
    """Round SI values, by column name, as writing and reading them back would."""
    table = {}
    for column in columns:
        array = np.asarray(values[column.name])
        if column.choices is None:
            factor = column.factor(column.title)
            array = np.array([float(f"{value / factor:.12g}") * factor for value in array.tolist()])
        table[column.name] = array
    return table


def read_own_sheet(file: Path, columns: Sequence[Column]) -> dict[str, Array]:
    """Read SI values by column name from a file of :func:`write_sheet`; it may have no rows."""
    if not read_text(file, _OWN).endswith("\n"):
        raise InputError("is cut short: run the command that wrote the folder again", file=file)
    raw = file_bytes(file, _OWN)
    return sheet_of(Reader(file, columns), raw, partial(text_rows, file, raw)).values
