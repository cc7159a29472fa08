"""A finished study read back from disk, checked, in the units of the pictures: mm, kPa, kV."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any, get_args

import numpy as np
from meshio import vtu
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.geometry.toml_reader import NON_NEGATIVE, POSITIVE, Table
from tympan.studies.alpha import AlphaResult, Basis, Weights
from tympan.studies.case import CaseResult

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Line:
    """Values along one line of the film: ``distance`` and ``deflection`` [mm], largest true stress [kPa]."""

    distance: Array
    deflection: Array
    stress: Array

    def side(self, sign: int) -> Line:
        """The half at positive or negative distance, as distance from the plate's edge outwards."""
        outward = self.distance * sign
        order = np.flatnonzero(outward > 0)[np.argsort(outward[outward > 0], kind="stable")]
        return Line(outward[order] - outward[order].min(initial=np.inf), self.deflection[order],
                    self.stress[order])

    @property
    def sides(self) -> tuple[Line, ...]:
        """Both halves, or one if the other repeats it."""
        right, left = self.side(1), self.side(-1)
        same = len(right.stress) == len(left.stress) and np.allclose(right.distance, left.distance,
                                                                     atol=1e-6)
        # A hundredth of the curve's own height is less than the width of the line that draws it.
        if same and np.allclose(right.stress, left.stress, rtol=0, atol=0.01 * np.ptp(self.stress)):
            return (right,)
        return right, left

    @property
    def jump(self) -> float:
        """Largest jump of the stress where two elements meet [kPa]: what the discretisation leaves open."""
        meets = np.diff(self.distance) == 0
        return float(np.abs(np.diff(self.stress))[meets].max(initial=0.0))

    @property
    def at_plate(self) -> float:
        """The larger of the stresses at the two points of the plate's edge [kPa]."""
        return max(float(side.stress[0]) for side in self.sides)


@dataclass(frozen=True, eq=False)
class Curve:
    """Deflection [mm] against voltage [kV] under one mass [g]; the deflection is NaN where ``status`` has none.

    ``slack`` is the share of the film that has lost tension, ``margin`` the smallest strength over
    field, NaN where there is none.
    """

    mass: float
    voltage: Array
    status: tuple[str, ...]
    deflection: Array
    slack: Array
    margin: Array

    @property
    def found(self) -> NDArray[np.bool_]:
        """Where there is an equilibrium."""
        return np.array([status == "equilibrium" for status in self.status])

    @property
    def loose(self) -> NDArray[np.bool_]:
        """Where part of the film has lost tension."""
        return self.slack > 0

    @property
    def pull_in(self) -> tuple[float, float] | None:
        """Last voltage with an equilibrium (NaN if none) and the first without [kV]; None where all have one."""
        lost = [index for index, status in enumerate(self.status) if status == "no_equilibrium"]
        if not lost:
            return None
        before = np.flatnonzero(self.found[:lost[0]])
        return (float(self.voltage[before[-1]]) if len(before)
                else np.nan), float(self.voltage[lost[0]])


@dataclass(frozen=True, eq=False)
class Film:
    """The deformed film: ``points`` [mm], shape (n, 3), z along the load; triangles; largest true stress [kPa].

    ``mounted`` is where the points lay in the flat film [mm], ``least`` the smaller principal true
    stress [kPa], ``tension`` 0 where the film is taut, 1 wrinkled, 2 slack.
    """

    points: Array
    mounted: Array
    triangles: NDArray[np.int64]
    stress: Array
    least: Array
    tension: Array


@dataclass(frozen=True, eq=False)
class Stored:
    """One specimen of the study: ``semi_axes`` along x and y [mm], its results, lines and curves."""

    name: str
    semi_axes: tuple[float, float]
    material: str
    source: str
    result: CaseResult
    deflection: float  #: [mm]
    film: Film
    along_x: Line
    along_y: Line
    around_plate: Line
    curves: tuple[Curve, ...]

    @property
    def loose(self) -> bool:
        """Whether the film has lost tension anywhere."""
        return bool(self.film.tension.any())

    @property
    def round(self) -> bool:
        """Whether neither axis is the longer one."""
        a, b = self.semi_axes
        return abs(a - b) <= 1e-9 * max(a, b)

    @property
    def axes(self) -> tuple[str, str]:
        """What the short and the long axis are called."""
        return ("y", "x") if self.round else ("short", "long")

    @property
    def alike(self) -> bool:
        """Whether the stresses at the plate on the two axes differ by no more than the discretisation makes them."""
        noise = max(self.along_x.jump, self.along_y.jump, 1e-6 * abs(self.long.at_plate))
        return abs(self.short.at_plate - self.long.at_plate) <= noise

    @property
    def short(self) -> Line:
        """Along the short axis; along y where neither is shorter."""
        return self.along_x if self.semi_axes[0] < self.semi_axes[1] and not self.round else self.along_y

    @property
    def long(self) -> Line:
        """Along the long axis; along x where neither is longer."""
        return self.along_y if self.short is self.along_x else self.along_x


