"""The main job: specimens solved, their fields, lines and curves, and α of every shape."""

from __future__ import annotations

import platform
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import Fields, edge_fields
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.fields import read
from tympan.geometry.read_file import file_text
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_reader import NON_NEGATIVE, Table
from tympan.studies.alpha import AlphaResult, AlphaSettings, LoadGrid, alpha
from tympan.studies.case import Case, CaseResult, Settings, build_model, solve_grid, solved
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.files import from_json, read_json, remove, to_json, write_json
from tympan.studies.film_surface import FilmSurface, film_surface
from tympan.studies.paper.actuators import FILES, actuators

Progress = Callable[[str], None]

#: SI values by column name, shape (rows,) each.
TableOfColumns = Mapping[str, NDArray[Any]]

#: Boundaries of the mesh along the lines x and y through the plate's centre, and around the plate.
_BOUNDARIES = {"x": "axis_x", "y": "axis_y", "plate": "plate"}

#: The columns of lines/NAME.csv: signed distance from the plate's centre along x and y, angle times
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

#: The columns of curves/NAME.csv.
CURVES: tuple[Column, ...] = (
    Column("mass", "g"),
    Column("voltage", "kV"),
    Column.labels("status"),
    Column("deflection", "mm", required=False),
    Column("slack_share", required=False),
    Column("breakdown_margin", required=False),
)


@dataclass(frozen=True)
class Study:
    """What is to be run.

    ``mass`` [kg] and ``voltage`` [V] are those of the picture; ``curves`` those of the
    deflection–voltage curves; ``sources`` the specimens' files as text, for the report.
    """

    name: str
    specimens: tuple[Specimen, ...]
    sources: tuple[str, ...]
    mass: float = 17.9e-3
    voltage: float = 0.0
    rig: Rig = field(default_factory=Rig)
    curves: LoadGrid = field(default_factory=lambda: LoadGrid(
        (17.9e-3, 22.45e-3), tuple(float(volts) for volts in range(0, 7001, 500))))
    alpha: AlphaSettings = field(default_factory=AlphaSettings)
    settings: Settings = field(default_factory=Settings)

    @property
    def steps(self) -> int:
        """How many times :func:`run_study` reports progress."""
        return 4 * len(self.specimens)


@dataclass(frozen=True, eq=False)
class SpecimenResult:
    """One specimen of a study: under the picture's load with its film, along lines, and curves.

    ``semi_axes_m`` are the frame's half extents, ``source`` its file as text. ``lines`` has the
    columns of :data:`LINES` and ``curves`` those of :data:`CURVES`, in SI; they and the film stand
    in files of their own.
    """

    name: str
    source: str
    material: str
    semi_axes_m: tuple[float, ...]
    result: CaseResult
    lines: TableOfColumns = field(default_factory=dict, compare=False)
    curves: TableOfColumns = field(default_factory=dict, compare=False)

    def save(self, folder: Path) -> None:
        """Write ``fields/NAME.vtu``, ``lines/NAME.csv`` and ``curves/NAME.csv``."""
        assert self.result.film is not None
        self.result.film.save(folder / "fields" / f"{self.name}.vtu")
        write_sheet(folder / "lines" / f"{self.name}.csv", LINES, self.lines)
        write_sheet(folder / "curves" / f"{self.name}.csv", CURVES, self.curves)

    def with_files(self, folder: Path, key: str) -> SpecimenResult:
        """With what :meth:`save` wrote; ``key`` is its own in study.json."""
        name = self.name
        if Path(name).name != name:
            raise InputError("must be a file name", file=folder / "study.json", key=f"{key}.name",
                             given=name)
        film = FilmSurface.load(folder / "fields" / f"{name}.vtu")
        return replace(self, result=replace(self.result, film=film),
                       lines=read_own_sheet(folder / "lines" / f"{name}.csv", LINES),
                       curves=read_own_sheet(folder / "curves" / f"{name}.csv", CURVES))


