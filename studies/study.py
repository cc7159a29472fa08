"""The main task: specimens solved, their fields, lines and curves, and α of every shape."""

from __future__ import annotations

import platform
import time
from collections import Counter
from dataclasses import dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np

from tympan.base.arrays import Array, Columns
from tympan.base.errors import InputError
from tympan.base.extras import version_of
from tympan.base.fields import Key, Special, read
from tympan.base.progress import Progress
from tympan.base.read_file import file_text
from tympan.base.toml_reader import Table
from tympan.base.units import drive_words
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import Fields, edge_fields
from tympan.fem.rig import (
    MASS_RULE,
    VOLTAGE_RULE,
    Rig,
    load_actuator,
    mounted_together,
    rig_under,
)
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.specimen import Specimen
from tympan.studies.alpha import AlphaResult, AlphaSettings, alpha
from tympan.studies.case import Case, CaseResult, Settings, solved
from tympan.studies.columns import Column, as_written, read_own_sheet, write_sheet
from tympan.studies.driven import Voltages, by_segment, driven_once, film_voltage, in_proportion
from tympan.studies.files import from_json, read_json, remove, to_json, write_json
from tympan.studies.film_surface import FilmSurface, film_surface
from tympan.studies.force.force import ForceCase, force
from tympan.studies.force.result import ForceResult
from tympan.studies.limits.curve import CurveResult, curve
from tympan.studies.limits.loads import LoadGrid, usual_masses
from tympan.studies.shipped import STUDY, specimen_tables
from tympan.studies.tolerance.bands import banded
from tympan.studies.tolerance.given import Tolerances, causes, tolerances_under

Banded = TypeVar("Banded", CaseResult, CurveResult, ForceResult | None)

#: Boundaries of the mesh: the lines x and y through the plate's centre, and the plate's edge.
_BOUNDARIES = {"x": "axis_x", "y": "axis_y", "plate": "plate"}

#: Number of deflections of a force curve: half of that in ``tympan force``, for a small picture.
_PULLED = 31
#: Largest deflection of a force curve over the largest one under the lightest load.
_BEYOND = 1.25
#: Share of the film's first limit at which forces are computed if no voltage is given.
_BELOW_LIMIT = 0.8

#: Columns of lines/NAME.csv: signed distance from the plate's centre along x and y, angle times
#: radius around the plate.
LINES: tuple[Column, ...] = (
    Column.labels("line", tuple(_BOUNDARIES)),
    Column("distance", "mm"),
    Column("deflection", "mm"),
    Column("stress_1", "kPa"),
    Column("stress_2", "kPa"),
    Column("stress_radial", "kPa"),
    Column("stress_circumferential", "kPa"),
    Column("stretch_1"),
    Column("stretch_2"),
    Column("thickness", "um"),
    Column("field", "MV_per_m"),
)


@dataclass(frozen=True)
class Study:
    """Specimens and settings of a study.

    ``mass`` [kg] and ``voltage`` [V] are those of the picture. ``curves``: masses of the
    deflection–voltage curves, and the voltages marked on them. ``sources``: the specimens' files as
    text, for the report. Masses that are None are chosen from the films. With ``tolerances``,
    results, curves and forces have tolerance bands.
    """

    name: str
    specimens: tuple[Specimen, ...]
    sources: tuple[str, ...]
    mass: float | None = None
    voltage: float = 0.0
    rig: Rig = field(default_factory=Rig)
    curves: LoadGrid | None = None
    alpha: AlphaSettings = field(default_factory=AlphaSettings)
    settings: Settings = field(default_factory=Settings)
    tolerances: Tolerances | None = None

    @property
    def steps(self) -> int:
        """Number of times that :func:`run_study` reports progress."""
        return 5 * len(self.specimens)

    def within(self, tolerances: Tolerances | None) -> Study:
        """Replace the tolerances where others are given."""
        return self if tolerances is None else replace(self, tolerances=tolerances)

    def with_loads(self) -> Study:
        """Add masses that suit all films if none are given."""
        if self.mass is not None and self.curves is not None:
            return self
        mass = self.mass
        if not mass:
            mass = min(usual_masses(specimen, self.settings, self.rig)[0]
                       for specimen in self.specimens)
        return replace(self, mass=mass if self.mass is None else self.mass,
                       curves=self.curves or LoadGrid((mass, 1.25 * mass)))

    def banded(self, result: Banded, specimen: Specimen) -> Banded:
        """Add bands to a result of one of the films, if there are tolerances."""
        if self.tolerances is None or result is None:
            return result
        made: Banded = banded(result, specimen, self.tolerances, self.rig, self.settings)
        return made


