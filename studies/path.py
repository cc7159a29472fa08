"""One specimen's branch of equilibria: through pull-in, and what the film loses on the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal, Self, cast

import numpy as np

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.fem.equilibrium.arc_length import Branch, PathPoint
from tympan.fem.equilibrium.newton import Solution, moved, newton
from tympan.fem.equilibrium.path_following import PathSettings, follow_branch
from tympan.fem.equilibrium.ramp import without_mechanism
from tympan.fem.equilibrium.snap import snapped
from tympan.fem.film.tension_field import Tension
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import HEAVE, Load, State
from tympan.fem.results.fields import Fields, node_fields, whole
from tympan.fem.results.firmness import edge_firmness, firmness, rough_firmness
from tympan.fem.results.limit_states import (
    INSTABILITY,
    LIMIT_STATES,
    PULL_IN,
    SNAP_BACK,
    SNAP_THROUGH,
    LimitState,
    Sign,
)
from tympan.fem.rig import MOST_VOLTAGE
from tympan.geometry.outlines import area
from tympan.studies.case import (
    Case,
    CaseRecord,
    LimitKind,
    Settings,
    Unknowns,
    WallTime,
    Warnings,
    deflection_without_voltage,
    equilibrate,
    failure_reason,
    mounted_place,
)
from tympan.studies.columns import rows_of
from tympan.studies.files import remove, write_csv
from tympan.studies.film_surface import FilmSurface, film_surface, save_series, series_files

#: Longest step along a branch, relative to the frame's half extent, so that its points are a smooth
#: curve.
_STEP = 0.015
#: Largest stretch at a branch's end, beyond the range of most laws. Set by trial.
_STRETCH = 6.0

#: Deflection and stretch at a branch's end, relative to where it begins, if that is far already.
_FURTHER = 2.0

UNFOLLOWED = "the branch could not be followed further"
#: So far ahead of where a branch was left, relative to the frame, a mechanism that ends is named as
#: the reason: a step is hardly longer.
_AHEAD = 0.05
_THINS = "followed until the film, wrinkled, thins without bound"

#: Difference of two deflections, relative to the frame, that are one.
_SAME = 1e-6
#: Distance of a node from a corner, relative to the frame, that is at it: rounding of the mesher.
_AT_CORNER = 1e-6

#: Elements on one side of an electrode's edge err alike and show a part of an error alone.
#: Where a wrinkled film ends there, it was up to 1.47 times as much (six meshes, three masses).
_ALIKE = 1.5

#: The same where the edge itself gives way: near to that the film beside it strains so fast that
#: elements half as large are not much nearer. Errors were up to 1.6 times as much (40 films,
#: elements of a third where they were largest).
_BENT = 2.5

#: What a place misses that gives way at an electrode's edge tells too little: it thins ever faster,
#: and the sooner the finer the mesh. So the pace counts at which its margin fell from the start on.
#: Errors were 0.04 to 0.23 of a spread by that (films of four kinds, elements half as large).
_STEADY = 0.4

#: The same share where the edge itself gives way, by the firmness of that edge alone. With 0.4 the
#: errors of two films of 54 were up to 1.9 times what was stated (elements half as large).
_STEEP = 0.8

#: Once it is kept from wrinkling, a film strains most at an electrode's edge, and its jumps tell
#: too little of that: errors were up to 2.3 times as much (29 films, elements half as large).
_KEPT = 2.5

#: A motion along a branch by which is seen where the film thins, relative to the frame.
_ONWARDS = 1e-4

#: What may grow along a branch.
Along = Literal["voltage", "charge", "mass", "pressure"]
#: Events at limit points.
_LIMIT_POINTS = {PULL_IN.kind, SNAP_THROUGH.kind, SNAP_BACK.kind}

#: The load that grows, and the unit in results.
_GROWING: dict[Along, tuple[Load, str]] = {
    "voltage": ("voltage", "V"), "charge": ("voltage", "C"), "mass": ("force", "kg"),
    "pressure": ("pressure", "Pa")}
#: Of a unit in results, what a person reads and how many of it there are.
_READ = {"V": (1e-3, "kV"), "C": (1e6, "µC"), "kg": (1e3, "g"), "Pa": (1.0, "Pa")}


@dataclass(frozen=True, kw_only=True)
class Station:
    """One equilibrium of a branch, in SI."""

    deflection_m: Annotated[float, Key("deflection of the plate, downwards")]
    stroke_m: Annotated[float | None, Key(
        "deflection less that without voltage, under the same mass; none where mass or pressure "
        "grows")] = None
    force_N: Annotated[float, Key("force that the film carries")]
    voltage_V: Annotated[float, Key("nominal voltage")]
    pressure_Pa: Annotated[float, Key("pressure of the gas below the film; positive lifts it")]
    charge_C: Annotated[float, Key("charge on the film")]
    capacitance_F: Annotated[float, Key("capacitance of the film as it is")]
    max_stretch: Annotated[float, Key("largest principal stretch, from the virgin film")]
    least_stress_Pa: Annotated[float, Key("smallest principal true stress")]
    breakdown_share: Annotated[float, Key("largest field over strength; 0 where the strength is "
                                          "unknown")]
    stable: Annotated[bool, Key("whether it is stable at constant load, voltage and gas pressure, "
                                "the film kept from wrinkling, and not beyond its own instability")]
    tense: Annotated[bool, Key("whether no part of the film has lost tension")]
    unbalanced: Annotated[float, Key("largest nodal force that smooth motions leave, relative to "
                                     "the largest nodal force")]


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happens at one point of a branch."""

    what: Annotated[LimitKind, Key("what happens there, a kind of limit")]
    value: Annotated[float, Key("value of what grows along the path")]
    unit: Annotated[str, Key("unit of the value")]
    x_m: Annotated[float, Key("where in the mounted film: at a limit, where the film thins "
                              "fastest")]
    y_m: Annotated[float, Key("y of the same place")]
    spread: Annotated[float, Key("how far the value may be off for the mesh, relative, by the "
                                 "jumps of what is watched between elements")]
    station: Annotated[Station, Key("the equilibrium there")]

    @property
    def label(self) -> str:
        """Label of the limit."""
        return str(LIMIT_STATES[self.what].label)

    @property
    def value_text(self) -> str:
        """The value in the unit a person reads."""
        factor, unit = _READ[self.unit]
        return f"{factor * self.value:.5g} {unit}"


