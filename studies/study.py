"""The main job: specimens solved, their fields, lines and curves stored, and α of every shape that is no circle."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from tympan.fem.film.library import load_specimen
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import Fields, edge_fields, whole
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_reader import NON_NEGATIVE, POSITIVE, Table
from tympan.studies import files as store
from tympan.studies.alpha import AlphaResult, AlphaSettings, LoadGrid, alpha
from tympan.studies.case import (
    Case,
    CaseResult,
    Settings,
    build_model,
    equilibrate,
    solve_grid,
    summaries,
)
from tympan.studies.film_surface import film_surface
from tympan.studies.paper.actuators import FILES, actuators

Progress = Callable[[str], None]

_LINES = {"x": ("axis_x", 0), "y": ("axis_y", 1)}
_LINE_HEADER = ("line", "distance_mm", "deflection_mm", "stress_1_kPa", "stress_2_kPa",
                "stress_radial_kPa",
                "stress_circumferential_kPa", "stretch_1", "stretch_2", "thickness_um",
                "field_MV_per_m")


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


def default_study() -> Study:
    """The paper's three actuators under 17.9 g, as in its Fig. 4."""
    return Study("the paper's three actuators", actuators(),
                 tuple(file.read_text(encoding="utf-8") for file in FILES.values()))


def read_study(file: Path) -> Study:
    """A study from STUDY.toml: ``specimens`` (files beside it) and optionally name, mass, voltage, rig and loads."""
    table = Table.read(file)
    names = table.value("specimens")
    if not isinstance(names, list) or not names or not all(isinstance(name, str) for name in names):
        raise table.error("specimens", "must be a list of specimen files", names)
    paths = [file.parent / name for name in names]
    specimens = tuple(map(load_specimen, paths))
    repeated = {item.name for item in specimens
                if sum(other.name == item.name for other in specimens) > 1}
    if repeated:
        raise table.error("specimens", "must have different names", sorted(repeated))
    default = Study("", (), ())
    study = Study(
        table.text("name", file.stem), specimens,
        tuple(path.read_text(encoding="utf-8") for path in paths),
        mass=table.quantity("mass", "mass", "17.9 g", NON_NEGATIVE),
        voltage=table.quantity("voltage", "voltage", "0 kV", NON_NEGATIVE),
        rig=Rig.from_table(table.table("rig", {})),
        curves=_loads(table, "curves", default.curves),
        alpha=AlphaSettings(_loads(table, "alpha_fit", default.alpha.fit),
                            _loads(table, "alpha_held_out", default.alpha.held_out)),
    )
    table.done()
    return study


def run(study: Study, folder: Path, progress: Progress = lambda _: None) -> None:
    """Run a study and store everything a report needs under ``folder``.

    ``fields/NAME.vtu``, ``lines/NAME.csv``, ``curves/NAME.csv``, ``alpha.json`` and ``study.json``;
    the last one is written last, so its presence means the rest is complete.
    """
    store.remove(folder, "study.json", "alpha.json", "report.html", *(
        f"{stem}.{suffix}" for stem in ("fig4", "curves") for suffix in ("png", "pdf", "svg")))
    results = [_one(study, specimen, folder, progress) for specimen in study.specimens]
    weights = []
    for specimen in study.specimens:
        progress(f"{specimen.name}: α")
        weights.append(alpha(specimen, study.settings, study.alpha, study.rig))
    store.write_json(folder / "alpha.json", [alpha_record(item) for item in weights])
    record = {
        "name": study.name,
        "version": metadata.version("tympan"),
        "libraries": {name: metadata.version(name) for name in
                      ("cadquery", "gmsh", "meshio", "numpy", "pyvista", "scikit-fem", "scipy",
                       "vtk")},
        "python": platform.python_version(),
        "finished": time.strftime("%Y-%m-%d %H:%M:%S %z"),
        "mass_kg": study.mass,
        "voltage_V": study.voltage,
        "rig": _plain(study.rig.record()),
        "settings": _plain(asdict(study.settings)),
        "alpha_settings": _plain(asdict(study.alpha)),
        "specimens": [
            {"name": specimen.name, "source": source, "material": str(specimen.membrane.material),
             "semi_axes_m": list(specimen.frame.semi_axes), "result": result.json()}
            for specimen, source, result in zip(study.specimens, study.sources, results,
                                                strict=True)],
    }
    store.write_json(folder / "study.json", record)


def steps(study: Study) -> int:
    """How many times :func:`run` reports progress."""
    return 4 * len(study.specimens)


def alpha_record(result: AlphaResult) -> dict[str, Any]:
    """All bases of one specimen's α, as stored."""
    record = result.json()
    record["bases"] = {name: asdict(weights) for name, weights in result.by_basis.items()}
    return record


