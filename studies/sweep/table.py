"""The results of a sweep as one labelled table: netCDF for programs, Parquet and CSV for people."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tympan.geometry.errors import InputError
from tympan.geometry.units import unit_of
from tympan.studies.files import write_atomically, write_text
from tympan.studies.sweep.plan import Sweep, read_quantity
from tympan.studies.sweep.task import COLUMNS, Row, failed_rows, solver

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

#: Dimensions of the table.
AXES = ("specimen", "mass", "voltage")


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
    """The table of a netCDF file."""
    import xarray as xr

    try:
        return xr.load_dataset(file, engine="h5netcdf")
    except FileNotFoundError:
        raise InputError("is missing: run tympan sweep again", file=file) from None
    except Exception as error:  # HDF5 and its readers raise whatever they meet
        raise InputError(f"is no table of a sweep: {type(error).__name__}: {error}",
                         file=file) from None


def dataset(sweep: Sweep, rows: Sequence[Sequence[Row] | None]) -> xr.Dataset:
    """Dimensions specimen, mass and voltage; coordinates along the first say what differs there.

    Numbers are in SI, names end with the unit, which is also the attribute ``units``. Numbers that
    do not exist are nan; several warnings are joined with " | ".
    """
    import xarray as xr

    entries = sweep.entries
    shape = (len(entries), len(entries[0].masses), len(entries[0].voltages))
    flat = [row for entry, entry_rows in zip(entries, rows, strict=True) for row in (
        failed_rows([""] * (shape[1] * shape[2]), entry.reason) if entry_rows is None
        else entry_rows)]
    data = {name: (AXES, _column(name, [row[name] for row in flat]).reshape(shape))
            for name in ("id", *COLUMNS)}
    coordinates: dict[str, Any] = {"specimen": [entry.name for entry in entries],
                                   "base": ("specimen", _texts([entry.base for entry in entries]))}
    for name, axis, loads in (("mass_kg", "mass", [entry.masses for entry in entries]),
                              ("voltage_V", "voltage", [entry.voltages for entry in entries])):
        alike = len(set(loads)) == 1
        coordinates[name] = ((axis, np.array(loads[0])) if alike
                             else (("specimen", axis), np.array(loads)))
    varied = [dict(flattened(entry.choice)) for entry in entries]
    for key in dict.fromkeys(key for choice in varied for key in choice):
        if key not in ("mass", "voltage"):
            name, coordinate = _parameter(key, [choice.get(key) for choice in varied])
            coordinates[name] = coordinate
    table = xr.Dataset(data, coordinates, {"title": "tympan sweep", "source": solver()})
    for label, variable in table.variables.items():
        if variable.dtype.kind == "f":
            variable.attrs.setdefault("units", unit_of(str(label)) or "1")
    return table


def frame(table: xr.Dataset) -> pd.DataFrame:
    """A row per case: its inputs, then its results."""
    flat = table.to_dataframe(dim_order=list(AXES)).reset_index()
    inputs = [name for name in table.coords if name != "specimen"]
    results = [name for name in ("status", *table.data_vars) if name not in ("id", "warnings")]
    return flat[list(dict.fromkeys(["specimen", *inputs, *results, "warnings", "id"]))]


def flattened(choice: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Keys and single values: a list becomes its elements.

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


def _parameter(key: str, values: list[Any]) -> tuple[str, Any]:
    """Name and coordinate of what the specimens differ in; the unit ends the name of numbers."""
    read = [None if value is None else read_quantity(value) for value in values]
    units = {number[1] for number in read if number is not None}
    if len(units) != 1 or any(number is None and value is not None
                              for number, value in zip(read, values, strict=True)):
        return key, ("specimen", _texts(["" if value is None else str(value) for value in values]))
    unit = units.pop()
    name = f"{key}_{unit.replace('/', '_per_').replace('^', '')}" if unit else key
    numbers = np.array([np.nan if number is None else number[0] for number in read])
    return name, ("specimen", numbers, {"units": unit or "1"})


def _column(name: str, values: list[Any]) -> np.ndarray:
    if name in ("status", "id", "warnings"):
        return _texts([" | ".join(value) if name == "warnings" else value for value in values])
    return np.array([np.nan if value is None else float(value) for value in values])


def _texts(values: list[str]) -> np.ndarray:
    return np.array(values, dtype=object)