@dataclass(frozen=True, eq=False)
class SpecimenResult:
    """Results of one specimen of a study: fields under the picture's load, lines and curves.

    ``semi_axes_m``: half extents of the frame. ``source``: its file as text. ``lines`` has the
    columns of :data:`LINES` in SI. Lines, curves, film and ``force`` have files of their own.
    ``force`` is None if no tester can pull the plate from the flat film.
    """

    name: str
    source: str
    material: str
    semi_axes_m: tuple[float, ...]
    result: CaseResult
    curves: CurveResult
    lines: Columns = field(default_factory=dict, compare=False)
    force: ForceResult | None = field(default=None, compare=False)

    def save(self, folder: Path) -> None:
        """Write ``fields/NAME.vtu``, ``lines/NAME.csv``, ``curves/NAME.csv`` and ``forces``."""
        assert self.result.film is not None
        self.result.film.save(folder / "fields" / f"{self.name}.vtu")
        write_sheet(folder / "lines" / f"{self.name}.csv", LINES, self.lines)
        write_sheet(folder / "curves" / f"{self.name}.csv", self.curves.columns, self.curves.table)
        remove(folder / "forces", *(f"{self.name}{ForceResult.ending}.{kind}"
                                    for kind in ForceResult.kinds))
        if self.force is not None:
            self.force.save(folder / "forces")

    def as_stored(self) -> SpecimenResult:
        """Round the result to the digits of its files."""
        return replace(self, lines=as_written(LINES, self.lines), curves=self.curves.as_stored())

    def with_files(self, folder: Path, key: str) -> SpecimenResult:
        """Load the files that :meth:`save` wrote; ``key`` is the result's own in study.json."""
        name = self.name
        if Path(name).name != name:
            raise InputError("must be a file name", file=folder / "study.json", key=f"{key}.name",
                             given=name)
        film = FilmSurface.load(folder / "fields" / f"{name}.vtu")
        table = read_own_sheet(folder / "curves" / f"{name}.csv", self.curves.columns)
        forces = folder / "forces"
        pulled = (forces / f"{name}{ForceResult.ending}.json").exists()
        return replace(self, result=replace(self.result, film=film),
                       lines=read_own_sheet(folder / "lines" / f"{name}.csv", LINES),
                       curves=replace(self.curves, table=table),
                       force=ForceResult.load(forces, name) if pulled else None)


