"""One specimen's branch of equilibria: through pull-in, along its unstable part, and what the film loses on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tympan.fem.equilibrium.arc_length import Branch, Point
from tympan.fem.equilibrium.newton import moved
from tympan.fem.equilibrium.ramp import Outcome, PathSettings, branch_points, equilibrium
from tympan.fem.film.tension_state import Tension
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load
from tympan.fem.results.fields import whole
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import area
from tympan.studies.case import Case, Settings, build_model, node_fields, why
from tympan.studies.files import remove, write_csv, write_fields, write_json

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
class BranchResult:
    """A branch: its stations in order, its limit points and where tension is lost or the film breaks down."""

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

    def json(self) -> dict[str, Any]:
        """As a JSON object."""
        return asdict(self)


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


def branch(case: Case, settings: Settings, along: Along, reach: Reach = Reach(),
           progress: Callable[[str], None] = lambda words: None) -> tuple[BranchResult,
                                                                          list[tuple[Model,
                                                                                     Point]]]:
    """Follow the equilibria of a case while one quantity grows, and through its limit points.

    The case's mass and voltage are where the branch starts. Also answers the limit points, whose
    direction is the critical mode.

    Raises
    ------
    InputError
        When the case itself has no equilibrium.
    """
    began = time.perf_counter()
    model = build_model(case.specimen, settings, case.rig.loading)
    start = _start(case, model, settings)
    stations: list[Station] = []
    events: list[Event] = []
    limits: list[tuple[Model, Point]] = []
    previous: Point | None = None
    warnings = ["the branch could not be followed further"]
    path = replace(settings.path, arc=replace(settings.path.arc, longest=reach.step))
    for on, point in branch_points(model, start.state, LOADS[along], path):
        stations.append(_station(model, point))
        progress(f"{stations[-1].deflection_m * 1e3:.2f} mm")
        if previous is not None:
            found = list(_events(case, on, previous, point, along, limits))
            # Curves should pass through what happens between two points.
            start_of_step = previous.state.plate.heave
            passed = sorted((event.station for event in found),
                            key=lambda s: abs(s.deflection_m - start_of_step))
            stations[-1:] = [*passed, stations[-1]]
            events += found
        previous = point
        ended = _ended(model, stations[-1], reach, point, along)
        if ended:
            warnings = [ended]
            break
    return BranchResult(
        specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage, along=along,
        unit=UNITS[along],
        stations=tuple(stations), events=tuple(events), dofs=model.unknowns,
        wall_s=time.perf_counter() - began,
        warnings=tuple(warnings)), limits


def _start(case: Case, model: Model, settings: Settings) -> Outcome:
    rig = case.rig
    start = equilibrium(model, rig.force(case.mass, model.plate_area), case.film_voltage,
                        rig.gas_pressure, settings=settings.path)
    if start.status != "equilibrium":
        raise InputError(f"must be where the branch can start: {why(start)}",
                         key="--mass, --voltage",
                         given=f"{case.mass * 1e3:g} g and {case.voltage / 1e3:g} kV")
    return start


def _ended(model: Model, station: Station, reach: Reach, point: Point, along: Along) -> str:
    """Why a branch ends at a station, or nothing."""
    if station.deflection_m > reach.deflection * model.size:
        return f"followed to a deflection of {station.deflection_m * 1e3:.3g} mm"
    if station.max_stretch > reach.stretch:
        return f"followed to a stretch of {station.max_stretch:.3g}"
    if point.rate < 0 and point.state.load(LOADS[along]) < 0:
        return f"followed until the {along} fell back to zero"
    if station.unbalanced > reach.unbalanced:
        return (f"followed to a deflection of {station.deflection_m * 1e3:.4g} mm: beyond, the mesh does not resolve "
                "the branch; --refine may")
    return ""


def _station(model: Model, point: Point) -> Station:
    state = point.state
    found = node_fields(model, state)
    tangent = point.solution.tangent
    assert tangent is not None
    voltage = float(np.sqrt(max(state.voltage_squared, 0.0)))
    capacitance = model.capacitance(state)
    return Station(
        deflection_m=state.plate.heave, force_N=state.force, voltage_V=voltage,
        pressure_Pa=state.pressure,
        charge_C=capacitance * voltage, capacitance_F=capacitance,
        max_stretch=float(found.stretch_1.max()),
        breakdown_share=float(found.breakdown_share.max()), stable=tangent.negative == 0,
        tense=bool((found.tension == Tension.TAUT).all()),
        unbalanced=model.unbalanced(state))


def _events(case: Case, on: Branch, before: Point, after: Point, along: Along,
            limits: list[tuple[Model, Point]]) -> Iterator[Event]:
    """What happens between two points; limit points are also appended to ``limits``."""
    for what, value in _watched(on.model, along).items():
        if value(before) * value(after) >= 0:
            continue
        found = on.where(before, after, value)
        if found is None:
            continue
        at = _station(on.model, found)
        if what == "limit":
            limits.append((on.model, found))
        yield Event(what=what, value=measured(case, at, along), unit=UNITS[along], station=at)


def _watched(model: Model, along: Along) -> dict[What, Callable[[Point], float]]:
    """Functions of a point that change sign where something happens."""
    def rate(point: Point) -> float:
        return _charge_rate(model, point) if along == "charge" else point.rate

    def tension(point: Point) -> float:
        return float(node_fields(model, point.state).stress_2.min())

    def strength(point: Point) -> float:
        return 1 - float(node_fields(model, point.state).breakdown_share.max())

    return {"limit": rate, "tension lost": tension, "breakdown": strength}


def measured(case: Case, station: Station, along: Along) -> float:
    """What grows along the branch, at a station: the nominal mass, but the voltage the film itself sees."""
    if along == "mass":
        return (station.force_N
                - case.rig.force(0.0, area(case.specimen.plate.outline))) / case.rig.gravity
    return {"voltage": station.voltage_V, "charge": station.charge_C,
            "pressure": station.pressure_Pa}[along]


def _charge_rate(model: Model, point: Point) -> float:
    """d(C U)/ds along the branch."""
    voltage = max(float(np.sqrt(max(point.state.voltage_squared, 0.0))), 1e-3)
    inner, plate = model.by_load(point.state, "voltage")
    growth = -2 * model.discretisation.mirrored * float(inner @ point.direction[0] + plate @ point.direction[1])
    return growth * voltage + model.capacitance(point.state) * point.rate / (2 * voltage)


def store(folder: Path, result: BranchResult, limits: list[tuple[Model, Point]]) -> None:
    """Write the stations as CSV, the numbers as JSON, and at each limit point fields and critical mode as VTU."""
    name = f"{result.specimen}-path"
    remove(folder, *(f"{name}.{kind}" for kind in ("csv", "json", "png", "svg")))
    for number, (model, point) in enumerate(limits, start=1):
        full, state = whole(model, point.state)
        mode = moved(model, point.state,
                     (point.direction[0], point.direction[1])).positions - point.state.positions
        shape = whole(model, replace(point.state, positions=mode))[1].positions
        write_fields(folder / f"{name}-limit-{number}.vtu", full, state, critical_mode=shape)
    columns = [item.name for item in fields(Station)]
    write_csv(folder / f"{name}.csv", columns,
              ([getattr(s, c) for c in columns] for s in result.stations))
    write_json(folder / f"{name}.json", result.json())