@dataclass(frozen=True, eq=False)
class Run:
    """A finished study: ``mass`` [g] and ``voltage`` [kV] of the picture, and ``record`` as stored."""

    name: str
    version: str
    finished: str
    mass: float
    voltage: float
    specimens: tuple[Stored, ...]
    alphas: tuple[AlphaResult, ...]
    record: Mapping[str, Any]

    @cached_property
    def stress_range(self) -> tuple[float, float]:
        """Smallest and largest of the largest true stresses of all films [kPa]."""
        low = min(float(item.film.stress.min()) for item in self.specimens)
        return low, max(float(item.film.stress.max()) for item in self.specimens)


def read_run(folder: Path) -> Run:
    """Everything a study stored under ``folder``.

    Raises
    ------
    InputError
        When a file is missing or is not what the study writes, naming the file and what is wrong.
    """
    file, weights = folder / "study.json", folder / "alpha.json"
    record = _json(file)
    if not isinstance(record, dict):
        raise InputError("must hold an object", file=file)
    table = Table(file, record)
    rows = _objects(file, "specimens", table.value("specimens"))
    if not rows:
        raise table.error("specimens", "must not be empty")
    for key in ("rig", "settings", "alpha_settings", "libraries"):
        table.table(key)
    table.text("python")
    return Run(
        table.text("name"), table.text("version"), table.text("finished"),
        table.number("mass_kg", rule=NON_NEGATIVE) * 1e3,
        table.number("voltage_V", rule=NON_NEGATIVE) / 1e3,
        tuple(_specimen(row, folder) for row in rows),
        tuple(map(_alpha, _objects(weights, "", _json(weights)))), record)


def _specimen(table: Table, folder: Path) -> Stored:
    name = table.text("name")
    if Path(name).name != name:
        raise table.error("name", "must be a file name", name)
    a, b = table.numbers("semi_axes_m", rule=POSITIVE, count=2)
    results = table.table("result")
    lines = _lines(folder / "lines" / f"{name}.csv")
    return Stored(
        name, (a * 1e3, b * 1e3), table.text("material"), table.text("source"), _result(results),
        results.number("deflection_m") * 1e3, _film(folder / "fields" / f"{name}.vtu"), *lines,
        _curves(folder / "curves" / f"{name}.csv"))


def _result(table: Table) -> CaseResult:
    values = {item.name: table.value(item.name) for item in fields(CaseResult)
              if item.name != "film"}
    for key, value in values.items():
        if key not in ("specimen", "status", "warnings") and value is not None:
            table.number(key)
    table.text("status")
    values["warnings"] = _texts(table, "warnings")
    return CaseResult(**values)


def _film(file: Path) -> Film:
    if not file.is_file():
        raise InputError("is missing: run the study again", file=file)
    try:
        # The reader itself, since meshio.read ends the whole process on a file it cannot read.
        mesh = vtu.read(file)
        points, displacement, stress, least, tension = (np.asarray(values, float) for values in (
            mesh.points, *(mesh.point_data[name] for name in ("displacement", "stress_1",
                                                              "stress_2", "tension"))))
        triangles = np.asarray(mesh.cells_dict["triangle"])
        mounted = points - displacement
        fitting = stress.shape == least.shape == tension.shape == points.shape[:1]
        if not fitting or not len(triangles) or triangles.max() >= len(points):
            raise ValueError("arrays do not belong together")
    except Exception as error:  # the reader raises whatever XML, base64, zlib and NumPy raise
        raise InputError(f"is not a film of a study: {type(error).__name__}: {error}",
                         file=file) from None
    if not all(np.isfinite(values).all() for values in (points, mounted, stress, least, tension)):
        raise InputError("holds values that are not finite", file=file)
    return Film(points * 1e3, mounted * 1e3, triangles, stress / 1e3, least / 1e3, tension)


def _lines(file: Path) -> tuple[Line, Line, Line]:
    rows = _rows(file, ("line", "distance_mm", "deflection_mm", "stress_1_kPa"))
    return _line(file, rows, "x"), _line(file, rows, "y"), _line(file, rows, "plate")


