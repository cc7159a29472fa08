"""The results of a sweep as one labelled table: netCDF for programs, Parquet and CSV for people."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tympan.base.errors import InputError
from tympan.base.units import DIMENSIONS, unit_of
from tympan.studies.files import write_atomically, write_text
from tympan.studies.sweep.asked import QUESTIONS
from tympan.studies.sweep.plan import Entry, Sweep, read_quantity
from tympan.studies.sweep.task import (
    TEXTS,
    WAITING,
    WARNINGS_JOINED,
    PackedResult,
    columns,
    numbers,
    solver,
    without_result,
)

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

#: Loads on every specimen, with their units.
LOAD_UNITS = {"mass": "kg", "voltage": "V"}

#: Axis, values along it, attributes.
Coordinate = tuple[str, np.ndarray, dict[str, str]]


def write_tables(folder: Path, table: xr.Dataset) -> None:
    """Write a table in all three formats."""
    flat = frame(table)
    parquet = io.BytesIO()
    flat.to_parquet(parquet, index=False)
    netcdf = io.BytesIO()  # HDF5 itself crashes the process when the disk is full
    table.to_netcdf(netcdf, engine="h5netcdf")
    text = flat.to_csv(index=False, lineterminator="\n")
    write_atomically(folder / "sweep.parquet", lambda path: path.write_bytes(parquet.getvalue()))
    write_text(folder / "sweep.csv", text)
    write_atomically(folder / "sweep.nc", lambda path: path.write_bytes(netcdf.getvalue()))


def read_table(file: Path) -> xr.Dataset:
    """Read the table of a netCDF file."""
    import xarray as xr

    try:
        return xr.load_dataset(file, engine="h5netcdf")
    except FileNotFoundError:
        raise InputError("is missing: run tympan sweep again", file=file) from None
    except Exception:  # HDF5 and its readers may raise any error
        raise InputError("is no table of a sweep that can be read: run tympan sweep again",
                         file=file) from None


def dataset(sweep: Sweep, results: Mapping[str, PackedResult]) -> xr.Dataset:
    """Make a table with the dimensions specimen, the grid's keys, mass and voltage, with indices.

    ``results`` are by the task's id; an entry without a result is waiting. Keys that a list or a
    sample varies, and its loads, are coordinates along specimen. Answers to questions have no
    dimension that they do not depend on. Numbers are in SI, with the unit as attribute ``units``;
    the unit of a result also ends its name. ``stroke_m`` is the deflection less that at the lowest
    voltage. Missing numbers are nan; several warnings are joined with " | ".
    """
    import xarray as xr

    coordinates = _coordinates(sweep)
    axes = ("specimen", *sweep.grid, *(load for load in LOAD_UNITS if coordinates[load][0] == load))
    kept = [_result(sweep, entry, results) for entry in sweep.entries]

    def variable(names: tuple[str, ...], values: Any) -> tuple[tuple[str, ...], np.ndarray]:
        shape = tuple(len(coordinates[name][1]) for name in names)
        return names, _column(values).reshape(shape)

    values = dict(zip(numbers(), np.concatenate([result.numbers for result in kept], axis=1),
                      strict=True))
    texts = {name: [text for result in kept for text in result.texts[name]] for name in TEXTS}
    texts["id"] = [case_id for entry in sweep.entries for case_id in _ids(entry)]
    of_cases: dict[str, Any] = values | texts
    data = {name: variable(axes, of_cases[name]) for name in ("id", *columns())}
    for name in sweep.ask.names:
        quantity = QUESTIONS[name]
        records = [record for result in kept for record in result.answers[name]]
        along = tuple(axis for axis in axes if axis not in LOAD_UNITS or axis in quantity.loads)
        data |= {column: variable(along, [record.get(column) for record in records])
                 for column in quantity.names(sweep.ask.circles.circles)}
        data[f"{name}_warnings"] = variable(along, [record["warnings"] for record in records])
    table = _with_stroke(xr.Dataset(data, coordinates,
                                    {"title": "tympan sweep", "source": solver()}))
    for label, array in table.variables.items():
        if array.dtype.kind == "f":
            array.attrs.setdefault("units", unit_of(str(label)) or "1")
    return table


def _with_stroke(table: xr.Dataset) -> xr.Dataset:
    """Add ``stroke_m`` to a table: deflection less that at the lowest voltage, or nan.

    It is nan where either is missing, where all cases have one voltage, or each specimen its own.
    """
    deflection = table["deflection_m"]
    if "voltage" in table.dims and table.sizes["voltage"] > 1:
        stroke = deflection - deflection.isel(voltage=0, drop=True)
    else:
        stroke = deflection * np.nan
    names = list(table.data_vars)
    names.insert(names.index("deflection_m") + 1, "stroke_m")
    return table.assign(stroke_m=stroke)[names]


def _result(sweep: Sweep, entry: Entry, results: Mapping[str, PackedResult]) -> PackedResult:
    """Find the result of an entry's task, or the reason why there is none."""
    if entry.task is not None and entry.task.id in results:
        return results[entry.task.id]
    loads = dict(zip(LOAD_UNITS, (len(entry.masses), len(entry.voltages)), strict=True))
    if entry.task is None:
        return without_result(_ids(entry), sweep.ask, loads, entry.reason).packed()
    return without_result(_ids(entry), sweep.ask, loads, "", WAITING).packed()