def plate_profile(model: Model, state: State) -> Fields:
    """Fields around the plate's edge, ordered by angle around its centre."""
    full, unfolded = whole(model, state)
    fields = edge_fields(full, unfolded, "plate").fields
    arm = fields.position - full.centre
    return fields[np.argsort(np.arctan2(arm[:, 1], arm[:, 0]), kind="stable")]


def axis_profile(model: Model, state: State, axis: str) -> Fields:
    """Fields along the axis "x" or "y" through the plate's centre, from end to end."""
    full, unfolded = whole(model, state)
    boundary, coordinate = _LINES[axis]
    fields = edge_fields(full, unfolded, boundary).fields
    return fields[np.argsort(fields.position[:, coordinate], kind="stable")]


def _one(study: Study, specimen: Specimen, folder: Path, progress: Progress) -> CaseResult:
    """Solve one specimen for the picture and along the curves, and store both."""
    progress(f"{specimen.name}: mesh and equilibrium")
    began = time.perf_counter()
    case = Case(specimen, mass=study.mass, voltage=study.voltage, rig=study.rig)
    model, outcome = equilibrate(case, study.settings)
    (result, _), = summaries(model, [(case, outcome)])
    result = replace(result, wall_s=time.perf_counter() - began)
    if outcome.status != "equilibrium":
        raise InputError(f"has no picture at {study.mass * 1e3:g} g and {study.voltage / 1e3:g} kV: "
                         f"{result.warnings[0]}", key="specimens", given=specimen.name)
    progress(f"{specimen.name}: fields")
    film_surface(model, outcome.state).save(folder / "fields" / f"{specimen.name}.vtu")
    store.write_csv(folder / "lines" / f"{specimen.name}.csv", _LINE_HEADER,
                    _line_rows(model, outcome.state))
    progress(f"{specimen.name}: curves")
    store.write_csv(folder / "curves" / f"{specimen.name}.csv",
                    ("mass_g", "voltage_kV", "status", "deflection_mm", "slack_share",
                     "breakdown_margin"),
                    _curve_rows(study, specimen))
    return result


def _line_rows(model: Model, state: State) -> Iterator[tuple[object, ...]]:
    """Rows of lines/NAME.csv: signed distance from the plate's centre along x and y, angle times radius around it."""
    for axis, (_, coordinate) in _LINES.items():
        fields = axis_profile(model, state, axis)
        yield from _rows(axis, (fields.position - model.centre)[:, coordinate], fields)
    fields = plate_profile(model, state)
    steps = np.linalg.norm(np.diff(fields.position, axis=0), axis=1)
    yield from _rows("plate", np.concatenate([[0.0], np.cumsum(steps)]), fields)


def _rows(line: str, distance: np.ndarray, fields: Fields) -> Iterator[tuple[object, ...]]:
    columns = (distance * 1e3, fields.displacement[:, 2] * 1e3, fields.stress_1 / 1e3,
               fields.stress_2 / 1e3,
               fields.stress_radial / 1e3, fields.stress_circumferential / 1e3, fields.stretch_1,
               fields.stretch_2,
               fields.thickness * 1e6, fields.electric_field / 1e6)
    for row in zip(*(column.tolist() for column in columns), strict=True):
        yield (line, *row)


def _curve_rows(study: Study, specimen: Specimen) -> Iterator[tuple[object, ...]]:
    model = build_model(specimen, study.settings, study.rig.loading)
    for result, _ in solve_grid(model, study.curves.masses, study.curves.voltages, study.rig,
                                study.settings.path):
        deflection = "" if result.deflection_m is None else result.deflection_m * 1e3
        margin = "" if result.breakdown_margin is None else result.breakdown_margin
        slack = "" if result.slack_share is None else result.slack_share
        yield result.mass_kg * 1e3, result.voltage_V / 1e3, result.status, deflection, slack, margin


def _loads(table: Table, key: str, default: LoadGrid) -> LoadGrid:
    """A sub-table with ``mass`` and ``voltage`` lists."""
    if key not in table:
        table.asked.add(key)
        return default
    loads = table.table(key)
    masses = loads.quantities("mass", "mass", rule=POSITIVE)
    voltages = loads.quantities("voltage", "voltage", rule=NON_NEGATIVE)
    if list(voltages) != sorted(voltages):
        raise loads.error("voltage", "must ascend", loads.value("voltage"))
    loads.done()
    return LoadGrid(masses, voltages)


def _plain(value: Any) -> Any:
    """Tuples as lists and infinities as text, for JSON."""
    return json.loads(json.dumps(value, default=str).replace("Infinity", '"inf"'))
