"""Rows of tables, from the fields of records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np

from tympan.base.arrays import Array
from tympan.base.fields import fields_of
from tympan.base.units import suffix_of, unit_of

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

    Numbers of a mapping that is stored inline stand in its place, by their keys. Records of a list
    that are named have columns of their own, after all others.
    """
    cells: dict[str, Any] = {}
    for name, several in _kinds(record):
        value = getattr(record, name)
        if isinstance(value, Mapping):
            cells |= value
        elif not several:
            cells[name] = value
    for parts in columns_of(record).values():
        cells |= parts
    return cells


def named_cells(record: Any) -> dict[str, Any]:
    """Collect the values of mappings by names that have columns, such as ``voltage_A_V``."""
    cls: Any = type(record)
    return {column_of_part(column, part): value for name, column in _mapped(cls)
            for part, value in getattr(record, name).items()}


@cache
def _mapped(cls: Any) -> tuple[tuple[str, str], ...]:
    """List mappings by names that have columns, and what these are columns of."""
    return tuple((item.name, item.printed.columns) for item in fields_of(cls)
                 if item.printed.columns and get_origin(item.kind) is Mapping)


def columns_of(record: Any) -> dict[str, dict[str, Any]]:
    """Collect columns of the records of each list that names them, by the list's field."""
    cls: Any = type(record)
    return {name: {column_of_part(key, getattr(part, by)): value
                   for part in getattr(record, name)
                   for key, value in cells_of(part).items() if key != by}
            for name, by in _listed(cls)}


@cache
def _listed(cls: Any) -> tuple[tuple[str, str], ...]:
    """List fields whose records have columns of their own, and the field that names these."""
    return tuple((item.name, item.printed.columns) for item in fields_of(cls)
                 if item.printed.columns and item.several)


def column_of_part(name: str, part: str) -> str:
    """Name the column of one of several parts; it ends in the unit.

    Examples
    --------
    >>> column_of_part("capacitance_F", "A"), column_of_part("share", "A")
    ('capacitance_A_F', 'share_A')
    """
    unit = unit_of(name)
    suffix = "" if unit is None else suffix_of(unit)
    return f"{name.removesuffix(suffix)}_{part}{suffix}"


def rows_of(records: Sequence[Any], **same: Any) -> dict[str, Array]:
    """Make a row for each record, of its fields that hold one number or text, by name.

    Names of numbers end in their SI units. None becomes nan. Columns that are the ``same`` in all
    rows come first.
    """
    return _rows(records, same, [cells_of(record) for record in records])


def lists_of(record: Any) -> dict[str, Array]:
    """Collect the lists of numbers of a record by the names of their fields; None becomes nan.

    Lists that the record does not have are left out beside those that it has.
    """
    lists = {name: _column(list(getattr(record, name)))
             for name, several in _kinds(record) if several}
    return {name: column for name, column in lists.items() if len(column)} or lists


def named_apart(parts: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Join the numbers of several parts; names begin with that of the part, if there are several.

    Examples
    --------
    >>> named_apart({"oval": {"stroke_m": 0.002}})
    {'stroke_m': 0.002}
    >>> named_apart({"oval": {"stroke_m": 0.002}, "disc": {"stroke_m": 0.003}})
    {'oval: stroke_m': 0.002, 'disc: stroke_m': 0.003}
    """
    if len(parts) == 1:
        return {**next(iter(parts.values()))}
    return {f"{part}: {name}": value
            for part, numbers in parts.items() for name, value in numbers.items()}


def rows_in(records: Sequence[Any], **same: Any) -> dict[str, Array]:
    """Make a row for each entry of the records' lists, with the record's single numbers and texts.

    Names, None and ``same`` are treated as in :func:`rows_of`.
    """
    rows: list[dict[str, Any]] = []
    for record in records:
        lists = {name: getattr(record, name) for name, several in _kinds(record) if several}
        named = named_cells(record)
        same_in_all = cells_of(record) | {
            name: value for name, value in named.items() if not isinstance(value, tuple)}
        lists |= {name: value for name, value in named.items() if isinstance(value, tuple)}
        rows += [same_in_all | dict(zip(lists, entry, strict=True))
                 for entry in zip(*lists.values(), strict=True)]
    return _rows(records, same, rows, lists=True)


def _rows(records: Sequence[Any], same: Mapping[str, Any], rows: Sequence[Mapping[str, Any]],
          lists: bool = False) -> dict[str, Array]:
    """Make columns of rows; those that are the ``same`` are there even without rows."""
    names = list[str]()
    for record in records[:1]:
        names += _names(record) if lists else [*cells_of(record)]
    columns: dict[str, Array] = {}
    for name, value in same.items():
        kind = object if isinstance(value, str) else float
        columns[name] = np.full(len(rows), value, dtype=kind)
    return {**columns, **{name: _column([row[name] for row in rows]) for name in names}}


def _names(record: Any) -> list[str]:
    """Name the columns of a record's fields, in their order."""
    cls: Any = type(record)
    single, mapped = {name for name, _ in _kinds(record)}, dict(_mapped(cls))
    names = list[str]()
    for item in fields_of(cls):
        if item.name in single:
            names.append(item.name)
        elif item.name in mapped:
            names += [column_of_part(mapped[item.name], part)
                      for part in getattr(record, item.name)]
    return names


def _column(values: list[Any]) -> Array:
    if any(isinstance(value, str) for value in values):
        return np.array(values, dtype=object)
    return np.array([np.nan if value is None else value for value in values])
