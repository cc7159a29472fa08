"""Branch of equilibria of one specimen, beyond pull-in, with the film's limits on the way."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.base.progress import Progress
from tympan.base.units import BENCH, suffix_of
from tympan.fem.equilibrium.arc_length import Branch
from tympan.fem.equilibrium.arc_segment import PathPoint
from tympan.fem.equilibrium.newton import Solution, moved, newton
from tympan.fem.equilibrium.path_following import PathSettings, follow_branch
from tympan.fem.equilibrium.ramp import Outcome, without_mechanism
from tympan.fem.equilibrium.snap import snapped
from tympan.fem.film.tension_field import Tension
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, Load, State
from tympan.fem.results.fields import whole
from tympan.fem.results.limit_states import (
    INSTABILITY,
    LIMIT_STATES,
    PULL_IN,
    SNAP_BACK,
    SNAP_THROUGH,
    LimitState,
    Sign,
    passed,
)
from tympan.studies.case import (
    OF_LIMITS,
    Case,
    CaseRecord,
    Limit,
    Settings,
    UnknownCount,
    WallTime,
    Warnings,
    deflection_without_voltage,
    equilibrate,
    failure_reason,
)
from tympan.studies.files import remove, write_csv
from tympan.studies.film_surface import (
    NO_SURFACE,
    FilmSurface,
    film_surface,
    save_series,
    series_files,
)
from tympan.studies.rows import cells_of, rows_of
from tympan.studies.segments import OfSegments, segments_of
from tympan.studies.variables import ShowsState, StateValues, rows_of_variables
from tympan.studies.walk.film_point import ChargedPoint, FilmPoint
from tympan.studies.walk.flat_film import above_words, at_point, flat_limits
from tympan.studies.walk.spread import Passage, spread

#: Longest step along a branch, relative to the frame's half extent, for a smooth curve.
SMOOTH = 0.015
#: First step, relative to the longest one, if that is longer than the usual first one.
_BEGUN = 0.2
#: Largest stretch at a branch's end, beyond the range of most laws. Set by trial.
_STRETCH = 6.0

#: Electric field at a branch's end, over the film's strength. Strengths of one material differ by
#: a factor of two between sources; no film is known to bear three times the one that it states.
_WITHSTOOD = 3.0

#: Deflection, stretch and field at a branch's end, relative to its start, if they are large there
#: already.
_FURTHER = 2.0

UNFOLLOWED = "the branch could not be followed further"
#: Distance ahead of a branch's end, relative to the frame, within which the end of a mechanism is
#: named as the reason. A step is hardly longer.
_AHEAD = 0.05
_THINS = "followed until the film, wrinkled, thins without bound"
_ENDS = f"{_THINS}; \"beyond\" follows it on as one kept from wrinkling"

#: Distance of two points along a branch, relative to the frame, below which they count as one.
_SAME = 1e-6

#: Quantity that may grow along a branch.
Along = Literal["voltage", "charge", "mass", "pressure"]
#: Limit states that are limit points.
_LIMIT_POINTS = {PULL_IN.kind, SNAP_THROUGH.kind, SNAP_BACK.kind}

#: Load that grows, and its unit in results.
_GROWING: dict[Along, tuple[Load, str]] = {
    "voltage": ("voltage", "V"), "charge": ("voltage", "C"), "mass": ("force", "kg"),
    "pressure": ("pressure", "Pa")}
#: Unit for people and its number in one SI unit. Gas pressures are in pascals, stresses are not.
_READ = BENCH | {"C": ("µC", 1e6), "Pa": ("Pa", 1.0)}


@dataclass(frozen=True, kw_only=True)
class Station(ShowsState):
    """One equilibrium of a branch, in SI.

    Each of the :data:`~tympan.studies.variables.VARIABLES` of the state is an attribute by its key,
    such as ``deflection_m``.
    """

    values: StateValues = field(default_factory=dict)
    segments: OfSegments = ()
    force_N: Annotated[float, Key("force of the nominal load on the plate")]
    voltage_V: Annotated[float, Key("voltage across the film")]
    pressure_Pa: Annotated[float, Key("pressure of the gas below the film; positive lifts it")]
    charge_C: Annotated[float, Key("charge on the film")]
    stable: Annotated[bool, Key("whether it is stable at constant load, voltage and gas pressure, "
                                "the film kept from wrinkling, and not beyond its own instability")]
    tense: Annotated[bool, Key("whether no part of the film has lost tension")]
    unbalanced: Annotated[float, Key("largest nodal force that smooth motions leave, relative to "
                                     "the largest nodal force")]


@dataclass(frozen=True, kw_only=True)
class Happening:
    """Limit at one point of a branch, and its place in the film."""

    what: Annotated[str, Key("what happens there, a kind of limit"), OF_LIMITS]
    value: Annotated[float, Key("value of what grows along the path")]
    unit: Annotated[str, Key("unit of the value")]
    x_m: Annotated[float, Key("where in the mounted film: at a limit, where the film thins "
                              "fastest")]
    y_m: Annotated[float, Key("y of the same place")]
    segment: Annotated[str | None, Key(
        "segment of the electrode in which it begins, or the nearest ones, after commas; none of "
        "an electrode in one piece")] = None
    spread: Annotated[float, Key("how far the value may be off for the mesh, relative, by the "
                                 "jumps of what is watched between elements")]


@dataclass(frozen=True, kw_only=True)
class Event(Happening):
    """Event at one point of a branch."""

    station: Annotated[Station, Key("the equilibrium there")]

    @property
    def label(self) -> str:
        """Label of the limit."""
        return str(LIMIT_STATES[self.what].label)

    @property
    def value_text(self) -> str:
        """Value in the unit for people."""
        unit, factor = _READ[self.unit]
        return f"{factor * self.value:.5g} {unit}"


@dataclass(frozen=True, kw_only=True)
class PathResult(CaseRecord):
    """A path: its stations in order, and where the film reaches its limits.

    Mass and voltage are those at the start. ``limits``: the film at each limit point, with a field
    ``critical_mode``. ``films``: the film at each station, if requested.
    """

    ending = "-path"
    writer = "tympan path -o"
    kinds = ("csv", "json")
    drawn = ("png", "svg")

    along: Annotated[Along, Key("what grows")]
    unit: Annotated[str, Key("unit of what grows")]
    stations: Annotated[tuple[Station, ...], Key("the equilibria in order")]
    events: Annotated[tuple[Event, ...], Key("where a limit of the film is passed")]
    dofs: UnknownCount
    wall_s: WallTime
    warnings: Warnings
    limits: tuple[FilmSurface, ...] = field(default=(), repr=False, compare=False)
    films: tuple[FilmSurface, ...] = field(default=(), repr=False, compare=False)

    @property
    def key_numbers(self) -> dict[str, Any]:
        """Quantity that grows, with its value at each limit that is passed."""
        return {"along": self.along} | {
            event.what + suffix_of(event.unit): event.value for event in self.events}

    @property
    def rows(self) -> dict[str, Array]:
        """Table with a row for each station."""
        return rows_of(self.stations)

    def save(self, folder: Path) -> None:
        """Write ``NAME-path.csv``, ``.json``, and each limit point's film as ``-limit-N.vtu``.

        Films of the stations are written as a VTK series ``NAME-path.pvd``, whose times are the
        CSV's rows from 0.
        """
        name = f"{self.specimen}-path"
        remove(folder, *(file.name for file in folder.glob(f"{name}-limit-*.vtu")))
        super().save(folder)
        for number, film in enumerate(self.limits, start=1):
            film.save(folder / f"{name}-limit-{number}.vtu")
        save_series(folder, name, list(enumerate(self.films)))
        rows = [cells_of(station) for station in self.stations]
        write_csv(folder / f"{name}.csv", rows[0] if rows else (), (row.values() for row in rows))

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> Self:
        result = super().load(folder, name)
        films = sorted(folder.glob(f"{result.specimen}-path-limit-*.vtu"),
                       key=lambda limit: int(limit.stem.rpartition("-")[2]))
        stations = series_files(folder, f"{result.specimen}-path")
        return replace(result, limits=tuple(map(FilmSurface.load, films)),
                       films=tuple(map(FilmSurface.load, stations)))


def path(case: Case, settings: Settings, along: Along,
         progress: Progress = lambda words: None, films: bool = False,
         beyond: bool = False) -> PathResult:
    """Follow the equilibria of a case while one quantity grows, through its limit points.

    The path starts at the case's mass and voltage; InputError if there is no equilibrium.
    ``films``: include the film of every station. ``beyond``: follow it on where no real film gets:
    a wrinkled film that thins without bound as one that cannot wrinkle, and a film far beyond its
    electric strength.
    """
    plate = case.specimen.needed_plate() if along == "mass" else case.specimen.plate
    if plate is not None and along == "mass" and case.rig.guide == "fixed":
        raise InputError("must let the plate move: it holds any mass", key="rig.guide",
                         given=case.rig.guide)
    began = time.perf_counter()
    model, start = equilibrate(case, settings)
    if start.status != "equilibrium":
        raise InputError("must be where the branch can start: "
                         f"{case.doubted(failure_reason(start))}",
                         key="--mass, --voltage",
                         given=f"{case.mass * 1e3:g} g and {case.voltage / 1e3:g} kV")
    asked = replace(case, voltage=0.0) if along in ("voltage", "charge") else case
    way = []
    held = along == "voltage" and HEAVE not in model.plate_freedoms
    branch = _flat_stops(case, start, settings) if held else None
    branch = branch or stops(case, model, start.state, along, settings.path, beyond=beyond)
    for stop in _with_snaps(branch, settings.path):
        progress(f"{stop.film.deflection * 1e3:.2f} mm")
        gone = stop.happens(INSTABILITY) and stop.film.thins and not beyond
        way.append(replace(stop, ended=_ENDS) if gone else stop)
        if gone:
            break
    stations = [stop.station for stop in apart(way)]
    happenings = [(stop, stop.event) for stop in way if stop.event is not None]
    rest = None
    if along in ("voltage", "charge") and stations:
        rest = (deflection_without_voltage(case, settings) if case.voltage
                else stations[0].deflection_m)
    return PathResult(
        specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage,
        pressure_Pa=case.rig.gas_pressure or None, along=along,
        unit=_GROWING[along][1],
        stations=tuple(_with_stroke(station, rest) for station in stations),
        events=tuple(Event(**vars(event), station=_with_stroke(stop.station, rest))
                     for stop, event in happenings),
        dofs=model.unknowns, wall_s=time.perf_counter() - began,
        warnings=(way[-1].ended if way else UNFOLLOWED, *asked.remarks,
                  *((NO_SURFACE,) if films and not model.meshed else ())),
        limits=_surfaces(_critical_film(stop.film) for stop, event in happenings
                         if event.what in _LIMIT_POINTS),
        films=_surfaces(film_surface(stop.film.model, stop.film.point.state)
                        for stop in apart(way) if films))


def _flat_stops(case: Case, start: Outcome, settings: Settings) -> Iterator[Stop] | None:
    """Yield a flat film that no voltage moves at its start and its limits; None for others."""
    model, rest = equilibrate(replace(case, voltage=0.0), settings)
    limits = flat_limits(case, model, rest, settings)
    if limits is None:
        return None
    ahead = sorted((limit for limit in limits.reached if limit.voltage_V > case.voltage),
                   key=lambda limit: limit.voltage_V)
    return _charged(case, FilmPoint(model, at_point(start)), ahead, limits.ended)


def _charged(case: Case, flat: FilmPoint, limits: Sequence[Limit], ended: str) -> Iterator[Stop]:
    """Yield a flat film at its start and at limits, as far as it is in equilibrium."""
    last = Stop(flat)
    for limit in limits:
        across = replace(case, voltage=limit.voltage_V).film_voltage
        solution = newton(flat.model, flat.point.state.under(voltage=across**2))
        if not solution.converged:
            break
        yield last
        last = Stop(replace(flat, point=replace(flat.point, solution=solution)), Happening(
            what=limit.kind, value=across, unit=_GROWING["voltage"][1], x_m=limit.x_m,
            y_m=limit.y_m, spread=limit.spread, segment=limit.segment))
    yield replace(last, ended=ended)


def _surfaces(found: Iterable[FilmSurface | None]) -> tuple[FilmSurface, ...]:
    """Collect the surfaces of films that have one."""
    return tuple(surface for surface in found if surface is not None)


def _with_stroke(station: Station, rest: float | None) -> Station:
    """Add the stroke to a station, from a deflection without voltage [m]."""
    return station if rest is None else station.showing(stroke_m=station.deflection_m - rest)


def _with_snaps(way: Iterator[Stop], settings: PathSettings) -> Iterator[Stop]:
    """Change limit points to snaps where a mechanism makes the plate jump.

    At every second limit point the growing quantity turns back: a branch that became unstable by a
    snap is stable again from there on.
    """
    turns, snaps = 0, False
    for stop in way:
        if not stop.happens(PULL_IN) or isinstance(stop.film, ChargedPoint):
            yield stop
            continue
        turns += 1
        if turns % 2:
            snaps = stop.landed(settings) is not None
        yield stop.at(SNAP_THROUGH if turns % 2 else SNAP_BACK) if snaps else stop


def apart(way: Sequence[Stop]) -> list[Stop]:
    """Remove stops at the same point as the one before, where two events coincide."""
    return [stop for number, stop in enumerate(way)
            if not number or stop.film.point is not way[number - 1].film.point]


def stops(case: Case, model: Model, start: State, along: Along, settings: PathSettings,
          most: float = np.inf, falling: bool = False, step: float = SMOOTH,
          beyond: bool = False) -> Iterator[Stop]:
    """Yield the equilibria of a case from a state of its model, while one quantity grows.

    An event between two points of the branch is a separate stop, so that curves pass through it. A
    voltage grows up to ``most`` across the film [V], if the supply gives that. With ``falling`` it
    falls to 0. ``step``: the longest one, relative to the frame's half extent. ``beyond``: continue
    far beyond the film's electric strength.
    """
    settings = settings.bounded(model, followed=True)
    far = max(abs(model.deflection(start)) / model.high, 1.0)
    longest, loose = step * far, SMOOTH * far
    first_step = min(longest, max(step * _BEGUN, settings.arc.first))
    arc = replace(settings.arc, first=first_step, longest=longest, loose=loose)
    stepping = replace(settings, arc=arc)
    load = _GROWING[along][0]
    # A search has its own bound, because no check of user inputs applies to it.
    highest = min(most, case.rig.most_film_voltage(case.direction)) ** 2
    first: Stop | None = None
    before: Stop | None = None
    # A negative gas pressure becomes more negative.
    sense = -1 if falling or (load == "pressure" and start.pressure < 0) else 1
    for branch, point in follow_branch(model, start, load, stepping, sense, beyond=True):
        here = Stop(_growing(along)(branch.model, point, load))
        if falling and point.state.load(load) < 0:
            return
        if first is not None and before is not None:
            if load == "voltage" and point.state.load(load) > highest:
                # A stiff film hardly moves on the way there: its load is a better measure than its
                # motion.
                begun = before.film.point.state.under(voltage=highest)
                last = next(branch.points(begun), None)
                if last is not None:
                    here = Stop(replace(here.film, point=last))
                    yield from _passed(case, branch, along, (first, before, here))
                    yield replace(here, ended=above_words(case))
                return
            events = _passed(case, branch, along, (first, before, here))
            if here.film.thinned and before.film.wrinkled:
                yield from _to_thinning(events)
                return
            yield from events
        first = first or here
        ended = _ended(here, first, along, settings) or (not beyond and _broken_down(here, first))
        yield replace(here, ended=ended or _end_of_mechanism(here.film) or UNFOLLOWED)
        if ended:
            return
        before = here


@dataclass(frozen=True, eq=False)
class Stop:
    """A film at a point of its path, and the event there, if any.

    ``ended`` is the reason if the path ends here.
    """

    film: FilmPoint
    event: Happening | None = None
    ended: str = ""

    @cached_property
    def station(self) -> Station:
        """Numbers of the equilibrium."""
        film, tangent = self.film, self.film.point.solution.tangent
        state = film.point.state
        assert tangent is not None
        values, = rows_of_variables(film.shown, plate=film.model.specimen.plate is not None)
        segments, = segments_of(film.shown)
        return Station(
            values=values, segments=segments, force_N=state.force, voltage_V=film.voltage,
            pressure_Pa=state.pressure, charge_C=film.capacitance * film.voltage,
            stable=tangent.negative == 0 and film.firm,
            tense=bool((film.fields.tension == Tension.TAUT).all()),
            unbalanced=film.unbalanced)

    def happens(self, state: LimitState) -> bool:
        """Check whether the film reaches a limit state here."""
        return self.event is not None and self.event.what == state.kind

    def at(self, state: LimitState) -> Stop:
        """Replace the event by another limit state."""
        assert self.event is not None
        return replace(self, event=replace(self.event, what=state.kind))

    def landed(self, settings: PathSettings) -> Solution | None:
        """Find the equilibrium to which the plate jumps from this limit point; None without one."""
        # A film that cannot wrinkle does not jump.
        model = self.film.model
        return snapped(model, self.film.point, settings) if model.wrinkles else None


def _ended(stop: Stop, first: Stop, along: Along, settings: PathSettings) -> str:
    """Explain why a branch is not followed further; "" if it continues.

    The limits depend on the start: a film may already have a large deflection or stretch under its
    load alone.
    """
    film, point = stop.film, stop.film.point
    deflection = f"{film.deflection * 1e3:.4g} mm"
    begun = abs(first.film.deflection)
    if abs(film.deflection) > max(film.model.high, _FURTHER * begun):
        return f"followed to a deflection of {deflection}"
    stretch, begun_stretch = film.max_stretch, first.film.max_stretch
    if stretch and begun_stretch and stretch > max(_STRETCH, _FURTHER * begun_stretch):
        return f"followed to a stretch of {stretch:.3g}"
    sense = -1 if first.film.point.rate < 0 else 1
    if point.rate * sense < 0 and point.state.load(stop.film.load) * sense < 0:
        return f"followed until the {along} fell back to zero"
    checked = np.isfinite(settings.unbalanced)
    if checked and film.model.unbalanced(point.state) > settings.unbalanced:
        return (f"followed to a deflection of {deflection}: beyond, the mesh does not resolve the "
                "branch; --refine may")
    return ""


def _broken_down(stop: Stop, first: Stop) -> str:
    """Explain that the field is far beyond the film's strength; "" if it is not."""
    share, begun = (float(film.fields.breakdown_share.max(initial=0.0))
                    for film in (stop.film, first.film))
    if share > max(_WITHSTOOD, _FURTHER * begun):
        return (f"followed until the electric field was {share:.2g} times the film's strength; "
                "\"beyond\" follows it on")
    return ""


