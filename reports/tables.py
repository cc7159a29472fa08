"""Results as pandas tables, one row per state, mode, circle or case; fields by xarray. In SI."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from tympan.base.arrays import Array
from tympan.base.units import unit_of
from tympan.studies.case import CaseResult
from tympan.studies.film_surface import FIELD_UNITS

#: Most rows of a table that are shown.
_ROWS = 12
#: Most columns of a table that are printed: as many as a terminal is wide.
_COLUMNS = 8
#: Most letters of a cell that are printed.
_LETTERS = 60
#: Format of numbers.
_DIGITS = "{:.6g}".format
#: Most single numbers above a table: more would hide it.
_SINGLE = 15
#: Most letters of a line above a table, as in the code: a longer text goes on below.
_WIDTH = 100
#: Headings of a table with a row for each name.
_COLUMN = ["name", "value", "unit"]
#: Names of a JSON object that say how a result was computed, not what it is.
_OF_THE_RUN = frozenset(("wall_s", "made_s", "dofs", "seed", "version", "python", "finished"))
#: What stands in place of a table without rows.
_EMPTY = "The table of this result has no rows."


def labelled(values: Mapping[str, Array], along: str,
             **places: Array) -> xr.Dataset:
    """Convert fields of a film to an xarray dataset along one dimension, with their units.

    ``places``: coordinates of their points in the flat film [m], by name.
    """
    def variable(name: str, value: Array) -> xr.Variable:
        dims = (along, "component")[:value.ndim]
        return xr.Variable(dims, value, {"units": FIELD_UNITS.get(name, "1")})

    where = {name: xr.Variable(along, value, {"units": "m"}) for name, value in places.items()}
    return xr.Dataset({name: variable(name, value) for name, value in values.items()},
                      where | {"component": ["x", "y", "z"]})


def dataset(result: object) -> xr.Dataset:
    """Convert a result to an xarray dataset with dimensions and units."""
    if isinstance(whole := getattr(result, "table", None), xr.Dataset):
        return whole
    if isinstance(result, CaseResult):
        return _state(result)
    rows = table(result)
    keys = [name for name in getattr(result, "indexed", ()) if name in rows]
    found: xr.Dataset = (rows.set_index(keys) if keys and not rows.duplicated(keys).any()
                         else rows).to_xarray()
    for name, variable in found.variables.items():
        variable.attrs |= _units(str(name))
    return found


def _state(result: CaseResult) -> xr.Dataset:
    """Build a dataset of the numbers of one state, and the fields of its film."""
    film = result.film
    fields = xr.Dataset() if film is None else labelled(
        film.values, "point", x=film.mounted[:, 0], y=film.mounted[:, 1])
    numbers = {name: xr.Variable((), np.nan if value is None else value, _units(name))
               for name, value in result.json().items() if not isinstance(value, dict | list)}
    return fields.assign(numbers).assign_attrs(warnings=" | ".join(result.warnings))


def _units(name: str) -> dict[str, str]:
    unit = unit_of(name)
    return {} if unit is None else {"units": unit}


def html(result: object) -> str:
    """Write a table of names, values and units; units of several rows are in column names.

    Single numbers of the result are in a table of their own above one of several rows.
    """
    rows, most = _shown(result)
    above = pd.DataFrame([(name, _cell(value), unit) for name, value, unit in _above(result)],
                         columns=_COLUMN)
    head = "" if above.empty else _html(above)
    return head + (f"<p>{_EMPTY}</p>" if rows.empty else _html(rows, most))


def _html(rows: pd.DataFrame, most: int | None = None) -> str:
    with pd.option_context("display.max_colwidth", None):
        return str(rows.to_html(index=False, max_rows=most, border=0, na_rep="",
                                float_format=_DIGITS))


def text(result: object) -> str:
    """Write a table of names, values and units for a terminal, without the middle of a wide one.

    Lines with the single numbers of the result stand above the table.
    """
    rows, most = _shown(result)
    below = _EMPTY if rows.empty else str(rows.to_string(
        index=False, max_rows=most, max_cols=_COLUMNS, na_rep="", max_colwidth=_LETTERS,
        float_format=_DIGITS))
    return "\n".join((*_lines(_above(result)), below))


def _lines(above: list[tuple[str, Any, str]]) -> Iterator[str]:
    """Write a line for each name, value and unit; an empty one follows the last."""
    width = max((len(name) for name, *_ in above), default=0) + 2
    for name, value, unit in above:
        yield textwrap.fill(f"{_cell(value)} {unit}".strip(), _WIDTH,
                            initial_indent=name.ljust(width), subsequent_indent=" " * width)
    if above:
        yield ""


def _cell(value: Any) -> str:
    return _DIGITS(value) if isinstance(value, float) else str(value)


def _above(result: object) -> list[tuple[str, Any, str]]:
    """List names, values and units of the single numbers and texts of a result.

    They are its ``key_numbers``, which a result has whose main answer is nested. Of other results
    they are those on the first level of the JSON object that the table does not have.
    """
    found: Mapping[str, Any] | None = getattr(result, "key_numbers", None)
    if found is None:
        write: Callable[[], Mapping[str, Any]] = getattr(result, "json", dict)
        rows = table(result)
        left = _OF_THE_RUN.union(() if rows.empty else map(str, rows))
        found = {name: value for name, value in write().items() if name not in left}
    return [(name, value, unit_of(name) or "") for name, value in found.items()
            if isinstance(value, str | float | int) and value != ""][:_SINGLE]


def _shown(result: object) -> tuple[pd.DataFrame, int | None]:
    """Build the table of a result to show, and the most rows of it; None for all."""
    rows = table(result)
    if len(rows) != 1:
        return rows, _ROWS
    row = pd.json_normalize(rows.to_dict("records")).iloc[0].dropna()
    return pd.DataFrame([(name, value, unit_of(str(name)) or "") for name, value in row.items()],
                        columns=_COLUMN), None


def table(result: object) -> pd.DataFrame:
    """Build a table of the rows of a result."""
    rows: Any = getattr(result, "rows", None)
    if rows is None:
        raise TypeError(f"there is no table of {type(result).__name__}")
    return pd.DataFrame(rows)
