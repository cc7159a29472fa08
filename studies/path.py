"""One specimen's branch of equilibria: through pull-in, and what the film loses on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tympan.fem.equilibrium.arc_length import Branch, PathPoint
from tympan.fem.equilibrium.newton import moved
from tympan.fem.equilibrium.ramp import PathSettings, follow_branch
from tympan.fem.film.tension_field import Tension
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load
from tympan.fem.results.fields import whole
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import area
from tympan.studies.case import Case, Settings, equilibrate, failure_reason, node_fields
from tympan.studies.files import (
    from_json,
    read_json,
    remove,
    stored_file,
    to_json,
    write_csv,
    write_json,
)
from tympan.studies.film_surface import FilmSurface, film_surface

#: What may grow along a branch, the load that does, and its unit in results.
Along = Literal["voltage", "charge", "mass", "pressure"]
What = Literal["limit", "tension lost", "breakdown"]
LOADS: dict[Along, Load] = {"voltage": "voltage", "charge": "voltage", "mass": "force",
                            "pressure": "pressure"}
_READ = {"V": (1e-3, "kV"), "C": (1e6, "µC"), "kg": (1e3, "g"), "Pa": (1.0, "Pa")}
UNITS: dict[Along, str] = {"voltage": "V", "charge": "C", "mass": "kg", "pressure": "Pa"}


@dataclass(frozen=True, kw_only=True)
class Station:
    """One equilibrium of a branch, in SI.

    ``stable``: at constant load, voltage and gas pressure, the film kept from wrinkling; ``tense``:
    no part of the film has lost tension; ``breakdown_share``: largest field over strength, 0 where
    the strength is unknown; ``unbalanced``: largest nodal force that smooth motions leave, relative
    to the largest nodal force.
    """

    deflection_m: float
    force_N: float
    voltage_V: float
    pressure_Pa: float
    charge_C: float
    capacitance_F: float
    max_stretch: float
    breakdown_share: float
    stable: bool
    tense: bool
    unbalanced: float


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happens at one point of a branch; ``value`` of what grows along it."""

    what: What
    value: float
    unit: str
    station: Station

    @property
    def value_text(self) -> str:
        """The value in the unit a person reads."""
        factor, unit = _READ[self.unit]
        return f"{factor * self.value:.5g} {unit}"


@dataclass(frozen=True, kw_only=True)
class PathResult:
    """A path: its stations in order, and where it turns, tension is lost or the film breaks down.

    ``limits``: the film at each limit point, with a field ``critical_mode``.
    """

    specimen: str
    mass_kg: float
    voltage_V: float
    along: Along
    unit: str
    stations: tuple[Station, ...]
    events: tuple[Event, ...]
    dofs: int
    wall_s: float
    warnings: tuple[str, ...]
    limits: tuple[FilmSurface, ...] = field(default=(), repr=False, compare=False)

    def json(self) -> dict[str, Any]:
        """As a JSON object; without the films."""
        record: dict[str, Any] = to_json(self)
        return record

    def save(self, folder: Path) -> None:
        """Write ``NAME-path.csv``, ``.json``, and each limit point's film as ``-limit-N.vtu``."""
        name = f"{self.specimen}-path"
        remove(folder, *(f"{name}.{kind}" for kind in ("csv", "json", "png", "svg")))
        remove(folder, *(file.name for file in folder.glob(f"{name}-limit-*.vtu")))
        for number, film in enumerate(self.limits, start=1):
            film.save(folder / f"{name}-limit-{number}.vtu")
        columns = [item.name for item in fields(Station)]
        write_csv(folder / f"{name}.csv", columns,
                  ([getattr(station, column) for column in columns] for station in self.stations))
        write_json(folder / f"{name}.json", self.json())

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> PathResult:
        """What was saved, of the specimen of a ``name`` or of the only one.

        Raises
        ------
        InputError
            When a file is missing, damaged or of another kind.
        """
        file = stored_file(folder, "*-path.json", name, "tympan path -o")
        result = from_json(cls, read_json(file), file)
        films = sorted(folder.glob(f"{file.stem}-limit-*.vtu"),
                       key=lambda limit: int(limit.stem.rpartition("-")[2]))
        return replace(result, limits=tuple(map(FilmSurface.load, films)))


@dataclass(frozen=True)
class Reach:
    """Where a branch ends, whichever comes first.

    ``deflection``: relative to the frame's half extent; ``stretch``: largest; ``unbalanced``:
    largest nodal force left, relative to the largest there is, beyond which the mesh does not
    resolve the branch; ``step``: longest, relative to the frame's half extent.
    """

    deflection: float = 1.0
    stretch: float = 6.0
    unbalanced: float = PathSettings.unbalanced
    step: float = 0.015