def _end_of_mechanism(film: FilmPoint) -> str:
    """Write a message if the next step leads beyond a mechanism's range; else ""."""
    model = film.model
    if not model.loading.biases or HEAVE not in model.plate_freedoms:
        return ""
    way = film.point.direction[1][model.plate_freedoms.index(HEAVE)]
    return without_mechanism(model, film.deflection + _AHEAD * way)


def _passed(case: Case, branch: Branch, along: Along, points: tuple[Stop, Stop, Stop]
            ) -> list[Stop]:
    """Find the events between two points of a branch, in order.

    Events that coincide are at one point. ``points``: the first of the branch and these two.
    """
    first, before, after = (stop.film for stop in points)
    between = branch.between(before.point, after.point)

    def at(point: PathPoint) -> FilmPoint:
        return replace(before, model=branch.model, point=point)

    def where(sign: Sign) -> FilmPoint | None:
        point = between.where(lambda point: sign.value(at(point)), sign.needs)
        return None if point is None else at(point)

    def step(film: FilmPoint) -> float:
        return between.step(film.point)

    films, events = list[FilmPoint](), list[Stop]()
    for state, sign, found in passed(before, after, where):
        here = next((film for film in films if abs(step(film) - step(found)) <= _SAME), found)
        films.append(here)
        low, high = map(at, between.beside(here.point, SMOOTH / 2))
        events.append(_happening(case, along, Passage(state, sign, first, low, here, high)))
    return sorted(events, key=lambda stop: step(stop.film))