def _ids(entry: Entry) -> Sequence[str]:
    """List the ids of an entry's cases; they are empty if it cannot be built."""
    if entry.task is None:
        return [""] * (len(entry.masses) * len(entry.voltages))
    return entry.task.ids


def _coordinates(sweep: Sweep) -> dict[str, Coordinate]:
    """Make the coordinates: specimens, and each key of the grid, or its parts if it has any."""
    specimens = sweep.entries[::prod(map(len, sweep.grid.values()))]
    coordinates: dict[str, Coordinate] = {
        "specimen": ("specimen", _column([entry.name for entry in specimens]), {}),
        "base": ("specimen", _column([entry.base for entry in specimens]), {})}
    for axis, values in sweep.grid.items():
        coordinates |= _parameters(axis, [{axis: value} for value in values])
        labels = [", ".join(map(str, dict(flattened({axis: value})).values())) for value in values]
        coordinates.setdefault(axis, (axis, _column(labels), {}))
    coordinates |= _parameters("specimen", [
        {key: value for key, value in entry.choice.items() if key not in (*sweep.grid, *LOAD_UNITS)}
        for entry in specimens])
    for load, unit in LOAD_UNITS.items():
        values = [{"mass": entry.masses, "voltage": entry.voltages}[load] for entry in specimens]
        coordinates[load] = (("specimen", np.array(values)[:, 0], {"units": unit})
                             if load in specimens[0].choice
                             else (load, np.array(values[0]), {"units": unit}))
    return coordinates


def _parameters(axis: str, choices: list[dict[str, Any]]) -> dict[str, Coordinate]:
    """Make coordinates of parameters that differ along an axis, by key: SI numbers, or texts."""
    varied = [dict(flattened(choice)) for choice in choices]
    coordinates: dict[str, Coordinate] = {}
    for key in dict.fromkeys(key for choice in varied for key in choice):
        values = [choice.get(key) for choice in varied]
        read = [read_quantity(value) for value in values]
        units = {number[1] for number in read if number is not None}
        if len(units) == 1 and read.count(None) == values.count(None):
            numbers = [None if number is None else number[0] for number in read]
            coordinates[key] = axis, _column(numbers), {"units": units.pop() or "1"}
        else:
            texts = ["" if value is None else str(value) for value in values]
            coordinates[key] = axis, _column(texts), {}
    return coordinates


def beyond_limits(table: xr.Dataset) -> dict[str, xr.DataArray]:
    """Find the cases beyond each limit, at their voltage or on the way up to it: a mask by limit.

    They may nevertheless be equilibria by the equations.
    """
    beyond = {"breakdown": table["breakdown_margin"] < 1, "tension": table["slack_share"] > 0}
    return {limit: cases.copy(data=np.logical_or.accumulate(
        cases.values, cases.get_axis_num("voltage"))) if "voltage" in cases.dims else cases
        for limit, cases in beyond.items()}


def frame(table: xr.Dataset) -> pd.DataFrame:
    """Make a row per case: its inputs, then its results; units end the names of all numbers."""
    flat = table.to_dataframe(dim_order=list(table["status"].dims)).reset_index()
    inputs = [str(name) for name in table.coords if name != "specimen"]
    results = [name for name in ("status", *table.data_vars) if name not in ("id", "warnings")]
    flat = flat[list(dict.fromkeys(["specimen", *inputs, *results, "warnings", "id"]))]
    return flat.rename(columns={name: column_name(table, name) for name in inputs})


def column_name(table: xr.Dataset, name: str) -> str:
    """Name a table's coordinate in a flat table: its unit ends the name."""
    unit = table[name].attrs.get("units")
    return name + next((item.suffix for item in DIMENSIONS.values() if item.si == unit), "")


def flattened(choice: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield keys and single values: a list becomes its elements.

    Examples
    --------
    >>> list(flattened({"frame.semi_axes": ["6 cm", "4 cm"], "frame.shape": "ellipse"}))
    [('frame.semi_axes.0', '6 cm'), ('frame.semi_axes.1', '4 cm'), ('frame.shape', 'ellipse')]
    """
    for key, value in choice.items():
        if isinstance(value, Sequence) and not isinstance(value, str):
            yield from flattened({f"{key}.{number}": item for number, item in enumerate(value)})
        elif isinstance(value, Mapping):
            yield from flattened({f"{key}.{name}": item for name, item in value.items()})
        else:
            yield key, value


def _column(values: Any) -> np.ndarray:
    """Convert to an array: texts unchanged, warnings joined, missing numbers as nan."""
    if isinstance(values, np.ndarray):
        return values
    if all(isinstance(value, str) for value in values):
        return np.array(values, dtype=object)
    if all(isinstance(value, list) for value in values):
        return np.array([WARNINGS_JOINED.join(value) for value in values], dtype=object)
    return np.array([np.nan if value is None else float(value) for value in values])