def _line(file: Path, rows: Sequence[Mapping[str, str]], name: str) -> Line:
    chosen = [(number, row) for number, row in enumerate(rows, 2) if row["line"] == name]
    columns = [np.array([_number(file, number, key, row[key]) for number, row in chosen])
               for key in ("distance_mm", "deflection_mm", "stress_1_kPa")]
    line = Line(*columns)
    if not chosen or (name != "plate" and not line.distance.min() < 0 < line.distance.max()):
        raise InputError(f"must have rows of the line {name!r} on both sides of the plate",
                         file=file, key="line")
    return line


def _curves(file: Path) -> tuple[Curve, ...]:
    rows: dict[float, list[tuple[float, str, float, float, float]]] = {}
    columns = ("mass_g", "voltage_kV", "status", "deflection_mm", "slack_share", "breakdown_margin")
    for number, row in enumerate(_rows(file, columns), 2):
        mass, voltage = (_number(file, number, key, row[key]) for key in ("mass_g", "voltage_kV"))
        there = row["status"] == "equilibrium"
        deflection, slack = (_number(file, number, key, row[key]) if there else np.nan
                             for key in columns[3:5])
        margin = _number(file, number, columns[5], row[columns[5]]) if row[columns[5]] else np.nan
        rows.setdefault(mass, []).append((voltage, row["status"], deflection, slack, margin))
    return tuple(_curve(mass, points) for mass, points in rows.items())


def _curve(mass: float, points: Sequence[tuple[float, str, float, float, float]]) -> Curve:
    voltage, status, *values = zip(*points, strict=True)
    return Curve(mass, np.array(voltage), status, *map(np.array, values))


def _alpha(table: Table) -> AlphaResult:
    bases, from_fields = table.table("bases"), table.table("from_fields")
    circles = table.numbers("circles", rule=POSITIVE)
    return AlphaResult(
        table.text("specimen"), circles,
        {name: _weights(bases.table(name), len(circles)) for name in get_args(Basis)},
        table.number("cone_scale"), _weights(from_fields, len(circles)),
        tuple((pair[0], pair[1]) for pair in _pairs(from_fields, "range")),
        _texts(table, "warnings"))


def _pairs(table: Table, key: str) -> list[tuple[float, ...]]:
    """A list of pairs of numbers, each checked as a row of its own."""
    rows = table.value(key)
    if not isinstance(rows, list):
        raise table.error(key, "must be a list of pairs", rows)
    return [Table(table.file, {f"{index}": row}, table.path(key)).numbers(f"{index}", count=2)
            for index, row in enumerate(rows)]


def _weights(table: Table, circles: int) -> Weights:
    held_out = None if table.value("held_out_error") is None else table.number("held_out_error")
    return Weights(table.numbers("alpha", count=circles), table.number("fit_error"), held_out)


def _json(file: Path) -> Any:
    try:
        return json.loads(_text(file))
    except json.JSONDecodeError as error:
        raise InputError(f"is not valid JSON: {error}", file=file) from None


def _text(file: Path) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError("is missing: run the study again", file=file) from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from None
    except UnicodeDecodeError as error:
        raise InputError(f"is not UTF-8 text (byte {error.start})", file=file) from None


def _rows(file: Path, columns: Sequence[str]) -> list[dict[str, str]]:
    text = _text(file)
    reader = csv.DictReader(text.splitlines())
    missing = [column for column in columns if column not in (reader.fieldnames or ())]
    if missing:
        raise InputError("column is missing", file=file, key=missing[0])
    rows = list(reader)
    if not rows:
        raise InputError("has no rows", file=file)
    short = [number for number, row in enumerate(rows, 2)
             if any(row[column] is None for column in columns)]
    if short or not text.endswith("\n"):
        raise InputError(f"is cut short in line {short[0] if short else len(rows) + 1}", file=file)
    return rows


def _number(file: Path, line: int, key: str, text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = np.nan
    if not np.isfinite(number):
        raise InputError(f"must be a finite number in line {line}", file=file, key=key, given=text)
    return number


def _objects(file: Path, key: str, items: object) -> list[Table]:
    """The objects of a list, each a table of its own."""
    if not isinstance(items, list) or not all(isinstance(item, dict) for item in items):
        raise InputError("must be a list of objects", file=file, key=key or None)
    return [Table(file, item, f"{key}[{index}]") for index, item in enumerate(items)]


def _texts(table: Table, key: str) -> tuple[str, ...]:
    items = table.value(key)
    if not isinstance(items, list) or not all(isinstance(item, str) for item in items):
        raise table.error(key, "must be a list of texts", items)
    return tuple(items)