@dataclass(frozen=True, kw_only=True)
class PathResult(CaseRecord):
    """A path: its stations in order, and where a limit of the film is passed.

    Mass and voltage are those it starts at. ``limits``: the film at each limit point, with a field
    ``critical_mode``. ``films``: that of each station, where they were asked for.
    """

    ending = "-path"
    writer = "tympan path -o"
    kinds = ("csv", "json")
    drawn = ("png", "svg")

    along: Annotated[Along, Key("what grows")]
    unit: Annotated[str, Key("unit of what grows")]
    stations: Annotated[tuple[Station, ...], Key("the equilibria in order")]
    events: Annotated[tuple[Event, ...], Key("where a limit of the film is passed")]
    dofs: Unknowns
    wall_s: WallTime
    warnings: Warnings
    limits: tuple[FilmSurface, ...] = field(default=(), repr=False, compare=False)
    films: tuple[FilmSurface, ...] = field(default=(), repr=False, compare=False)

    @property
    def rows(self) -> dict[str, Array]:
        """A row for each station."""
        return rows_of(self.stations)

    def save(self, folder: Path) -> None:
        """Write ``NAME-path.csv``, ``.json``, and each limit point's film as ``-limit-N.vtu``.

        Films of stations as a VTK series ``NAME-path.pvd``, whose times are the CSV's rows from 0.
        """
        name = f"{self.specimen}-path"
        remove(folder, *(file.name for file in folder.glob(f"{name}-limit-*.vtu")))
        super().save(folder)
        for number, film in enumerate(self.limits, start=1):
            film.save(folder / f"{name}-limit-{number}.vtu")
        save_series(folder, name, list(enumerate(self.films)))
        columns = [item.name for item in fields(Station)]
        write_csv(folder / f"{name}.csv", columns,
                  ([getattr(station, column) for column in columns] for station in self.stations))

    @classmethod
    def load(cls, folder: Path, name: str | None = None) -> Self:
        result = super().load(folder, name)
        films = sorted(folder.glob(f"{result.specimen}-path-limit-*.vtu"),
                       key=lambda limit: int(limit.stem.rpartition("-")[2]))
        stations = series_files(folder, f"{result.specimen}-path")
        return replace(result, limits=tuple(map(FilmSurface.load, films)),
                       films=tuple(map(FilmSurface.load, stations)))