@dataclass(frozen=True, eq=False)
class StudyResult:
    """Everything a report of a study needs; ``mass_kg`` and ``voltage_V`` are the picture's.

    ``rig``, ``settings`` and ``alpha_settings`` are what the study was run with, ``libraries`` and
    ``python`` the versions it was run on.
    """

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
    specimens: tuple[SpecimenResult, ...]
    alphas: tuple[AlphaResult, ...] = field(default=(), compare=False)

    def json(self) -> dict[str, Any]:
        """As a JSON object, without α."""
        record: dict[str, Any] = to_json(self)
        return record

    def save(self, folder: Path) -> None:
        """Write what a report needs: the specimens' files, ``alpha.json`` and ``study.json``.

        The last one is written last, so its presence means the rest is complete.
        """
        discard_report(folder)
        for specimen in self.specimens:
            specimen.save(folder)
        write_json(folder / "alpha.json", [result.record() for result in self.alphas])
        write_json(folder / "study.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> StudyResult:
        """Everything a study stored under ``folder``."""
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


def discard_report(folder: Path) -> None:
    """Remove what says that a study in the folder is complete."""
    remove(folder, "study.json", "alpha.json", "report.html", *(
        f"{stem}.{suffix}" for stem in ("fig4", "curves") for suffix in ("png", "pdf", "svg")))


def default_study() -> Study:
    """The paper's three actuators under 17.9 g, as in its Fig. 4."""
    return Study("the paper's three actuators", actuators(),
                 tuple(file.read_text(encoding="utf-8") for file in FILES.values()))


def read_study(file: Path) -> Study:
    """A study from STUDY.toml.

    Keys: ``specimens`` (files beside it) and optionally name, mass, voltage, rig and loads.
    """
    table = Table.read(file)
    names = table.value("specimens")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise table.error("specimens", "must be a list of specimen files", names)
    paths = [file.parent / name for name in names]
    specimens = tuple(map(load_specimen, paths))
    repeated = [name for name, count in Counter(item.name for item in specimens).items()
                if count > 1]
    if repeated:
        raise table.error("specimens", "must have different names", sorted(repeated))
    default = Study("", (), ())
    study = Study(
        table.text("name", file.stem), specimens,
        tuple(map(file_text, paths)),
        mass=table.number("mass", "mass", "17.9 g", NON_NEGATIVE),
        voltage=table.number("voltage", "voltage", "0 kV", NON_NEGATIVE),
        rig=Rig.from_table(table.table("rig", {})),
        curves=_loads(table, "curves", default.curves),
        alpha=AlphaSettings(_loads(table, "alpha_fit", default.alpha.fit),
                            _loads(table, "alpha_held_out", default.alpha.held_out)),
    )
    table.done()
    return study


def run_study(study: Study, progress: Progress = lambda _: None, folder: Path | None = None
              ) -> StudyResult:
    """Run a study; with a ``folder``, each specimen is kept there as soon as it is finished.

    Raises
    ------
    InputError
        When a specimen has no equilibrium under the picture's load.
    """
    if folder is not None:
        discard_report(folder)
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
        {name: metadata.version(name) for name in libraries}, platform.python_version(),
        time.strftime("%Y-%m-%d %H:%M:%S %z"), study.mass, study.voltage,
        to_json(study.rig.record()), to_json(study.settings), to_json(study.alpha),
        tuple(specimens), tuple(alphas))


def line_profile(model: Model, state: State, line: str) -> tuple[NDArray[np.float64], Fields]:
    """Distances [m], shape (n,), and fields along a line of lines/NAME.csv.

    "x" and "y" run through the plate's centre from end to end; "plate" around it, by angle.
    """
    fields, _ = edge_fields(model, state, _BOUNDARIES[line])
    arm = fields.position - model.centre
    along = np.arctan2(arm[:, 1], arm[:, 0]) if line == "plate" else arm[:, "xy".index(line)]
    order = np.argsort(along, kind="stable")
    fields = fields[order]
    if line != "plate":
        return along[order], fields
    steps = np.linalg.norm(np.diff(fields.position, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)]), fields


def _solved(study: Study, specimen: Specimen, source: str, progress: Progress) -> SpecimenResult:
    progress(f"{specimen.name}: mesh and equilibrium")
    case = Case(specimen, mass=study.mass, voltage=study.voltage, rig=study.rig)
    model, outcome, result = solved(case, study.settings)
    if outcome.status != "equilibrium":
        raise InputError(f"has no picture at {study.mass * 1e3:g} g and {study.voltage / 1e3:g} "
                         f"kV: {result.warnings[0]}", key="specimens",
                         given=specimen.name)
    progress(f"{specimen.name}: fields")
    result = replace(result, film=film_surface(model, outcome.state))
    lines = _lines(model, outcome.state)
    progress(f"{specimen.name}: curves")
    return SpecimenResult(specimen.name, source, str(specimen.membrane.material),
                          specimen.frame.semi_axes, result, lines, _curves(study, specimen))


def _lines(model: Model, state: State) -> TableOfColumns:
    parts = []
    for line in _BOUNDARIES:
        distance, fields = line_profile(model, state, line)
        parts.append({**vars(fields), "line": np.full(len(distance), line), "distance": distance,
                      "deflection": fields.displacement[:, 2], "field": fields.electric_field})
    return {column.name: np.concatenate([part[column.name] for part in parts]) for column in LINES}


def _curves(study: Study, specimen: Specimen) -> TableOfColumns:
    model = build_model(specimen, study.settings, study.rig.loading)
    loads = study.curves
    results = [result for result, _ in solve_grid(model, loads.masses, loads.voltages, study.rig,
                                                  study.settings.path)]
    attributes = ("mass_kg", "voltage_V", "status", "deflection_m", "slack_share",
                  "breakdown_margin")
    return {column.name: np.array([getattr(result, name) for result in results],
                                  float if column.choices is None else str)
            for column, name in zip(CURVES, attributes, strict=True)}


def _loads(table: Table, key: str, default: LoadGrid) -> LoadGrid:
    if key not in table:
        table.asked.add(key)
        return default
    loads = read(LoadGrid, table.table(key))
    if list(loads.voltages) != sorted(loads.voltages):
        raise table.error(f"{key}.voltage", "must ascend", table.value(key)["voltage"])
    return loads
