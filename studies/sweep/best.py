"""The best cases of a sweep: the largest of a result at one voltage, under conditions.

A film passes every voltage from the lowest to that one, and its stress, for example, is largest
without voltage. So a condition on a result that depends on the voltage must hold at all of them.
Strokes, and other changes from 0 V, are 0 at first: a least value of them must be reached at that
voltage alone.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tympan.base.errors import InputError
from tympan.base.units import DIMENSIONS, quantity
from tympan.studies.columns import column_named
from tympan.studies.sweep.asked import QUESTIONS
from tympan.studies.sweep.plan import voltage_of
from tympan.studies.sweep.table import LOAD_UNITS, beyond_limits, column_name

if TYPE_CHECKING:
    import xarray as xr

#: Comparison of a condition, and the extreme of several values that is farthest from meeting it.
_SIGNS: dict[str, tuple[Callable[[Any, Any], Any], str]] = {
    "<=": (operator.le, "max"), "<": (operator.lt, "max"),
    ">=": (operator.ge, "min"), ">": (operator.gt, "min")}
#: Fewest values of a key for which an end of them is reported.
_SIDES = 3
_CONDITION = re.compile(r"\s*(?P<name>[^<>=]+?)\s*(?P<sign><=|>=|<|>)\s*(?P<bound>[^<>=]+?)\s*")


@dataclass(frozen=True)
class Condition:
    """Condition that a case must keep, such as "max_true_stress < 131 kPa", as it was written.

    The ``column`` of the table is compared by ``sign`` with the ``bound`` [SI].
    """

    text: str
    column: str
    sign: str
    bound: float

    @classmethod
    def read(cls, text: str, table: xr.Dataset) -> Condition:
        """Read a condition on a sweep's table from a text."""
        match = _CONDITION.fullmatch(text)
        if match is None:
            raise InputError('must be a result, one of <, <=, > and >=, and a value, such as '
                             '"max_true_stress < 131 kPa"', key="under", given=text)
        try:
            column = column_of(match["name"], table)
            return cls(text.strip(), column, match["sign"],
                       _value(match["bound"], str(table[column].attrs.get("units", "1"))))
        except InputError as error:
            raise InputError(error.allowed, key="under", given=text) from None

    def worst(self, values: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray | None]:
        """Find the value farthest from keeping it along the voltages, and its voltage [V]."""
        if "voltage" not in values.dims:
            return values, None
        farthest = _SIGNS[self.sign][1]
        if farthest == "min" and self.column in _changes():
            there = values.isel(voltage=-1)
            return there, there.copy(data=np.full(there.shape, values["voltage"][-1]))
        never = -np.inf if farthest == "max" else np.inf
        place = getattr(values.fillna(never), f"arg{farthest}")("voltage")
        return getattr(values, farthest)("voltage"), values["voltage"][place]

    def holds(self, worst: xr.DataArray) -> xr.DataArray:
        """Test the condition at the value farthest from it; false for a missing value."""
        held: xr.DataArray = _SIGNS[self.sign][0](worst, self.bound) & worst.notnull()
        return held


@dataclass(frozen=True)
class Best:
    """The best cases of a sweep, the best one first.

    ``of`` is the result that is largest. ``at_V`` is the nominal voltage of the comparison, None
    where voltages differ from specimen to specimen. ``cases`` is the number of cases at that
    voltage; ``equilibria`` of those with an equilibrium at every voltage up to it; ``kept`` how
    many of these keep each condition. ``rows`` are the best of the cases that keep all, with their
    differing inputs, the result, and ``beyond``, the limits they are beyond at that voltage.
    ``limited`` holds by condition the ``value`` of its ``column`` that is farthest from keeping it,
    None where that was never reached, and its voltage ``at_V``. ``ends`` are the keys of which the
    best case has the smallest or the largest of three or more values: better cases may lie beyond.
    """

    of: str
    at_V: float | None
    under: tuple[str, ...]
    cases: int
    equilibria: int
    kept: Mapping[str, int]
    rows: tuple[Mapping[str, Any], ...]
    ends: tuple[str, ...] = ()

    def json(self) -> dict[str, Any]:
        """Convert the result to a JSON object."""
        return {**vars(self), "under": list(self.under), "ends": list(self.ends),
                "kept": dict(self.kept), "rows": [dict(row) for row in self.rows]}

    def to_pandas(self) -> Any:
        """Make a table with a row per case."""
        import pandas as pd

        return pd.DataFrame([
            {key: ", ".join(value) if key == "beyond" else value
             for key, value in row.items() if key != "limited"}
            | {f"{name}{part}": limit[key] for name, limit in row["limited"].items()
               for key, part in (("value", ""), ("at_V", " at_V"))} for row in self.rows])