def path(case: Case, settings: Settings, along: Along,
         progress: Callable[[str], None] = lambda words: None, films: bool = False) -> PathResult:
    """Follow the equilibria of a case while one quantity grows, and through its limit points.

    The case's mass and voltage are where the path starts; InputError if there is no equilibrium.
    ``films``: with the film of every station.
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
    passed = []
    for stop in _with_snaps(stops(case, model, start.state, along, settings.path), settings.path):
        progress(f"{stop.station.deflection_m * 1e3:.2f} mm")
        passed.append(stop)
    stations = [stop.station for stop in apart(passed)]
    rest = None
    if along in ("voltage", "charge") and stations:
        rest = (deflection_without_voltage(case, settings) if case.voltage
                else stations[0].deflection_m)
    return PathResult(
        specimen=case.specimen.name, mass_kg=case.mass, voltage_V=case.voltage,
        pressure_Pa=case.rig.gas_pressure or None, along=along,
        unit=_GROWING[along][1],
        stations=tuple(_with_stroke(station, rest) for station in stations),
        events=tuple(replace(stop.event, station=_with_stroke(stop.event.station, rest))
                     for stop in passed if stop.event is not None),
        dofs=model.unknowns, wall_s=time.perf_counter() - began,
        warnings=(passed[-1].ended if passed else UNFOLLOWED, *asked.remarks),
        limits=tuple(_critical_film(stop.model, stop.point) for stop in passed
                     if stop.event is not None and stop.event.what in _LIMIT_POINTS),
        films=tuple(film_surface(stop.model, stop.point.state) for stop in apart(passed) if films))


def _with_stroke(station: Station, rest: float | None) -> Station:
    """A station with its stroke, from a deflection without voltage [m]."""
    return station if rest is None else replace(station, stroke_m=station.deflection_m - rest)


def _with_snaps(passed: Iterator[Stop], settings: PathSettings) -> Iterator[Stop]:
    """Stops whose limit points are snaps where a mechanism makes the plate jump.

    At every second limit point what grows turns back: a branch that became unstable by a snap is
    stable again from there on.
    """
    turns, snaps = 0, False
    for stop in passed:
        if stop.event is None or stop.event.what != PULL_IN.kind or stop.along == "charge":
            yield stop
            continue
        turns += 1
        if turns % 2:
            snaps = stop.landed(settings) is not None
        yield stop.at(SNAP_THROUGH if turns % 2 else SNAP_BACK) if snaps else stop


def apart(passed: Sequence[Stop]) -> list[Stop]:
    """Stops without those at the point of the one before, where two things happen at once."""
    return [stop for number, stop in enumerate(passed)
            if not number or stop.point is not passed[number - 1].point]


def stops(case: Case, model: Model, start: State, along: Along, settings: PathSettings,
          most: float = np.inf, falling: bool = False) -> Iterator[Stop]:
    """The equilibria of a case from a state of its model on, while one quantity grows.

    What happens between two points of the branch is a stop of its own, so that curves pass through
    it. A voltage grows to ``most`` across the film [V], if the supply gives that; or it falls to 0.
    """
    settings = settings.bounded(model, followed=True)
    longest = _STEP * max(abs(model.deflection(start)) / model.high, 1.0)
    stepping = replace(settings, arc=replace(settings.arc, longest=longest))
    load = _GROWING[along][0]
    # A search meets no check of what people give: it has a bound of its own.
    highest = min(most, case.rig.most_film_voltage(case.direction)) ** 2
    first: Stop | None = None
    before: Stop | None = None
    # A gas that sucks is made to suck more.
    sense = -1 if falling or (load == "pressure" and start.pressure < 0) else 1
    for branch, point in follow_branch(model, start, load, stepping, sense, beyond=True):
        here = Stop(branch.model, point, along=along)
        if falling and point.state.load(load) < 0:
            return
        if first is not None and before is not None:
            if load == "voltage" and point.state.load(load) > highest:
                # A stiff film hardly moves on the way there: its load says more than its motion.
                last = next(branch.points(before.point.state.under(voltage=highest)), None)
                if last is not None:
                    here = Stop(branch.model, last, along=along)
                    yield from _passed(case, branch, first, before, here)
                    yield replace(here, ended=above_words(case))
                return
            passed = _passed(case, branch, first, before, here)
            if here.thinned and before.wrinkled:
                yield from _to_thinning(passed)
                return
            yield from passed
        first = first or here
        ended = _ended(here, first, along, settings)
        yield replace(here, ended=ended or _end_of_mechanism(here) or UNFOLLOWED)
        if ended:
            return
        before = here


@dataclass(frozen=True, eq=False)
class Stop:
    """A point of a branch: what is seen there, what happens there, if anything.

    ``ended`` says why the branch would end with it; ``along`` what grows along the branch.
    """

    model: Model
    point: PathPoint
    event: Event | None = None
    ended: str = ""
    along: Along = "voltage"

    @cached_property
    def fields(self) -> Fields:
        """Fields at the nodes of every element."""
        return node_fields(self.model, [self.point.state])[0]

    @cached_property
    def pressed(self) -> Fields:
        """The same of a film that would not wrinkle."""
        if not self.model.wrinkles:
            return self.fields
        return node_fields(replace(self.model, wrinkles=False), [self.point.state])[0]

    @cached_property
    def firmness(self) -> Array:
        """Least stiffness of the film within its plane at the nodes of every element [Pa]."""
        return firmness(self.model, self.point.state)

    @property
    def _firm(self) -> bool:
        """Whether the film, were it kept from wrinkling, does not give way in itself."""
        return bool(firmness(replace(self.model, wrinkles=False), self.point.state).min() > 0)

    @property
    def edge_firmness(self) -> float:
        """The least of an electrode's edge [Pa]."""
        return float(edge_firmness(self.model, self.point.state).min())

    @property
    def rough_firmness(self) -> Array:
        """The same by each element's own strain."""
        return rough_firmness(self.model, self.point.state)

    @property
    def thins(self) -> bool:
        """Whether it is by thinning, wrinkled, that the film gives way first."""
        return self.model.wrinkles and bool(self._thinning_margin <= self.firmness.min())

    @property
    def wrinkled(self) -> bool:
        """Whether the film has lost tension and goes on, wrinkled."""
        loose = self.model.wrinkles and not self.model.in_tension(self.point.state)
        return loose and self._thinning_margin >= 0

    @property
    def thinned(self) -> bool:
        """Whether a film that wrinkles would thin without bound before it gets here."""
        return self.model.wrinkles and self._thinning_margin < 0

    @cached_property
    def _thinning_margin(self) -> float:
        return float(self.model.thinning_margin(self.point.state))

    @cached_property
    def thinning(self) -> Array:
        """Thickness a little further along the branch over that here, at the nodes."""
        return np.asarray(self._moved(_ONWARDS).fields.thickness / self.fields.thickness)

    def at(self, state: LimitState) -> Stop:
        """The same where what happens is another limit state."""
        assert self.event is not None
        return replace(self, event=replace(self.event, what=cast(LimitKind, state.kind)))

    def landed(self, settings: PathSettings) -> Solution | None:
        """Equilibrium to which the plate comes from here, at a limit point; None if nowhere."""
        # A film that is kept from wrinkling is none that jumps.
        return snapped(self.model, self.point, settings) if self.model.wrinkles else None

    @property
    def behind(self) -> Stop:
        """A little further back along the branch."""
        return self._moved(-_ONWARDS)

    def _moved(self, motion: float) -> Stop:
        """State of the film after a small motion along the branch, as its direction has it."""
        point = self.point
        loads = {_GROWING[self.along][0]: point.rate}
        state = moved(self.model, point.state, point.direction, motion, loads)
        solution = Solution(state, True, 0, point.solution.tangent)
        return replace(self, point=replace(point, solution=solution), event=None)

    @property
    def growth(self) -> float:
        """Growth of what grows along the branch."""
        return self.point.rate if self.along != "charge" else self._charging

    @property
    def given_way(self) -> float:
        """-1 where a taut film moves by itself before what grows turns; 1 where it does not.

        0 where neither can be said: at a given charge, beyond the turn, without tension, and where
        the film has given way in one place.
        """
        tangent = self.point.solution.tangent
        taut = self.pressed.stress_2.min() > 0 and self.firmness.min() > 0
        if self.along == "charge" or self.point.rate < 0 or not taut:
            return 0.0
        assert tangent is not None
        return 1.0 if tangent.negative == 0 else -1.0

    @cached_property
    def station(self) -> Station:
        """The equilibrium's numbers."""
        model, state, tangent = self.model, self.point.state, self.point.solution.tangent
        assert tangent is not None
        voltage = float(np.sqrt(max(state.voltage_squared, 0.0)))
        capacitance = model.capacitance(state)
        return Station(
            deflection_m=model.deflection(state), force_N=state.force, voltage_V=voltage,
            pressure_Pa=state.pressure, charge_C=capacitance * voltage, capacitance_F=capacitance,
            max_stretch=float(self.fields.stretch_1.max()),
            least_stress_Pa=float(self.pressed.stress_2.min()),
            breakdown_share=float(self.fields.breakdown_share.max()),
            stable=tangent.negative == 0 and self._firm,
            tense=bool((self.fields.tension == Tension.TAUT).all()),
            unbalanced=model.unbalanced(state))

    @property
    def _charging(self) -> float:
        """Growth of the charge C U along the branch."""
        model, point = self.model, self.point
        voltage = max(self.station.voltage_V, 1e-3)
        inner, plate = model.by_load(point.state, "voltage")
        work = float(inner @ point.direction[0] + plate @ point.direction[1])
        growth = -2 * model.discretisation.mirrored * work
        return float(growth * voltage + self.station.capacitance_F * point.rate / (2 * voltage))

    def place(self, state: LimitState) -> tuple[float, float]:
        """Place in the mounted film where a limit state begins [m]."""
        return mounted_place(self.fields.position[np.argmin(state.field(self))])

    def on_electrode_edge(self, state: LimitState) -> bool:
        """Whether a limit state begins at the edge of an electrode, within the film."""
        mesh = self.model.discretisation
        node = mesh.connectivity.ravel()[np.argmin(state.field(self))]
        return bool((mesh.electrode_edge.every == node).any())

    def at_sharp_corner(self, state: LimitState) -> bool:
        """Whether a limit state begins in an element at a corner where the film is singular.

        Not one that depends on the whole film, which such a corner changes little.
        """
        if not any(sign.local for sign in state.signs):
            return False
        mesh, specimen = self.model.discretisation, self.model.specimen
        element = int(np.argmin(state.field(self))) // mesh.connectivity.shape[1]
        nodes = mesh.reference[mesh.connectivity[element], None, :2]
        away = np.linalg.norm(nodes - specimen.sharp_corners, axis=-1)
        return bool((away < _AT_CORNER * max(specimen.frame.semi_axes)).any())

    def missed(self, state: LimitState, sign: Sign) -> float:
        """Error of a limit state's number for the mesh, in its own unit.

        What elements of one order less change in it, and by how much elements differ that meet
        where it begins: either is too small alone, where both sides miss alike or the order changes
        little by chance. Of a number that depends on the whole film's energy: mean square of the
        jumps of its stress, over that of the stress about its mean.
        """
        mesh, fields = self.model.discretisation, self.fields
        # At an electrode's edge the film itself jumps.
        sides = 2 * mesh.connectivity + (mesh.covered > 0)
        nodes: Numbers = np.unique(sides, return_inverse=True)[1].reshape(sides.shape)
        if not sign.local:
            stresses = (fields.stress_1, fields.stress_2)
            return float(max((_jumps(nodes, stress)**2).mean() / max(np.var(stress), 1e-300)
                             for stress in stresses))
        place = int(np.argmin(state.field(self)))
        values = state.by_element(self)
        element = place // mesh.connectivity.shape[1]
        apart = abs(values[place] - state.field(self)[place]) if np.isfinite(values[place]) else 0.0
        jump = float(max(_jumps(nodes, values)[nodes[element]].max(), apart))
        coarser = self._coarser()
        return jump + (abs(sign.value(coarser) - sign.value(self)) if coarser else 0.0)

    def _coarser(self) -> Stop | None:
        """The film under the same loads by elements of one order less on the same triangles."""
        fine, state = self.model.discretisation, self.point.state
        if fine.mesh.order == 1:
            return None
        coarse = fine.of_order(fine.mesh.order - 1)
        motion = coarse.interpolated(fine, state.positions - fine.reference)
        model = replace(self.model, discretisation=coarse)
        solution = newton(model, replace(state, positions=coarse.reference + motion))
        solution.release()
        if not solution.converged:
            return None
        return replace(self, model=model, point=replace(self.point, solution=solution))


