"""Tables in the program's own format: CSV files from rows or a list of columns.

Tables of other programs are read by :mod:`tympan.tables.columns`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.read_file import STORED, file_bytes
from tympan.base.toml_reader import one_of
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


def write_rows(file: Path, rows: Mapping[str, Array]) -> None:
    """Write rows as a CSV file: its columns have the units of tables, such as mm for m."""
    columns = [_column_of(name, values) for name, values in rows.items()]
    named = zip(columns, rows.values(), strict=True)
    write_sheet(file, columns, {column.name: values for column, values in named})


def _column_of(name: str, values: Array) -> Column:
    """Make the column of a record's field, in the unit of tables."""
    return Column.labels(name) if values.dtype.kind == "O" else column_of(name)


def column_named(name: str, columns: Sequence[str], key: str) -> str:
    """Find a column by name, with or without its SI unit, with blanks or underscores.

    Raises
    ------
    InputError
        When there is none, naming the ``key`` that asked.
    """
    spelled: dict[str, str] = {}
    for label in columns:
        suffix = next((item.suffix for item in DIMENSIONS.values() if item.si == unit_of(label)),
                      "")
        for word in (label, label.removesuffix(suffix)):
            spelled |= {word: label, word.replace("_", " "): label}
    if name not in spelled:
        shortest = {label: word for word, label in spelled.items() if " " not in word}
        raise InputError(one_of(name, dict.fromkeys(shortest.values())), key=key, given=name)
    return spelled[name]


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