def best(table: xr.Dataset, of: str = "stroke", voltage: float | str | None = None,
         under: str | Sequence[str] = (), count: int = 5) -> Best:
    """Find the cases with the largest of a result at one voltage that keep conditions up to it.

    ``of`` is a column of the table, "stroke" or "stroke_m". ``voltage`` is one of the sweep's, by
    default the highest. ``under`` holds conditions such as "max_true_stress < 131 kPa", with
    commas or a list between several. ``count`` is the largest number of cases.

    Raises
    ------
    InputError
        When there is no such result, voltage or unit.
    """
    column = column_of(of, table, "best")
    texts = [part for text in ([under] if isinstance(under, str) else under)
             for part in text.split(",") if part.strip()]
    conditions = [Condition.read(text, table) for text in texts]
    if not isinstance(count, int) or count < 1:
        raise InputError("must be a whole number of at least 1", key="count", given=count)
    volts, way = None, table
    if "voltage" in table.dims:
        volts = voltage_of(table["voltage"].values.tolist(), voltage)
        way = table.sel(voltage=table["voltage"] <= volts)
    elif voltage is not None:
        raise InputError("the sweep's voltages differ from specimen to specimen: each is compared "
                         "at its own", key="voltage", given=voltage)
    reached = (way["status"] == "equilibrium").reset_coords(drop=True)
    value = table[column]
    if "voltage" in way.dims:
        reached = reached.all("voltage")
        value = value.sel(voltage=volts) if "voltage" in value.dims else value
    good, kept, limited = reached & value.notnull(), {}, []
    for condition in conditions:
        worst, where = condition.worst(_never_reached(way, condition.column))
        holds = condition.holds(worst)
        kept[condition.text] = int((holds & reached).sum())
        good = good & holds
        limited.append((condition, worst, where))
    value = value.where(good)
    ranked = value.reset_coords(drop=True).to_series().dropna().sort_values(ascending=False)
    beyond = {limit: cases.sel(voltage=volts) if "voltage" in cases.dims else cases
              for limit, cases in beyond_limits(table).items()}
    places = [_place(value, index) for index in ranked.index[:count]]
    rows = tuple(_row(table, value, place, column, limited) | {"beyond": [
        limit for limit, cases in beyond.items() if cases.sel(place)]}
        for place in places)
    return Best(column, volts, tuple(condition.text for condition in conditions),
                int(reached.size), int(reached.sum()), kept, rows,
                _ends(table, places[0]) if places else ())


def _changes() -> set[str]:
    """List the columns of changes from 0 V to the voltage of the row."""
    return {"stroke_m", *(column for quantity in QUESTIONS.known.values() if quantity.change
                          for column in quantity.columns)}


def column_of(name: str, table: xr.Dataset, key: str = "under") -> str:
    """Find the column of numbers by name, with or without its unit, with blanks or underscores."""
    return column_named(name, [str(label) for label, values in table.data_vars.items()
                               if values.dtype.kind in "fi"], key)


def _value(text: str, unit: str) -> float:
    dimension = next((name for name, item in DIMENSIONS.items() if item.si == unit), "")
    if dimension:
        return quantity(text, dimension)
    try:
        return float(text)
    except ValueError:
        raise InputError("must be compared with a number without a unit", given=text) from None


def _never_reached(table: xr.Dataset, column: str) -> xr.DataArray:
    """Take a column; margins without a field, and voltages of unmet limits, become infinite."""
    values = table[column]
    if column == "breakdown_margin":
        return values.fillna(np.inf).where(table["status"] == "equilibrium")
    limits = [str(name).removesuffix("_spread") + "_V" for name in table.data_vars
              if str(name).endswith("_spread")]
    if column not in limits:
        return values
    # If no limit of a film was found and a warning says why, nothing is known about its limits.
    some = table["limits_warnings"] == ""
    for name in limits:
        some = some | table[name].notnull()
    return values.fillna(np.inf).where(some)


def _place(value: xr.DataArray, index: Any) -> dict[str, Any]:
    return dict(zip(map(str, value.dims), index if isinstance(index, tuple) else (index,),
                    strict=True))


def _on(values: xr.DataArray, place: Mapping[str, Any]) -> dict[str, Any]:
    return {axis: key for axis, key in place.items() if axis in values.dims}


def _ends(table: xr.Dataset, place: Mapping[str, Any]) -> tuple[str, ...]:
    """List the keys of a grid with three or more values of which a case has the first or last."""
    values = {axis: table[axis].values for axis in place if axis not in ("specimen", *LOAD_UNITS)}
    return tuple(axis for axis, those in values.items() if len(those) >= _SIDES
                 and those.dtype.kind == "f" and place[axis] in (those.min(), those.max()))


def _row(table: xr.Dataset, value: xr.DataArray, place: dict[str, Any], column: str,
         limited: Sequence[tuple[Condition, xr.DataArray, xr.DataArray | None]]
         ) -> dict[str, Any]:
    """Make the row of a case: its result, and how near it comes to each condition."""
    here = value.sel(place)
    row = {column_name(table, str(name)): part.item() for name, part in here.coords.items()
           if name != "base" and part.ndim == 0}
    near = {}
    for condition, worst, where in limited:
        inner = _on(worst, place)
        near[condition.text] = {
            "column": condition.column, "value": _finite(worst.sel(inner).item()),
            "at_V": None if where is None else float(where.sel(inner))}
    return {**row, column: here.item(), "limited": near}


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