def _jumps(nodes: Numbers, values: Array) -> Array:
    """Largest less smallest value at each node, of the elements that meet there.

    ``nodes`` of the elements, shape (elements, local); ``values`` element-major, those that are ∞
    left out.
    """
    count, some = int(nodes.max()) + 1, np.isfinite(values)
    high, low = np.full(count, -np.inf), np.full(count, np.inf)
    np.maximum.at(high, nodes.ravel()[some], values[some])
    np.minimum.at(low, nodes.ravel()[some], values[some])
    return np.where(np.isfinite(high), high - low, 0.0)


def above_words(case: Case) -> str:
    """Why the voltage of a case is raised no further: its supply gives no more."""
    if case.rig.sag_voltage < MOST_VOLTAGE:
        most = case.rig.most_film_voltage(case.direction)
        return (f"the limit is above {most / 1e3:.4g} kV across the film, the most that the "
                "amplifier gives, since it sags")
    return f"the limit is above {MOST_VOLTAGE / 1e3:g} kV"


def _ended(stop: Stop, first: Stop, along: Along, settings: PathSettings) -> str:
    """Why a branch is not followed further; "" where it is.

    What is far depends on where it began: a film may hang deep, or be stretched much, under its
    load alone.
    """
    station, point = stop.station, stop.point
    deflection = f"{station.deflection_m * 1e3:.4g} mm"
    begun = abs(first.station.deflection_m)
    if abs(station.deflection_m) > max(stop.model.high, _FURTHER * begun):
        return f"followed to a deflection of {deflection}"
    if station.max_stretch > max(_STRETCH, _FURTHER * first.station.max_stretch):
        return f"followed to a stretch of {station.max_stretch:.3g}"
    sense = -1 if first.point.rate < 0 else 1
    if point.rate * sense < 0 and point.state.load(_GROWING[along][0]) * sense < 0:
        return f"followed until the {along} fell back to zero"
    if station.unbalanced > settings.unbalanced:
        return (f"followed to a deflection of {deflection}: beyond, the mesh does not resolve the "
                "branch; --refine may")
    return ""