def path(case: Case, settings: Settings, along: Along, reach: Reach = Reach(),
         progress: Callable[[str], None] = lambda words: None) -> PathResult:
    """Follow the equilibria of a case while one quantity grows, and through its limit points.

    The case's mass and voltage are where the path starts.

    Raises
    ------
    InputError
        When the case itself has no equilibrium.
    """
    began = time.perf_counter()
    model, start = equilibrate(case, settings)
    if start.status != "equilibrium":
        raise InputError(f"must be where the branch can start: {failure_reason(start)}",
                         key="--mass, --voltage",
                         given=f"{case.mass * 1e3:g} g and {case.voltage / 1e3:g} kV")
    stations: list[Station] = []
    events: list[Event] = []
    limits: list[FilmSurface] = []
    previous: PathPoint | None = None
    warnings = ["the branch could not be followed further"]
    stepping = replace(settings.path, arc=replace(settings.path.arc, longest=reach.step))
    for branch, point in follow_branch(model, start.state, LOADS[along], stepping):
        stations.append(_station(model, point))
        progress(f"{stations[-1].deflection_m * 1e3:.2f} mm")
        if previous is not None:
            passed = list(_events(case, branch, previous, point, along, limits))
            # Curves should pass through what happens between two points.
            stations[-1:] = [*_in_order(passed, previous), stations[-1]]
            events += passed
        previous = point
        ended = _ended(model, stations[-1], reach, point, along)
        if ended:
            warnings = [ended]
            break
    return PathResult(
        specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage, along=along,
        unit=UNITS[along], stations=tuple(stations), events=tuple(events), dofs=model.unknowns,
        wall_s=time.perf_counter() - began, warnings=tuple(warnings), limits=tuple(limits))


def _in_order(events: list[Event], previous: PathPoint) -> list[Station]:
    start = previous.state.plate.deflection
    return sorted((event.station for event in events),
                  key=lambda station: abs(station.deflection_m - start))


def _ended(model: Model, station: Station, reach: Reach, point: PathPoint, along: Along) -> str:
    """Why a branch ends at a station, or nothing."""
    if station.deflection_m > reach.deflection * model.size:
        return f"followed to a deflection of {station.deflection_m * 1e3:.3g} mm"
    if station.max_stretch > reach.stretch:
        return f"followed to a stretch of {station.max_stretch:.3g}"
    if point.rate < 0 and point.state.load(LOADS[along]) < 0:
        return f"followed until the {along} fell back to zero"
    if station.unbalanced > reach.unbalanced:
        return (f"followed to a deflection of {station.deflection_m * 1e3:.4g} mm: beyond, the "
                "mesh does not resolve the branch; --refine may")
    return ""


def _station(model: Model, point: PathPoint) -> Station:
    state = point.state
    fields = node_fields(model, state)
    tangent = point.solution.tangent
    assert tangent is not None
    voltage = float(np.sqrt(max(state.voltage_squared, 0.0)))
    capacitance = model.capacitance(state)
    return Station(
        deflection_m=state.plate.deflection, force_N=state.force, voltage_V=voltage,
        pressure_Pa=state.pressure, charge_C=capacitance * voltage, capacitance_F=capacitance,
        max_stretch=float(fields.stretch_1.max()),
        breakdown_share=float(fields.breakdown_share.max()), stable=tangent.negative == 0,
        tense=bool((fields.tension == Tension.TAUT).all()),
        unbalanced=model.unbalanced(state))


def _events(case: Case, branch: Branch, before: PathPoint, after: PathPoint, along: Along,
            limits: list[FilmSurface]) -> Iterator[Event]:
    """What happens between two points; films at limit points are appended to ``limits``."""
    for what, value in _watched(branch.model, along).items():
        if value(before) * value(after) >= 0:
            continue
        point = branch.where(before, after, value)
        if point is None:
            continue
        station = _station(branch.model, point)
        if what == "limit":
            # The path's direction there is the critical mode.
            mode = moved(branch.model, point.state, point.direction[:2])
            change = replace(point.state, positions=mode.positions - point.state.positions)
            limits.append(film_surface(branch.model, point.state,
                                       critical_mode=whole(branch.model, change)[1].positions))
        yield Event(what=what, value=measured(case, station, along), unit=UNITS[along],
                    station=station)


def _watched(model: Model, along: Along) -> dict[What, Callable[[PathPoint], float]]:
    """Functions of a point that change sign where something happens."""
    def rate(point: PathPoint) -> float:
        return _charge_rate(model, point) if along == "charge" else point.rate

    def tension(point: PathPoint) -> float:
        return float(node_fields(model, point.state).stress_2.min())

    def strength(point: PathPoint) -> float:
        return 1 - float(node_fields(model, point.state).breakdown_share.max())

    return {"limit": rate, "tension lost": tension, "breakdown": strength}


def measured(case: Case, station: Station, along: Along) -> float:
    """What grows along the branch, at a station.

    The nominal mass, but the voltage the film itself sees.
    """
    if along == "mass":
        idle = case.rig.force(0.0, area(case.specimen.plate.outline))
        return float((station.force_N - idle) / case.rig.gravity)
    return {"voltage": station.voltage_V, "charge": station.charge_C,
            "pressure": station.pressure_Pa}[along]


def _charge_rate(model: Model, point: PathPoint) -> float:
    """d(C U)/ds along the branch."""
    voltage = max(float(np.sqrt(max(point.state.voltage_squared, 0.0))), 1e-3)
    inner, plate = model.by_load(point.state, "voltage")
    work = float(inner @ point.direction[0] + plate @ point.direction[1])
    growth = -2 * model.discretisation.mirrored * work
    charging = model.capacitance(point.state) * point.rate / (2 * voltage)
    return float(growth * voltage + charging)