@dataclass(frozen=True, eq=False)
class StudyResult:
    """All results of a study for its report; ``mass_kg`` and ``voltage_V`` are the picture's.

    ``from_films``: names of the loads that were chosen from the films instead of given. ``rig``,
    ``settings`` and ``alpha_settings`` are those of the run. ``libraries`` and ``python`` are its
    versions.
    """

    #: Names of its pictures; fig4 is the stress picture of earlier versions.
    pictures: ClassVar[tuple[str, ...]] = tuple(
        f"{stem}.{suffix}" for stem in ("stress", "fig4", "curves", "forces")
        for suffix in ("png", "pdf", "svg"))

    name: str
    version: str
    libraries: dict[str, str]
    python: str
    finished: str
    mass_kg: float
    voltage_V: float
    rig: dict[str, Any]
    settings: dict[str, Any]
    alpha_settings: dict[str, Any]
    from_films: tuple[str, ...]
    specimens: tuple[SpecimenResult, ...]
    alphas: tuple[AlphaResult, ...] = field(default=(), compare=False)

    @property
    def drive(self) -> str:
        """Voltage of the picture, or those of the segments where they differ."""
        shares = {each.name: each.share for item in self.specimens for each in item.result.segments}
        return (drive_words({name: share * self.voltage_V for name, share in shares.items()})
                or f"{self.voltage_V / 1e3:g} kV")

    @property
    def rows(self) -> dict[str, Array]:
        """Rows of all curves, with the names of their specimens."""
        tables = [specimen.curves.table for specimen in self.specimens]
        names = [np.full(len(table["mass"]), specimen.name, dtype=object)
                 for specimen, table in zip(self.specimens, tables, strict=True)]
        columns = {column.name: column for specimen in self.specimens
                   for column in specimen.curves.columns}
        return {"specimen": np.concatenate(names)} | {
            name: np.concatenate([table.get(name, _blank(column, len(table["mass"])))
                                  for table in tables]) for name, column in columns.items()}

    def json(self) -> dict[str, Any]:
        """Write the study as a JSON object, without α."""
        record: dict[str, Any] = to_json(self)
        return record

    def save(self, folder: Path) -> None:
        """Write the files of a report: the specimens' files, ``alpha.json`` and ``study.json``.

        The last one is written last, so its presence means the rest is complete.
        """
        discard_report(folder)
        for specimen in self.specimens:
            specimen.save(folder)
        write_json(folder / "alpha.json", [result.record() for result in self.alphas])
        write_json(folder / "study.json", self.json())

    def as_stored(self) -> StudyResult:
        """Round the result to the digits of its files."""
        return replace(self, specimens=tuple(item.as_stored() for item in self.specimens))

    @classmethod
    def load(cls, folder: Path) -> StudyResult:
        """Load everything a study stored under ``folder``."""
        file, weights = folder / "study.json", folder / "alpha.json"
        stored = from_json(cls, read_json(file), file)
        if not stored.specimens:
            raise InputError("must not be empty", file=file, key="specimens")
        alphas = from_json(tuple[Any, ...], read_json(weights), weights)
        return replace(
            stored, specimens=tuple(specimen.with_files(folder, f"specimens[{number}]")
                                    for number, specimen in enumerate(stored.specimens)),
            alphas=tuple(AlphaResult.of_record(record, weights, f"[{number}]")
                         for number, record in enumerate(alphas)))


def _blank(column: Column, count: int) -> Any:
    """Make the cells of a column that a table does not have."""
    return np.full(count, np.nan) if column.choices is None else np.full(count, "")


def discard_report(folder: Path) -> None:
    """Remove the files that mark a study in the folder as complete."""
    remove(folder, "study.json", "alpha.json", "report.html")


def default_study() -> Study:
    """Read the study of the source paper's three actuators under 17.9 g."""
    return read_study(STUDY)


@dataclass(frozen=True)
class StudyFile:
    """Keys of a study's file; loads that are left out are chosen from the films."""

    specimens: Annotated[tuple[Table, ...], Key(
        "specimens: their files, the paper's by name, or their tables; one or a list")]
    name: Annotated[str, Key("of the study and its report", default="the file's name")] = ""
    mass: Annotated[float | None, Key("load on the plate in the picture", "mass", MASS_RULE,
                                      default="suits the films")] = None
    voltage: Annotated[float, Key(
        "nominal voltage in the picture; of an electrode in segments also by their names, whose "
        "proportion all loads without names keep", "voltage", VOLTAGE_RULE)] = 0.0
    rig: Annotated[Rig | None, Key("of all specimens: its keys, or the name of their file",
                                   default="that of the specimens")] = None
    tolerances: Annotated[Tolerances | None, Key(
        "also the spread between films made to these: their tables, or the name of their file")
        ] = None
    curves: Annotated[LoadGrid | None, Key(
        "masses of the curves, and voltages that are marked on them")] = None
    alpha_fit: Annotated[LoadGrid | None, Key("loads on which α is fitted")] = None
    alpha_held_out: Annotated[LoadGrid | None, Key("loads on which α is tested")] = None