def _end_of_mechanism(stop: Stop) -> str:
    """Message where the next step would lead beyond a mechanism of the rig; "" elsewhere."""
    if not stop.model.loading.biases or HEAVE not in stop.model.plate_freedoms:
        return ""
    way = stop.point.direction[1][stop.model.plate_freedoms.index(HEAVE)]
    return without_mechanism(stop.model, stop.model.deflection(stop.point.state) + _AHEAD * way)


def _passed(case: Case, branch: Branch, first: Stop, before: Stop, after: Stop) -> list[Stop]:
    """Events between two points of a branch, in order; what happens at once at one point."""
    passed: list[Stop] = []
    same = _SAME * branch.model.size
    for state in LIMIT_STATES.values():
        for sign in state.signs:
            if sign.value(before) * sign.value(after) >= 0:
                continue

            def value(point: PathPoint, sign: Sign = sign) -> float:
                return sign.value(Stop(branch.model, point, along=before.along))

            point = branch.where(before.point, after.point, value, of_state=sign.of_state)
            if point is not None:
                here = Stop(branch.model, point, along=before.along)
                deep = here.station.deflection_m
                here = next((replace(stop, event=None) for stop in passed
                             if abs(stop.station.deflection_m - deep) <= same), here)
                passed.append(_happening(case, here, state, sign, (first, before, after)))
                break
    start = before.station.deflection_m
    return sorted(passed, key=lambda stop: abs(stop.station.deflection_m - start))


