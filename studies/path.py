"""One specimen's branch of equilibria: through pull-in, and what the film loses on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Literal, Self

import numpy as np

from tympan.fem.equilibrium.arc_length import Branch, PathPoint
from tympan.fem.equilibrium.newton import moved
from tympan.fem.equilibrium.ramp import follow_branch
from tympan.fem.film.tension_field import Tension
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import Load
from tympan.fem.results.fields import whole
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import area
from tympan.studies.case import Case, CaseRecord, Settings, equilibrate, failure_reason, node_fields
from tympan.studies.files import remove, write_csv
from tympan.studies.film_surface import FilmSurface, film_surface

#: Longest step along a branch, relative to the frame's half extent; largest stretch at its end.
_STEP, _STRETCH = 0.015, 6.0

#: What may grow along a branch.
Along = Literal["voltage", "charge", "mass", "pressure"]
What = Literal["limit", "tension lost", "breakdown"]

#: The load that grows, and the unit in results.
_GROWING: dict[Along, tuple[Load, str]] = {
    "voltage": ("voltage", "V"), "charge": ("voltage", "C"), "mass": ("force", "kg"),
    "pressure": ("pressure", "Pa")}
#: Of a unit in results, what a person reads and how many of it there are.
_READ = {"V": (1e-3, "kV"), "C": (1e6, "µC"), "kg": (1e3, "g"), "Pa": (1.0, "Pa")}


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
class PathResult(CaseRecord):
    """A path: its stations in order, and where it turns, tension is lost or the film breaks down.

    Mass and voltage are those it starts at. ``limits``: the film at each limit point, with a field
    ``critical_mode``.
    """

    ending = "-path"
    writer = "tympan path -o"
    kinds = ("csv", "json", "png", "svg")

    along: Along
    unit: str
    stations: tuple[Station, ...]
    events: tuple[Event, ...]
    dofs: int
    wall_s: float
    warnings: tuple[str, ...]
    limits: tuple[FilmSurface, ...] = field(default=(), repr=False, compare=False)

    def save(self, folder: Path) -> None:
        """Write ``NAME-path.csv``, ``.json``, and each limit point's film as ``-limit-N.vtu``."""
        name = f"{self.specimen}-path"
        remove(folder, *(file.name for file in folder.glob(f"{name}-limit-*.vtu")))
        super().save(folder)
        for number, film in enumerate(self.limits, start=1):
            film.save(folder / f"{name}-limit-{number}.vtu")
        columns = [item.name for item in fields(Station)]
        write_csv(folder / f"{name}.csv", columns,
                  ([getattr(station, column) for column in columns] for station in self.stations))

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> Self:
        result = super().load(folder, name)
        films = sorted(folder.glob(f"{result.specimen}-path-limit-*.vtu"),
                       key=lambda limit: int(limit.stem.rpartition("-")[2]))
        return replace(result, limits=tuple(map(FilmSurface.load, films)))


def path(case: Case, settings: Settings, along: Along,
         progress: Callable[[str], None] = lambda words: None) -> PathResult:
    """Follow the equilibria of a case while one quantity grows, and through its limit points.

    The case's mass and voltage are where the path starts; InputError if there is no equilibrium.
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
    ended = "the branch could not be followed further"
    load, unit = _GROWING[along]
    stepping = replace(settings.path, arc=replace(settings.path.arc, longest=_STEP))
    for branch, point in follow_branch(model, start.state, load, stepping):
        station = _station(model, point)
        progress(f"{station.deflection_m * 1e3:.2f} mm")
        if previous is not None:
            passed = list(_events(case, branch, previous, point, along, limits))
            events += passed
            # Curves should pass through what happens between two points.
            before = previous.state.plate.deflection
            stations += sorted((event.station for event in passed),
                               key=lambda passing: abs(passing.deflection_m - before))
        stations.append(station)
        previous = point
        if station.deflection_m > model.size:
            ended = f"followed to a deflection of {station.deflection_m * 1e3:.3g} mm"
        elif station.max_stretch > _STRETCH:
            ended = f"followed to a stretch of {station.max_stretch:.3g}"
        elif point.rate < 0 and point.state.load(load) < 0:
            ended = f"followed until the {along} fell back to zero"
        elif station.unbalanced > settings.path.unbalanced:
            ended = (f"followed to a deflection of {station.deflection_m * 1e3:.4g} mm: beyond, "
                     "the mesh does not resolve the branch; --refine may")
        else:
            continue
        break
    return PathResult(
        specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage, along=along,
        unit=unit, stations=tuple(stations), events=tuple(events), dofs=model.unknowns,
        wall_s=time.perf_counter() - began, warnings=(ended,), limits=tuple(limits))


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
            mode = moved(branch.model, point.state, point.direction)
            change = replace(point.state, positions=mode.positions - point.state.positions)
            limits.append(film_surface(branch.model, point.state,
                                       critical_mode=whole(branch.model, change)[1].positions))
        yield Event(what=what, value=_measured(case, station, along), unit=_GROWING[along][1],
                    station=station)


def _watched(model: Model, along: Along) -> dict[What, Callable[[PathPoint], float]]:
    def rate(point: PathPoint) -> float:
        if along != "charge":
            return point.rate
        voltage = max(float(np.sqrt(max(point.state.voltage_squared, 0.0))), 1e-3)
        inner, plate = model.by_load(point.state, "voltage")
        work = float(inner @ point.direction[0] + plate @ point.direction[1])
        growth = -2 * model.discretisation.mirrored * work
        charging = model.capacitance(point.state) * point.rate / (2 * voltage)
        return float(growth * voltage + charging)  # d(C U)/ds along the branch

    def tension(point: PathPoint) -> float:
        return float(node_fields(model, point.state).stress_2.min())

    def strength(point: PathPoint) -> float:
        return 1 - float(node_fields(model, point.state).breakdown_share.max())

    return {"limit": rate, "tension lost": tension, "breakdown": strength}


def _measured(case: Case, station: Station, along: Along) -> float:
    """What grows along the branch: the nominal mass, but the voltage the film itself sees."""
    if along == "mass":
        idle = case.rig.force(0.0, area(case.specimen.plate.outline))
        return float((station.force_N - idle) / case.rig.gravity)
    return {"voltage": station.voltage_V, "charge": station.charge_C,
            "pressure": station.pressure_Pa}[along]