def read_study(file: Path) -> Study:
    """Read a study from the file of a :class:`StudyFile`."""
    table = Table.read(file, "study")
    given = read(StudyFile, table, _READERS)
    specimens = tuple(map(load_actuator, given.specimens))
    repeated = [name for name, count in Counter(item.name for item in specimens).items()
                if count > 1]
    if repeated:
        raise table.error("specimens", "must have different names", sorted(repeated))
    picture, loads = table.data.get("voltage"), given.curves
    voltage = given.voltage
    try:
        bare, rig = mounted_together(specimens, given.rig)
        if by_segment(picture):
            pairs = [driven_once(specimen, picture) for specimen in bare]
            bare, voltage = tuple(specimen for specimen, _ in pairs), pairs[0][1]
        if loads is not None:
            for specimen in bare:
                in_proportion(specimen, loads.voltages, loads.segment_voltages)  # known names
    except InputError as error:
        raise error.located(file=file) from None
    sources = (specimen_to_toml(specimen) if source.where else file_text(source.file)
               for source, specimen in zip(given.specimens, specimens, strict=True))
    return Study(
        given.name or file.stem, bare, tuple(sources), mass=given.mass, voltage=voltage,
        rig=rig, curves=given.curves, alpha=AlphaSettings(given.alpha_fit, given.alpha_held_out),
        tolerances=given.tolerances)


def run_study(study: Study, progress: Progress = lambda _: None, folder: Path | None = None
              ) -> StudyResult:
    """Run a study; with a ``folder``, save each specimen there as soon as it is finished.

    Raises
    ------
    InputError
        If a specimen has no equilibrium under the picture's load.
    """
    if folder is not None:
        discard_report(folder)
    from_films = tuple(name for name, given in (
        ("mass", study.mass), ("curves", study.curves),
        ("alpha", study.alpha.fit and study.alpha.held_out)) if given is None)
    for specimen in study.specimens:
        specimen.needed_plate()
        if study.tolerances is not None:
            causes(specimen, study.tolerances)
    study = study.with_loads()
    assert study.mass is not None
    specimens = []
    for specimen, source in zip(study.specimens, study.sources, strict=True):
        specimens.append(_solved(study, specimen, source, progress))
        if folder is not None:
            specimens[-1].save(folder)
    alphas = []
    for specimen in study.specimens:
        progress(f"{specimen.name}: α")
        alphas.append(alpha(specimen, study.settings, study.alpha, study.rig))
    libraries = ("cadquery", "gmsh", "meshio", "numpy", "pyvista", "scikit-fem", "scipy", "vtk")
    return StudyResult(
        study.name, metadata.version("tympan"),
        {name: found for name in libraries if (found := version_of(name)) is not None},
        platform.python_version(),
        time.strftime("%Y-%m-%d %H:%M:%S %z"), study.mass, study.voltage,
        to_json(study.rig.record()), to_json(study.settings), to_json(study.alpha),
        from_films, tuple(specimens), tuple(alphas))


def line_profile(model: Model, state: State, line: str) -> tuple[Array, Fields]:
    """Compute distances [m], shape (n,), and fields along a line of lines/NAME.csv.

    "x" and "y" pass through the plate's centre from end to end. "plate" goes around the plate, by
    angle.
    """
    fields, _ = edge_fields(model, state, _BOUNDARIES[line])
    arm = fields.position - model.centre
    x, y, _ = arm.T
    along = {"x": x, "y": y, "plate": np.arctan2(y, x)}[line]
    order = np.argsort(along, kind="stable")
    fields = fields[order]
    if line != "plate":
        return along[order], fields
    steps = np.linalg.norm(np.diff(fields.position, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)]), fields