def _to_thinning(passed: list[Stop]) -> Iterator[Stop]:
    """Events of a wrinkled film before a point that it does not reach."""
    for stop in passed:
        gone = stop.event is not None and stop.event.what == INSTABILITY.kind
        yield replace(stop, ended=_THINS if gone and stop.thins else UNFOLLOWED)
        if gone:
            return


def _happening(case: Case, stop: Stop, state: LimitState, sign: Sign,
               around: tuple[Stop, Stop, Stop]) -> Stop:
    """The stop where something happens, with the event; beyond a first one, between two others."""
    first, before, after = around
    # Where a branch ends before the place, what is left of the margin is missed, too.
    spread = stop.missed(state, sign) + (abs(sign.value(stop)) if sign.local else 0.0)
    at_edge = sign.local and stop.on_electrode_edge(state)
    # Either the film gives way there, since it thins, or the edge itself does.
    bends = at_edge and not stop.thins and state is INSTABILITY
    at_edge &= stop.thins
    spread *= _BENT if bends else 1.0
    kept = first.model.wrinkles and not stop.model.wrinkles
    if kept and not sign.local and len(stop.model.discretisation.electrode_edge.every):
        spread *= _KEPT
    if after.thinned and before.wrinkled and stop.thins:
        # Beyond its end a wrinkled film's margin jumps, and before it falls ever faster.
        before, after = stop.behind, stop
        spread *= _ALIKE if at_edge else 1.0
    value, begun, *ends = (_measured(case, other.station, stop.along)
                           for other in (stop, first, before, after))
    if sign.local:
        change = max(abs(sign.value(before) - sign.value(after)), np.finfo(float).tiny)
        pace = abs(ends[1] - ends[0]) / change
        share, begins = (_STEEP, first.edge_firmness) if bends else (_STEADY, sign.value(first))
        if (at_edge or bends) and not before.wrinkled and begins > 0:
            pace = max(pace, share * abs(value - begun) / begins)
        spread *= pace / abs(value) if value else 0.0
    x, y = stop.place(state)
    what = cast(LimitKind, state.kind)
    return replace(stop, event=Event(
        what=what, value=value, unit=_GROWING[stop.along][1], x_m=x, y_m=y, spread=spread,
        station=stop.station))


def _critical_film(model: Model, point: PathPoint) -> FilmSurface:
    """The film at a limit point with its critical mode, which is the path's direction there."""
    mode = moved(model, point.state, point.direction)
    change = replace(point.state, positions=mode.positions - point.state.positions)
    return film_surface(model, point.state, critical_mode=whole(model, change)[1].positions)


def _measured(case: Case, station: Station, along: Along) -> float:
    """Quantity that grows along the branch: the nominal mass, but the film's own voltage."""
    if along == "mass":
        idle = case.rig.force(0.0, area(case.specimen.needed_plate().outline))
        return float((station.force_N - idle) / case.rig.gravity)
    return {"voltage": station.voltage_V, "charge": station.charge_C,
            "pressure": station.pressure_Pa}[along]