def _to_thinning(events: list[Stop]) -> Iterator[Stop]:
    """Yield events of a wrinkled film before a point that it does not reach."""
    for stop in events:
        gone = stop.happens(INSTABILITY)
        yield replace(stop, ended=_THINS if gone and stop.film.thins else UNFOLLOWED)
        if gone:
            return


def _happening(case: Case, along: Along, passage: Passage) -> Stop:
    """Create the stop where a film reaches a limit state."""
    state, stop = passage.state, Stop(passage.here)
    x, y = passage.here.place(state)
    off = spread(passage, lambda film: _measured(case, film, along))
    return replace(stop, event=Happening(
        what=state.kind, value=_measured(case, passage.here, along),
        unit=_GROWING[along][1], x_m=x, y_m=y, spread=off, segment=passage.here.segment(state)))


def _critical_film(film: FilmPoint) -> FilmSurface | None:
    """Create the surface of the film at a limit point with its critical mode.

    The mode is the path's direction there.
    """
    model, point = film.model, film.point
    mode = moved(model, point.state, point.direction)
    change = replace(point.state, positions=mode.positions - point.state.positions)
    return film_surface(model, point.state, critical_mode=whole(model, change)[1].positions)


def _measured(case: Case, film: FilmPoint, along: Along) -> float:
    """Compute the quantity that grows along the branch.

    A mass is the nominal one, a voltage that across the film.
    """
    if along == "mass":
        return float(case.rig.nominal_mass(film.point.state.force, case.specimen.plate_area))
    if along == "charge":
        return film.capacitance * film.voltage
    return film.voltage if along == "voltage" else film.point.state.pressure


def _growing(along: Along) -> type[FilmPoint]:
    """Choose the class of points by the quantity that grows."""
    return ChargedPoint if along == "charge" else FilmPoint