def _solved(study: Study, specimen: Specimen, source: str, progress: Progress) -> SpecimenResult:
    progress(f"{specimen.name}: mesh and equilibrium")
    assert study.mass is not None
    assert study.curves is not None
    case = Case(specimen, mass=study.mass, voltage=study.voltage, rig=study.rig)
    model, outcome, result = solved(case, study.settings)
    if outcome.status != "equilibrium":
        raise InputError(f"has no picture at {study.mass * 1e3:g} g and {study.voltage / 1e3:g} "
                         f"kV: {case.doubted(result.warnings[0])}", key="specimens",
                         given=specimen.name)
    progress(f"{specimen.name}: fields")
    result = replace(result, film=film_surface(model, outcome.state))
    lines = _lines(model, outcome.state)
    progress(f"{specimen.name}: curves")
    curves = curve(specimen, study.curves.masses, study.settings, study.rig, study.curves.voltages,
                   segment_voltages=study.curves.segment_voltages)
    progress(f"{specimen.name}: forces")
    forces = _force(study, specimen, curves)
    return SpecimenResult(specimen.name, source, str(specimen.membrane.material),
                          specimen.frame.semi_axes, study.banded(result, specimen),
                          study.banded(curves, specimen), lines, study.banded(forces, specimen))


def _force(study: Study, specimen: Specimen, curves: CurveResult) -> ForceResult | None:
    """Compute forces without voltage and at the highest voltage that the lightest load bears."""
    first, table = curves.curves[0], curves.table
    of_first = table["mass"] == first.mass_kg
    borne = of_first & (table["asked"] > 0) & (table["status"] == "equilibrium")
    voltage = float(table["voltage"][borne].max(initial=study.voltage))
    if not voltage and first.limits.limit is not None:
        voltage = _BELOW_LIMIT * first.limits.limit.voltage_V
    way = table["deflection"][of_first & (table["voltage"] <= voltage)]
    ends = _BEYOND * np.nanmin(way, initial=0.0), _BEYOND * np.nanmax(way, initial=0.0)
    if study.rig.guide == "fixed" or ends[0] == ends[1]:
        return None
    try:
        return force(ForceCase(
            specimen, voltages=tuple(dict.fromkeys((0.0, voltage))), start=float(ends[0]),
            to=float(ends[1]), points=_PULLED, masses=(first.mass_kg,), rig=study.rig),
            study.settings)
    except InputError:  # a film that is slack where it is flat has no curve
        return None


def _lines(model: Model, state: State) -> Columns:
    parts = []
    for line in _BOUNDARIES:
        distance, fields = line_profile(model, state, line)
        parts.append({**vars(fields), "line": np.full(len(distance), line), "distance": distance,
                      "deflection": fields.displacement[:, 2], "field": fields.electric_field})
    return {column.name: np.concatenate([part[column.name] for part in parts]) for column in LINES}


def _loads(table: Table, key: str) -> LoadGrid | None:
    if table.value(key, None) is None:
        return None
    inner = table.table(key)
    if by_segment(inner.data.get("voltage")):
        return _by_name(table, inner, key)
    loads: LoadGrid = read(LoadGrid, inner)
    if list(loads.voltages) != sorted(loads.voltages):
        raise table.error(f"{key}.voltage", "must ascend", table.value(key)["voltage"])
    return loads


def _by_name(table: Table, inner: Table, key: str) -> LoadGrid:
    """Read loads whose voltages are those of segments by their names."""
    if key != "curves":
        raise table.error(f"{key}.voltage", "must be voltages without names: α is fitted in the "
                          "proportion that the study's voltage has", inner.data["voltage"])
    try:
        volts = Voltages.read(inner.data["voltage"], "voltage")
    except InputError as error:
        raise table.error(f"{key}.voltage", error.allowed, error.given) from None
    loads: LoadGrid = read(LoadGrid, inner, {
        (LoadGrid, "voltages"): lambda within, name: (film_voltage(within, name, VOLTAGE_RULE),)})
    return replace(loads, voltages=volts.film, segment_voltages=volts.segments)


#: Readers of keys that accept more forms than their declaration.
_READERS: Special = {
    (StudyFile, "specimens"): specimen_tables,
    (StudyFile, "rig"): rig_under,
    (StudyFile, "tolerances"): tolerances_under,
    (StudyFile, "voltage"): lambda table, key: film_voltage(table, key, VOLTAGE_RULE) or 0.0,
    **{(StudyFile, key): _loads for key in ("curves", "alpha_fit", "alpha_held_out")},
}
