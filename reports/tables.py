"""Results as pandas tables: a row for each state, mode, circle or case; fields by xarray. In SI."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import singledispatch
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from tympan.base.arrays import Array
from tympan.base.units import unit_of
from tympan.studies.alpha import AlphaResult
from tympan.studies.case import CaseResult
from tympan.studies.design.result import DesignResult
from tympan.studies.diagnosis.film_fit import FilmFit
from tympan.studies.diagnosis.result import Diagnosis
from tympan.studies.film_surface import FIELD_UNITS
from tympan.studies.force import ForceResult
from tympan.studies.identify.result import IdentifyResult
from tympan.studies.limits import CurveResult, LimitsResult
from tympan.studies.lumped.build import BuildResult
from tympan.studies.lumped.control.result import ControlResult
from tympan.studies.lumped.linear import LinearResult
from tympan.studies.material.result import MaterialFitResult
from tympan.studies.response import ResponseResult
from tympan.studies.sense import SenseResult
from tympan.studies.sensitivity import SensitivityResult
from tympan.studies.study import StudyResult
from tympan.studies.sweep.run import SweepResult
from tympan.studies.sweep.table import frame
from tympan.studies.tolerance.result import ToleranceResult
from tympan.studies.trace import Responses

#: Rows of a table that are shown.
_ROWS = 12
#: Columns of a table that are printed: as many as a terminal is wide.
_COLUMNS = 8
#: Letters of a cell that are printed.
_LETTERS = 60
#: How numbers are shown.
_DIGITS = "{:.6g}".format


def labelled(values: Mapping[str, Array], along: str,
             **places: Array) -> xr.Dataset:
    """Fields of a film as an xarray dataset along one dimension, with their units.

    ``places``: where in the flat film they are [m], by coordinate.
    """
    def variable(name: str, value: Array) -> xr.Variable:
        dims = (along, "component")[:value.ndim]
        return xr.Variable(dims, value, {"units": FIELD_UNITS.get(name, "1")})

    where = {name: xr.Variable(along, value, {"units": "m"}) for name, value in places.items()}
    return xr.Dataset({name: variable(name, value) for name, value in values.items()},
                      where | {"component": ["x", "y", "z"]})


#: Columns that are dimensions, by kind of result: what was varied, or what rows are of.
_DIMENSIONS: dict[type, tuple[str, ...]] = {
    AlphaResult: ("radius_m",),
    BuildResult: ("specimen", "mass_kg", "voltage_V"),
    CurveResult: ("specimen", "mass", "voltage"),
    DesignResult: ("film", "quantity"),
    FilmFit: ("constant",),
    ForceResult: ("voltage_V", "displacement_m"),
    LimitsResult: ("kind",),
    ResponseResult: ("frequency_Hz",),
    SenseResult: ("voltage_V", "displacement_m"),
    SensitivityResult: ("quantity", "parameter"),
    ToleranceResult: ("quantity",),
}


def dataset(result: object) -> xr.Dataset:
    """A result as an xarray dataset with dimensions and units."""
    if isinstance(result, SweepResult):
        return result.table
    if isinstance(result, CaseResult):
        return _state(result)
    rows = table(result)
    keys = [name for name in _DIMENSIONS.get(type(result), ()) if name in rows]
    found: xr.Dataset = (rows.set_index(keys) if keys and not rows.duplicated(keys).any()
                         else rows).to_xarray()
    for name, variable in found.variables.items():
        variable.attrs |= _units(str(name))
    return found


def _state(result: CaseResult) -> xr.Dataset:
    """Numbers of one state, and the fields of its film."""
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
    """Table of names, values and units; columns of several rows have their unit in their name."""
    rows, most = _shown(result)
    return str(rows.to_html(index=False, max_rows=most, border=0, na_rep="", float_format=_DIGITS))


def text(result: object) -> str:
    """Table of names, values and units for a terminal; the middle of a wide one is left out."""
    rows, most = _shown(result)
    return str(rows.to_string(index=False, max_rows=most, max_cols=_COLUMNS, na_rep="",
                              max_colwidth=_LETTERS, float_format=_DIGITS))


def _shown(result: object) -> tuple[pd.DataFrame, int | None]:
    """Table to show of a result, and most rows of it; None for all."""
    rows = table(result)
    if len(rows) != 1:
        return rows, _ROWS
    row = pd.json_normalize(rows.to_dict("records")).iloc[0].dropna()
    return pd.DataFrame([(name, value, unit_of(str(name)) or "") for name, value in row.items()],
                        columns=["name", "value", "unit"]), None


@singledispatch
def table(result: object) -> pd.DataFrame:
    """The table of a result: its ``rows``, unless its kind registers another."""
    rows: Mapping[str, Array] | None = getattr(result, "rows", None)
    if rows is None:
        raise TypeError(f"there is no table of {type(result).__name__}")
    return pd.DataFrame(rows)


@table.register
def _(result: CaseResult) -> Any:
    return pd.DataFrame([result.json() | {"warnings": " | ".join(result.warnings)}])


@table.register
def _(result: Responses) -> Any:
    return pd.concat([response.samples for response in result.responses], ignore_index=True).rename(
        columns={"mass": "mass_kg", "t": "t_s", "voltage": "voltage_V",
                 "displacement": "displacement_m"})


@table.register
def _(result: SensitivityResult) -> Any:
    return pd.DataFrame([{"quantity": quantity, "parameter": parameter, "unit": answer.unit}
                         | asdict(answer) for quantity, answers in result.quantities.items()
                         for parameter, answer in answers.by.items()])


@table.register
def _(result: AlphaResult) -> Any:
    weights = result.by_basis["membrane"]
    return pd.DataFrame({"radius_m": result.circles, "alpha": weights.alpha,
                         "fit_error": weights.fit_error,
                         "held_out_error": weights.held_out_error})


@table.register
def _(result: SweepResult) -> Any:
    return frame(result.table)


@table.register
def _(result: StudyResult) -> Any:
    return pd.concat([pd.DataFrame({"specimen": specimen.name, **specimen.curves.table})
                      for specimen in result.specimens], ignore_index=True)


@table.register
def _(result: CurveResult) -> Any:
    return pd.DataFrame(dict(result.table))


@table.register
def _(result: ToleranceResult) -> Any:
    return pd.DataFrame([{"quantity": name, **{key: getattr(spread, key) for key in (
        "nominal", "median", "low", "high", "deviation", "within_batch")},
        **{f"share_{share.label.replace(', ', '_')}": share.alone for share in spread.shares},
        "interactions": spread.interactions} for name, spread in result.quantities.items()])


@table.register
def _(result: BuildResult) -> Any:
    return result.statics.drop(columns="fitted").rename(
        columns={"mass": "mass_kg", "voltage": "voltage_V"})


@table.register
def _(result: LinearResult) -> Any:
    return pd.DataFrame([{"specimen": linear.specimen, **pole.json()}
                         for linear in result.linear for pole in linear.named_poles])


@table.register
def _(result: ControlResult) -> Any:
    return pd.DataFrame([{"specimen": film.specimen, **asdict(step)} for film in result.films
                         for step in film.steps])


@table.register
def _(result: IdentifyResult) -> Any:
    return pd.DataFrame([{"fit": kind, **asdict(constant)} for kind, fit in result.fits.items()
                         for constant in fit.determined.constants])


@table.register
def _(result: Diagnosis) -> Any:
    return pd.DataFrame([{"effect": cause.effect, "which": cause.which,
                          "probability": cause.probability, "parameter": name, **asdict(size)}
                         for cause in result.causes for name, size in cause.parameters.items()])


@table.register
def _(result: MaterialFitResult) -> Any:
    units = {"nominal_stress": "nominal_stress_Pa", "half_band": "half_band_Pa"}
    return pd.DataFrame(dict(result.curves)).rename(columns=units)


@table.register
def _(result: FilmFit) -> Any:
    return pd.DataFrame([{"constant": name, "unit": unit, **asdict(size)}
                         for name, unit, size in result.constants])


@table.register
def _(result: DesignResult) -> Any:
    return pd.DataFrame([{"film": film.specimen_file, "quantity": each.key, **{
        key: getattr(each, key) for key in ("unit", "given", "value", "reached", "sense", "bound")},
        "kept": None if each.kept is None else each.kept.probability, **{
        key: getattr(each, key) for key in ("missed", "binding", "relaxing", "attainable")}}
        for film in result.films for each in film.quantities])
