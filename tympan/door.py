"""Functions of ``import tympan`` on an actuator; its parts are in :mod:`tympan.parts`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict, TypeVar, Unpack

from tympan.base.errors import InputError as InputError
from tympan.base.fields import number, numbers, only
from tympan.base.process.folder import alone, temporary_folder
from tympan.base.process.threads import one_thread
from tympan.base.toml_reader import Table
from tympan.fem.film.library import LibraryMaterial, StatedMaterial, material_named
from tympan.fem.rig import Rig, load_actuator, mounted, mounted_together
from tympan.geometry.mesher import MeshSettings as MeshSettings
from tympan.geometry.specimen import Specimen
from tympan.grammar import combining, public
from tympan.result import Result as Result
from tympan.studies.case import NO_MASS, CaseResult
from tympan.studies.case import Case as Case
from tympan.studies.case import Settings as Settings
from tympan.studies.shipped import load_named

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from tympan.fem.film.law_report import Examination
    from tympan.studies.alpha import AlphaResult, AlphaSettings
    from tympan.studies.design.requirements import Requirements
    from tympan.studies.design.result import DesignResult
    from tympan.studies.diagnosis.film_fit import FilmFit
    from tympan.studies.diagnosis.result import Diagnosis
    from tympan.studies.diagnosis.self_check import Bench
    from tympan.studies.films.population import Population
    from tympan.studies.force import ForceResult
    from tympan.studies.limits import LimitsResult
    from tympan.studies.limits.curve import CurveResult
    from tympan.studies.material.result import MaterialFitResult
    from tympan.studies.modes import ModesResult
    from tympan.studies.path import PathResult
    from tympan.studies.response import ResponseResult
    from tympan.studies.sense import SenseResult
    from tympan.studies.sensitivity import SensitivityResult
    from tympan.studies.steer import SteerResult
    from tympan.studies.study import StudyResult
    from tympan.studies.sweep.run import SweepResult
    from tympan.studies.tolerance.given import Tolerances
    from tympan.studies.tolerance.result import ToleranceResult
    from tympan.studies.trace import Responses

File = str | os.PathLike[str]
#: What a file states: its name, or its tables.
Stated = File | Mapping[str, Any]
#: What is one specimen: it, the name of its file, or its tables.
ONE = (Specimen, str, os.PathLike, Mapping)
SpecimenOrFile = Specimen | Stated
#: A rig, the name of its file, or the keys of one; None is a rig without anything on it.
Holder = Rig | Stated | None
#: One load, several, or a range: "0 kV..5 kV", ``{"from": 0, "to": "5 kV", "count": 11}``.
Load = float | str | Sequence[float | str] | Mapping[str, Any]
#: Most films that are drawn.
_MOST_FILMS = 1_000_000
Solved = TypeVar("Solved")


class Voltages(TypedDict, total=False):
    """Arguments of a signal of its kind, as :class:`~tympan.studies.signals.Wave` takes them."""

    low: float | str
    high: float | str
    duration: float | str
    count: int
    seed: int


class Waves(Voltages, total=False):
    """A signal with the interval of its samples."""

    interval: float | str


class CouponTable(TypedDict, total=False):
    """Statements on a table of coupons that its headings do not contain."""

    mode: str | None
    unit: str | None
    area: float | str | None
    length: float | str | None
    decimal: Literal[",", "."] | None


class PartSizes(TypedDict, total=False):
    """Sizes of the parts that hold a film, by the options of ``tympan export``."""

    width: float | str
    frame_height: float | str
    clamp_height: float | str
    plate_height: float | str
    screw: float | str
    spacing: float | str


class Loads(TypedDict, total=False):
    """Loads on a specimen, as :class:`Case` takes them: SI numbers or texts with their unit.

    A voltage may also be a share of the first limit, "80 %".
    """

    mass: Load | None
    voltage: Load | None
    pressure: float | str | None
    rig: Holder
    elapsed: float | str
    direction: float | Literal["up", "down", ""]


def loaded(given: SpecimenOrFile) -> Specimen:
    """Load a specimen that is given by the name of its file, or by its tables."""
    if isinstance(given, Specimen):
        return given
    if isinstance(given, Mapping):
        return load_actuator(Table("specimen", dict(given)))
    if not isinstance(given, str | os.PathLike):
        raise InputError("must be a Specimen or the name of its file", key="specimen",
                         given=given)
    return load_named(Path(given))


def held(specimen: SpecimenOrFile, rig: Holder = None, pressure: float | str | None = None
         ) -> tuple[Specimen, Rig]:
    """Load a specimen and its rig, which a ``rig`` that is given replaces; press the gas."""
    bare, on = mounted(loaded(specimen), rig_of(rig))
    return bare, on.pressed(pressure)


def driven_together(subjects: tuple[Any, ...], named: dict[str, Any], name: str
                    ) -> tuple[tuple[Any, ...], dict[str, Any]]:
    """Set the shares of segments that the voltage of an argument names, in all specimens given.

    The voltage becomes that of the film.
    """
    from tympan.studies.driven import by_segment, driven

    if not by_segment(named[name]):
        return subjects, named
    films = subjects or (named["specimen"],)
    pairs = [driven(loaded(film), named[name], name) for film in films]
    wired, (voltage, *_) = zip(*pairs, strict=True)
    others = named | {name: voltage}
    return (wired, others) if subjects else ((), others | {"specimen": wired[0]})


def held_together(specimens: SpecimenOrFile | Sequence[SpecimenOrFile], rig: Holder = None
                  ) -> tuple[tuple[Specimen, ...], Rig]:
    """Load one specimen or several, and the one rig that all are on."""
    films = (specimens,) if isinstance(specimens, ONE) else specimens
    return mounted_together(tuple(map(loaded, films)), rig_of(rig))


def rig_of(given: Holder) -> Rig | None:
    """Read a rig that is given by the name of its file or by its keys."""
    if isinstance(given, Mapping):
        return Rig.from_table(Table("rig", dict(given)))
    return given if given is None or isinstance(given, Rig) else Rig.read(Path(given))


def several(given: Load | None, dimension: str, name: str) -> tuple[float, ...]:
    """Convert loads to SI; none where none is given."""
    return () if given is None else numbers(given, dimension, name)


def _case(specimen: SpecimenOrFile, loads: Loads, settings: Settings) -> Case:
    """Build the case of loads, with the gas pressure on its rig."""
    from tympan.studies.limits import charged

    given: dict[str, Any] = {**loads}
    specimen, rig = held(specimen, given.pop("rig", None), given.pop("pressure", None))
    missing = specimen.plate is not None and given.get("mass") is None
    mass, voltage = (only(given.pop(name, None), name, 0.0) for name in ("mass", "voltage"))
    case = Case(specimen, mass=mass, rig=rig, **given)
    if missing:
        raise InputError(NO_MASS, key="mass")
    return charged(case, voltage, settings)


@public()
def load(file: File) -> Specimen:
    """Load a specimen from a TOML file; an :class:`Actuator` if the file has a table [rig].

    Raises
    ------
    InputError
        When it is missing or wrong, naming file, key, what was given and what is allowed.
    """
    if Path(file).is_dir():
        raise InputError("is a folder: tympan.Result.load reads a result that is stored there",
                         file=Path(file))
    return load_named(Path(file))


@public()
def draw(specimen: SpecimenOrFile, target: Axes | File | None = None, *,
         voltage: Load | None = None) -> Axes:
    """Draw a specimen with its sizes on axes, into a file, or on new axes; return the axes.

    The voltage is written beside the segments of an electrode.
    """
    from tympan.reports.plots import plot

    across = None if voltage is None else number(voltage, "voltage", "voltage")
    return plot(loaded(specimen), target, voltage=across)


@public()
def material(name: str) -> LibraryMaterial | StatedMaterial:
    """Load a material of the library, as ``tympan materials`` lists it with its source, or a file.

    A file is one that ``tympan material fit`` writes, or a specimen's.

    A :class:`Film` made of it has what a specimen file's ``material = "name"`` sets: law, viscous
    branches, electric strength, and relative permittivity where the library lists one.

    Examples
    --------
    >>> material("vhb-4910").law, material("vhb-4910").relative_permittivity
    ('ogden', 4.7)
    """
    return material_named(name)


@public(Loads, placed=("settings",))
@one_thread()
def solve(specimen: SpecimenOrFile, *, after: float | str | None = None,
          tolerances: Tolerances | Stated | None = None, settings: Settings | None = None,
          **loads: Unpack[Loads]) -> Result[CaseResult]:
    """Solve the equilibrium of a specimen under a mass and a voltage, with fields and limits.

    ``result.status`` is "equilibrium", "no_equilibrium" (past pull-in) or "not_converged"; the
    numbers of a state that does not exist are None. ``after``: time since the voltage was switched
    on, for a film with viscous branches; by default the new equilibrium is solved.
    ``tolerances``: a file, or :class:`Tolerances`; ``Tolerances()`` has the defaults of the film's
    material. Then ``result.bands["deflection_m"]`` has median, 5 and 95 % of films.
    """
    from tympan import solving

    if after is not None and tolerances is not None:
        raise InputError("is for films at rest: after must be left out", key="tolerances",
                         given=tolerances)
    settings = settings or Settings()
    case = _case(specimen, loads, settings)
    solved = solving.solve(case, settings, after, film=True)
    return Result(_banded(solved, case.specimen, tolerances, case.rig, settings), case.specimen)


def _banded(result: Solved, specimen: Specimen, tolerances: Tolerances | Stated | None,
            rig: Rig, settings: Settings) -> Solved:
    """Add bands to the result, where tolerances are given."""
    if tolerances is None:
        return result
    from tympan.studies.tolerance.bands import banded

    banded_result: Solved = banded(result, specimen, _tolerances(tolerances), rig, settings)
    return banded_result


def _tolerances(given: Tolerances | Stated) -> Tolerances:
    from tympan.studies.tolerance.given import Tolerances

    if isinstance(given, Mapping):
        return Tolerances.from_table(Table("tolerances", dict(given)))
    return given if isinstance(given, Tolerances) else Tolerances.read(Path(given))


@public(Loads, placed=("settings",))
@one_thread()
def limits(specimen: SpecimenOrFile, *, beyond: bool = False, settings: Settings | None = None,
           **loads: Unpack[Loads]) -> Result[LimitsResult]:
    """Compute limits of the voltage: loss of tension, breakdown, instability, pull-in.

    ``result.limits.limit`` is the first of them, with ``kind`` and ``voltage_V``. Without a mass
    one is chosen that suits the film. ``beyond``: continue to where no real film gets: far beyond
    its electric strength, and, where it gets thinner without limit, as if it could not wrinkle, to
    its pull-in.
    """
    from tympan.studies.limits import LimitsResult
    from tympan.studies.limits.loads import usual_masses

    settings = settings or Settings()
    bare, on = held(specimen, loads.get("rig"), loads.get("pressure"))
    if bare.plate is not None and loads.get("mass") is None:
        loads["mass"] = usual_masses(bare, settings, on)[0]
    case = _case(bare, loads | {"rig": on, "pressure": None}, settings)
    return Result(LimitsResult.of(case, settings, beyond))


@public(former={"voltages": "voltage"}, rest="mass")
@combining
@one_thread()
def curve(specimen: SpecimenOrFile, *, mass: Load | None = None, voltage: Load | None = None,
          pressure: float | str | None = None, rig: Holder = None, beyond: bool = False,
          tolerances: Tolerances | Stated | None = None, settings: Settings | None = None
          ) -> Result[CurveResult]:
    """Compute deflection against voltage under each ``mass``; by default under usual masses.

    Each curve goes to the film's end. Each ``voltage`` is an additional row.
    ``result.curves[0].limits.limit.voltage_V`` is the first limit under the first mass.
    ``tolerances`` as for :func:`solve`: then ``result.curves[0].band_deflection_m`` has the band of
    films at ``band_voltage_V``. ``beyond`` as for :func:`limits`.
    """
    from tympan.studies.driven import Voltages
    from tympan.studies.limits.curve import curve
    from tympan.studies.limits.loads import usual_masses

    (specimen, on), settings = held(specimen, rig, pressure), settings or Settings()
    given = [Case(specimen, mass=one).mass for one in several(mass, "mass", "mass")]
    usual = () if given else usual_masses(specimen, settings, on) if specimen.plate else (0.0,)
    marked = Voltages.read(voltage)
    Case.greatest(specimen, given or usual, marked.film, on)  # refuses loads that no film bears
    found = curve(specimen, given or usual, settings, on, marked.film, beyond=beyond,
                  segment_voltages=marked.segments)
    return Result(_banded(found, specimen, tolerances, on, settings))


@public(former={"voltages": "voltage", "loads": "mass"})
@combining
@one_thread()
def force(specimen: SpecimenOrFile, *, mass: Load | None = None, voltage: Load | None = None,
          pressure: float | str | None = None, rig: Holder = None, from_: float | str = 0.0,
          to: float | str | None = None, points: int = 61, rate: float | str | None = None,
          cycles: int = 1, tolerances: Tolerances | Stated | None = None,
          settings: Settings | None = None) -> Result[ForceResult]:
    """Compute the force on the plate against its displacement, a curve for each ``voltage``.

    The plate is displacement-controlled, as in a tensile tester, at ``points`` positions between
    two displacements. The last is by default a little beyond where the loads come to rest, or 0.3
    of the gap. With the rig's springs and other biases each ``mass`` is a line that crosses the
    curves at equilibria: ``result.loads[0].crossings``, ``result.stroke_m``, ``result.work_J``.
    ``result.blocked_force_N`` is the change of force of the held plate. With a
    ``rate``, such as "1 mm/s", the plate also moves out and back in time, in ``cycles``:
    ``result.loops[0].area_J`` are the areas of a film with viscous branches. ``tolerances`` as for
    :func:`solve`: then ``result.curves[0].band_force_N`` has the band of films.
    """
    from tympan.studies.driven import Voltages
    from tympan.studies.force import ForceCase, force

    (specimen, on), settings = held(specimen, rig, pressure), settings or Settings()
    volts = Voltages.read(voltage)
    case = ForceCase(specimen, voltages=volts.film or (0.0,), segment_voltages=volts.segments,
                     start=from_, to=to, points=points, masses=several(mass, "mass", "mass"),
                     rate=rate, cycles=cycles, rig=on)
    return Result(_banded(force(case, settings), specimen, tolerances, case.rig, settings))


@public(former={"voltages": "voltage", "masses": "mass"})
@combining
@one_thread()
def sense(specimen: SpecimenOrFile, *, mass: Load | None = None, voltage: Load | None = None,
          pressure: float | str | None = None, rig: Holder = None, from_: float | str = 0.0,
          to: float | str | None = None, points: int = 21, sensing: Sequence[str] = (),
          tilt: float | str | None = None, noise: float | None = None,
          settings: Settings | None = None) -> Result[SenseResult]:
    """Compute capacitance against deflection at several voltages, and the inverse.

    The plate is displaced between two deflections, or a little further than each ``mass`` deflects
    it. ``result.sensed(capacitance, voltage)`` is the deflection [m] by a polynomial with the
    largest error ``result.inverse.error_m``. ``to_pandas()`` is the table; it includes the change
    of the sensed deflection by an error of the capacitance, the prestretch and the permittivity.
    Three or more segments, by default all, or those named in ``sensing``, also give both tilts, up
    to a largest ``tilt``: ``result.sensed_plate({"A": …, "B": …, "C": …}, voltage)``. Their
    capacitances have a relative ``noise``.
    """
    from tympan.studies.driven import Voltages
    from tympan.studies.sense import SenseCase, sense

    specimen, on = held(specimen, rig, pressure)
    volts = Voltages.read(voltage)
    case = SenseCase(specimen, voltages=volts.film or (0.0,), segment_voltages=volts.segments,
                     masses=several(mass, "mass", "mass"), start=from_, to=to, points=points,
                     sensing=tuple(sensing), tilt=tilt, noise=noise, rig=on)
    return Result(sense(case, settings or Settings()))


@public()
@combining
@one_thread()
def steer(specimen: SpecimenOrFile, *, mass: Load | None = None,
          voltage: str | Mapping[str, Load] | None = None, pressure: float | str | None = None,
          rig: Holder = None, settings: Settings | None = None) -> Result[SteerResult]:
    """Map the plate's deflection and tilts over the voltages of an electrode's segments.

    ``voltage`` has one value, several, or a range for each segment by its name, such as
    ``{"A": "0 kV..3 kV in 21", "B": "0 kV..3 kV in 21", "C": "1 kV"}``. All combinations are rows
    of ``to_pandas()``: deflection, slopes and shift of the plate, least tension, margin to
    breakdown, errors, and the limit that a film is beyond, with its segment. They are solved by
    reduced films. ``result.largest_tilts(low, high)`` has the largest tilt in each direction at
    deflections [m] in a range. Without voltages all segments go up to 80 % of the first limit.
    """
    from tympan.studies.steer import SteerCase, steer

    specimen, on = held(specimen, rig, pressure)
    if mass is None and specimen.plate is not None:
        raise InputError(NO_MASS, key="mass")
    case = SteerCase(specimen, voltages=voltage, rig=on,
                     mass=number(only(mass, "mass", 0.0), "mass", "mass"))
    return Result(steer(case, settings or Settings()), case.specimen)


@public(placed=("tolerances",))
@one_thread()
def tolerance(specimen: SpecimenOrFile, *, mass: Load | None = None, voltage: Load | None = None,
              pressure: float | str | None = None, rig: Holder = None,
              tolerances: Tolerances | Stated | None = None,
              want: Mapping[str, object] | str = "", films: int = 10_000, seed: int = 0,
              settings: Settings | None = None) -> Result[ToleranceResult]:
    """Compute the spread of deflection, stroke, force, frequency and others between films.

    ``tolerances``: a file, :class:`Tolerances`, or the defaults of the film's material. Mass and
    voltage suit the film where they are not given. ``result.quantities["stroke_m"]`` has the
    median, the 5 and 95 % quantiles and the shares of the variance; ``result.reached`` is the
    probability that a film bears the voltage, and ``result.fails`` the limits of the others.

    ``want``: bounds as in a file of requirements, ``{"stroke": "2 mm", "deflection": "at most 6
    mm"}``; ``result.kept`` is the share of the films that keep all of them, and ``result.wanted``
    has each. A tolerances file may have them in its table ``[want]``.
    """
    from tympan.studies.tolerance.given import Tolerances, asked_bounds
    from tympan.studies.tolerance.tolerance import ToleranceCase, tolerance

    given = Tolerances() if tolerances is None else _tolerances(tolerances)
    file = None if isinstance(tolerances, Tolerances) else tolerances
    load, across = (None if each is None else only(each, name)
                    for each, name in ((mass, "mass"), (voltage, "voltage")))
    specimen, on = held(specimen, rig, pressure)
    case = ToleranceCase(specimen, mass=load, voltage=across, tolerances=given,
                         wanted=asked_bounds(file, want), films=films, seed=seed,
                         rig=on)
    return Result(tolerance(case, settings or Settings()))


@public(placed=("tolerances",))
@one_thread()
def films_within(specimen: SpecimenOrFile, *, mass: Load = 0.0, voltage: float | str | None = None,
                 pressure: float | str | None = None, rig: Holder = None,
                 tolerances: Tolerances | Stated | None = None, films: int = 1000, seed: int = 0,
                 settings: Settings | None = None) -> Population:
    """Draw random films within tolerances, for questions of one's own; they are reduced films.

    ``tolerances`` as for :func:`tolerance`, whose films these are. They bear the nominal ``mass``,
    or masses between a lowest and a highest one, and voltages up to ``voltage``. It must be above
    all limits that are asked for; by default it is 1.4 times the nominal film's first limit, and
    one film in 300 has a higher limit.

    ``films.under(mass, voltage)`` loads them: there ``shown("max_stretch")`` and so on are arrays
    (films, 2) of any variable of a state, without and under the voltage; ``deflection``,
    ``blocked_force`` and ``frequency`` are there, too. ``films.first_limits(mass)`` has the voltage
    and the kind of each film's first limit, ``films.ends(mass)`` the voltages of all. Each load is
    one for all films, or an array with one for each. Numbers are in SI, and nan where a film has no
    state.
    """
    from tympan.base.points import drawn_points
    from tympan.studies.tolerance.drawn import Scattered
    from tympan.studies.tolerance.given import Tolerances

    given = Tolerances() if tolerances is None else _tolerances(tolerances)
    (specimen, on), settings = held(specimen, rig, pressure), settings or Settings()
    scattered = Scattered.of(specimen, given)
    masses = numbers(mass, "mass", "mass")
    highest = (number(voltage, "voltage", "voltage") if voltage is not None else
               _above_limits(Case(specimen, mass=min(masses), rig=on), settings))
    Case.greatest(specimen, masses, [highest], on)  # refuses loads that no film bears
    if not 1 <= films <= _MOST_FILMS:
        raise InputError(f"must be a whole number from 1 to {_MOST_FILMS}", key="films",
                         given=films)
    if seed < 0:
        raise InputError("must be a whole number, 0 or more", key="seed", given=seed)
    return scattered.population((min(masses), max(masses)), highest,
                                drawn_points(scattered.inputs, films, seed), on, settings)


def _above_limits(case: Case, settings: Settings) -> float:
    """Choose a voltage [V] above the first limits of films like a case's."""
    from tympan.studies.limits.voltages import first_limit
    from tympan.studies.tolerance.tolerance import ABOVE

    first = first_limit(case, settings)
    if first is None:
        raise InputError("must be given: the film without scatter has no first limit to choose it "
                         "by", key="voltage")
    return ABOVE * first.voltage_V


@public(Loads, former={"to": "turn"}, placed=("along", "settings"))
@one_thread()
def path(specimen: SpecimenOrFile, *,
         along: Literal["voltage", "charge", "mass", "pressure"] = "voltage",
         rate: float | str | None = None, turn: float | str | None = None, fields: bool = False,
         beyond: bool = False, settings: Settings | None = None, **loads: Unpack[Loads]
         ) -> Result[PathResult | Responses]:
    """Follow equilibria while one quantity grows from the loads on, through limit points.

    With a ``rate`` such as "100 V/s": a loop in time, up to a voltage ``turn`` and down again, of a
    film with viscous branches; by default it turns at 95 % of the film's first limit. ``fields``:
    include the film of every state, or at 25 moments of a loop. ``beyond`` as for :func:`limits`.
    """
    from tympan import solving

    settings = settings or Settings()
    return Result(solving.follow(_case(specimen, loads, settings), settings, along, rate,
                                 turn, fields, beyond))


@public(Waves, former={"films": "at"}, placed=("signal",))
@one_thread()
def transient(specimen: SpecimenOrFile | Sequence[SpecimenOrFile], *, mass: Load | None = None,
              rig: Holder = None, signal: str = "step", rest: float | str | None = None,
              swing: bool = False, at: Load = (), states: bool = False,
              settings: Settings | None = None, **wave: Unpack[Waves]) -> Result[Responses]:
    """Simulate one film or several under a step, ramp, sine, random voltages, or a CSV file's.

    Before the signal the film rests under mass and first voltage for ``rest``, by default for ever,
    unless the film states when it was mounted. ``swing``: the plate has inertia; else it follows
    the film at once. The mass suits the film where none is given. ``result.responses[0]`` has the
    numbers, ``to_pandas()`` the samples at ``interval``; ``result.films[0]`` the film at each of
    the times ``at``. With ``states``, ``result.responses[0].states`` has the variables of the
    film's state at each sample, such as ``max_stretch``. Arguments of the signal: ``low`` and
    ``high`` voltage, ``duration`` of step, ramp, a random level or a period, ``count`` of levels or
    periods, and a ``seed``.
    """
    from tympan.studies.signals import Wave
    from tympan.studies.trace import sample_count
    from tympan.studies.transient import responses

    specimens, on = held_together(specimen, rig)
    form = Wave(signal, **wave)
    voltages = form.signal()
    sample_count(voltages.end, form.interval, len(specimens))
    return Result(responses(
        specimens, form, voltages, settings or Settings(), rig=on, rest=rest, swing=swing,
        mass=None if mass is None else only(mass, "mass"), films=numbers(at, "time", "at"),
        states=states))


@public(Loads, placed=("count", "settings"))
@one_thread()
def modes(specimen: SpecimenOrFile, *, count: int = 6, point_mass: float | str = 0.0,
          settings: Settings | None = None, **loads: Unpack[Loads]) -> Result[ModesResult]:
    """Solve small vibrations about an equilibrium at constant voltage.

    ``point_mass``: part of the mass in the plate's centre; the rest is spread over the plate.
    """
    from tympan.studies.modes import modes

    settings = settings or Settings()
    case = _case(specimen, loads, settings)
    return Result(modes(case, settings, count, number(point_mass, "mass", "point_mass")),
                  case.specimen)


@public(Loads, rest="frequency")
@one_thread()
def response(specimen: SpecimenOrFile, *, frequency: Load = (),
             sine: str | Mapping[str, float] | None = None, settings: Settings | None = None,
             **loads: Unpack[Loads]) -> Result[ResponseResult]:
    """Compute amplitude and phase of the deflection under a small sine of the voltage.

    Each ``frequency`` is a number [Hz] or a text; by default they suit the film. ``sine``: how much
    of the oscillation each segment of the electrode has, such as "A = 1, B = -1"; by default all
    swing in the proportion of their voltages. A plate that tilts has ``tilt_x_rad_per_V``, too.
    """
    from tympan.studies.driven import proportions
    from tympan.studies.response import response

    settings = settings or Settings()
    case = _case(specimen, loads, settings)
    asked = numbers(frequency, "frequency", "frequency")
    swing = None if sine is None else proportions(sine, "sine")
    return Result(response(case, settings, asked, sine=swing), case.specimen)


@public(Loads, rest="of")
@one_thread()
def sensitivity(specimen: SpecimenOrFile, *, of: str | Sequence[str] = "heave",
                settings: Settings | None = None, **loads: Unpack[Loads]
                ) -> Result[SensitivityResult]:
    """Differentiate quantities, by default "heave", by all that they depend on.

    ``of``: their names, in a list or with commas between them.
    """
    from tympan.studies.sensitivity import sensitivity

    settings = settings or Settings()
    names = of.split(",") if isinstance(of, str) else of
    if not all(isinstance(name, str) for name in names):
        raise InputError("must be names of quantities", key="of", given=str(of))
    return Result(sensitivity(_case(specimen, loads, settings), settings,
                              tuple(name.strip() for name in names)))


@public(placed=("alpha_settings", "settings", "rig"))
@one_thread()
def alpha(specimen: SpecimenOrFile, *, rig: Holder = None, circles: int = 2,
          radii: str = "semi_axes", uncertainty: bool = False,
          alpha_settings: AlphaSettings | None = None, settings: Settings | None = None
          ) -> Result[AlphaResult]:
    """Compute weights of the circles that represent a specimen in a lumped model.

    ``circles``: their number; ``radii``: semi_axes, sectors or fit; ``alpha_settings`` may give the
    loads. ``uncertainty``: also compute how the weights change with mesh, material and loads.
    """
    from tympan.studies import alpha as study

    chosen = alpha_settings or study.AlphaSettings(circles=circles, radii=radii)
    (specimen, on), settings = held(specimen, rig), settings or Settings()
    result = study.alpha(specimen, settings, chosen, on)
    if uncertainty:
        result = replace(result, uncertainty=study.uncertainty(specimen, settings, chosen, on,
                                                               result))
    return Result(result)


@public(former={"at": "voltage"}, placed=("folder", "workers", "settings", "voltage"))
@one_thread()
def sweep(file: File, *, voltage: float | str | None = None, folder: File | None = None,
          exact: bool = False, tolerances: Tolerances | Stated | None = None, workers: int = 1,
          scheduler: str | None = None, wait: float | str = 60.0,
          settings: Settings | None = None) -> Result[SweepResult]:
    """Solve all cases of SWEEP.toml; cases stored in a ``folder`` are not solved again.

    Many specimens that differ in numbers alone are solved by a reduced film, with its error in each
    row; ``exact``: all by finite elements. ``tolerances`` as for :func:`solve`: then the table also
    has ``deflection_low_m`` and ``deflection_high_m``, 5 and 95 % of films.

    Its maps, and ``result.best("stroke", under="max_true_stress < 131 kPa")``, compare films at one
    ``voltage`` of the sweep, by default the highest. With more than one worker the calling script
    needs a main guard. ``scheduler``: the address of a Dask cluster that solves instead; it must
    have a worker within ``wait``.
    """
    from functools import partial

    from tympan.studies.parallel import processes, serial
    from tympan.studies.sweep.cluster import cluster
    from tympan.studies.sweep.plan import read_sweep
    from tympan.studies.sweep.run import run_sweep

    given = None if tolerances is None else _tolerances(tolerances)
    planned = read_sweep(Path(file), settings or Settings(), exact, given)
    planned = planned if voltage is None else planned.compared_at(voltage)
    pool = serial if workers == 1 else partial(processes, workers=workers)
    if scheduler is not None:
        pool = partial(cluster, address=scheduler, wait=number(wait, "time", "wait"), say=print)
    with temporary_folder() as scratch, alone(Path(folder or scratch)):
        return Result(run_sweep(planned, Path(folder or scratch), pool))


@public()
@one_thread()
def study(file: File | None = None, *, tolerances: Tolerances | Stated | None = None
          ) -> Result[StudyResult]:
    """Run the study of STUDY.toml, by default of the paper's three actuators.

    ``tolerances`` as for :func:`solve`: then results, curves and forces have bands.
    """
    from tympan.studies.study import default_study, read_study, run_study

    planned = default_study() if file is None else read_study(Path(file))
    given = None if tolerances is None else _tolerances(tolerances)
    return Result(run_study(planned.within(given)))


@public()
def data(dataset: File) -> dict[str, Any]:
    """Summarise a dataset with warnings, as ``tympan data --json`` prints it."""
    from tympan.studies.data.checks import summary
    from tympan.studies.data.dataset import read_dataset

    return summary(read_dataset(Path(dataset)))


@public(placed=("target", "kind"))
def draft(file: File, *, target: File | None = None, kind: str | None = None) -> Path:
    """Write a first dataset.toml for a table of yours, beside it or to a ``target``.

    Every line is a guess with its reason. ``kind``: "static", "transient", "force", "coupon",
    "frequency" or "range", where the guess is wrong.
    """
    from tympan.studies.data.draft import write_draft

    return write_draft(Path(file), None if target is None else Path(target), kind)


@public(placed=("workers", "seed"))
@one_thread()
def diagnose(dataset: File, *, self_check: int = 0, workers: int = 1, seed: int = 0,
             formula: str | None = None) -> Result[Diagnosis]:
    """Compare a dataset with the simulation, and name the effect that explains the difference.

    ``self_check``: number of synthetic sets of such readings with hidden errors; their verdicts are
    counted. ``formula``: film in closed form that simulates, in place of finite elements. With more
    than one worker the calling script needs a main guard.
    """
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.diagnosis.diagnose import by_formula, conclude

    concluded = conclude(by_formula(read_dataset(Path(dataset)), formula), workers, seed)
    checked = _self_check(concluded.bench, self_check, workers, seed)
    return Result(concluded.diagnosis(films=True, self_check=checked))


@public(placed=("workers", "seed"))
@one_thread()
def plan(dataset: File, *, self_check: int = 0, workers: int = 1, seed: int = 0,
         formula: str | None = None) -> dict[str, Any]:
    """Plan measurements: list what such readings can show, as ``tympan diagnose --plan`` does.

    Measured values may be missing from the dataset. All else is as for ``diagnose``.
    """
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.diagnosis.diagnose import by_formula, plan_readings

    record, bench = plan_readings(by_formula(read_dataset(Path(dataset), True), formula), workers)
    return record | {"self_check": _self_check(bench, self_check, workers, seed)}


def _self_check(bench: Bench, count: int, workers: int, seed: int) -> dict[str, Any] | None:
    from tympan.studies.diagnosis.self_check import self_checked

    return self_checked(replace(bench, seed=seed), count, workers).json() if count else None


@public(CouponTable, former={"laws": "law"})
@one_thread()
def fit_material(*files: File, law: str | Sequence[str] = (), noise: float | str | None = None,
                 branches: int | None = None, constants: Sequence[str] = (),
                 film: Case | None = None, settings: Settings | None = None,
                 **table: Unpack[CouponTable]) -> Result[MaterialFitResult | FilmFit]:
    """Fit laws to coupon tests, or a film to readings of its actuators.

    ``files`` are one set of coupon tests; ``result.best["constants"]["mu"]["value"]`` is a constant
    of the law to take, ``result.fits`` are all laws. ``law``: those to compare, by default all;
    ``noise``: standard deviation of one stress; ``film``: a case that is solved with the fitted
    laws, in ``result.numbers.numbers["film"]``. Or ``files`` is one folder of a dataset, whose law
    keeps its form: ``result.stiffness_factor`` and ``result.permittivity_factor`` have 95 % limits,
    and ``result.not_told`` names what the readings do not determine. ``constants``: keys of its
    law, such as ``["mu"]``, or ``["all"]``, that are fitted individually: ``result.law.constants``.
    ``branches``: number of viscous branches, by default as many as the tests determine. ``table``:
    what the headings do not state: ``mode``, ``unit`` of stresses, ``area`` and ``length`` of the
    strip before the test, ``decimal`` mark.
    """
    from tympan.base.units import quantity
    from tympan.studies.data.coupon import coupon_layout
    from tympan.studies.data.dataset import read_dataset
    from tympan.studies.diagnosis.diagnose import by_formula
    from tympan.studies.diagnosis.film_fit import fit_film
    from tympan.studies.material.result import fit_coupons

    settings = settings or Settings()
    laws = law.split(",") if isinstance(law, str) else law
    paths = [Path(file) for file in files]
    folders = [path for path in paths if path.is_dir() or path.name == "dataset.toml"]
    if not paths or (folders and len(paths) > 1):
        raise InputError("must be one folder, or files of coupons", key="files",
                         given=" ".join(map(str, paths)) or "none")
    if not folders:
        if constants:
            raise InputError("is for a dataset: of coupons every constant is fitted",
                             key="constants", given=str(constants))
        stress = quantity(noise, "stress") if isinstance(noise, str) else noise
        return Result(fit_coupons(paths, laws, stress, branches, film, settings,
                                  coupon_layout(**table)))
    for key, given in {"law": law, "noise": noise, "film": film, **table}.items():
        if given not in (None, ()):
            raise InputError("is for coupons: a dataset's specimens have their law and their noise",
                             key=key, given=str(given))
    dataset = by_formula(read_dataset(paths[0]), settings.formula)
    return Result(fit_film(dataset, branches, constants=constants))


@public(placed=("settings", "workers"))
@one_thread()
def design(requirements: Requirements | File | None = None, *, workers: int = 1,
           settings: Settings | None = None) -> Result[DesignResult]:
    """Find the best films for requirements that 95 % of the films within tolerances must meet.

    ``requirements``: a file, or :class:`Requirements`. ``result.films[0]`` is the best film, with
    its numbers and those of the given film, the bounds that are active and the cost of relaxing
    them; ``result.specimens`` are the films' specimens by file name. ``result.status`` is
    "impossible" where no film meets all bounds. Without a file the film is an ellipse with the
    largest stroke, its frame at most as large as that of the paper's large one. Several kinds of
    films are searched in parallel by ``workers``; with more than one the calling script needs a
    main guard.
    """
    from tympan.studies.design.design import design as best_films
    from tympan.studies.design.requirements import Requirements

    if requirements is None:
        requirements = Requirements.shipped()
    elif not isinstance(requirements, Requirements):
        requirements = Requirements.read(Path(requirements))
    return Result(best_films(requirements, settings or Settings(), workers=workers))


@public(placed=("settings",))
def optimise(file: File | None = None, *, settings: Settings | None = None
             ) -> Result[DesignResult]:
    """Call :func:`design`, which replaces this former name."""
    return design(file, settings=settings)


@public()
def materials() -> dict[str, LibraryMaterial]:
    """List the materials of the library by name, each with its source, for :func:`material`.

    Examples
    --------
    >>> materials()["vhb-4910"].law
    'ogden'
    """
    from tympan.fem.film.library import MATERIALS

    return dict(MATERIALS)


@public(placed=("held",))
def show_material(name: str, *, held: float | None = None) -> Examination:
    """Tabulate a material's true stress against stretch, and find where its law fails.

    ``name``: of the library, or a specimen file. ``held``: the stretch across in the second column,
    by default as mounted.

    Examples
    --------
    >>> show_material("vhb-4910").json()["law"]
    'ogden'
    """
    from tympan.fem.film.law_report import examine, subject

    return examine(*subject(name, held))


@public()
def effects() -> dict[str, Any]:
    """List effects a model may leave out, with units and priors, as ``tympan effects --json`` does.

    Examples
    --------
    >>> effects()["sensor_zero"]["on_one_specimen"]
    False
    """
    from tympan.studies.effects.listing import listing

    return listing()


@public(PartSizes, former={"masses": "mass", "voltages": "voltage"})
@combining
def export(specimen: SpecimenOrFile, folder: File, *, mass: Load | None = None,
           voltage: Load | None = None, pressure: float | str = 0.0, inp: bool = False,
           settings: Settings | None = None, **sizes: Unpack[PartSizes]) -> list[Path]:
    """Write frame, clamp, plate, film and mesh into a folder, and return the files.

    As STEP, DXF, SVG and VTU; ``sizes`` are those of the parts. ``inp``: instead the film as input
    of CalculiX or Abaqus, a step for each ``mass``, then for each ``voltage``, above a gas of a
    ``pressure`` [Pa].
    """
    from tympan.geometry.cad.sizes import PartOptions
    from tympan.studies.driven import Voltages
    from tympan.studies.export import export, export_input

    specimen, settings = loaded(specimen), settings or Settings()
    settings.require_elements()
    carried, applied = several(mass, "mass", "mass"), Voltages.read(voltage)
    if inp:
        return [export_input(specimen, settings.mesh, Path(folder), carried, applied.film,
                             number(pressure, "stress", "pressure"), applied.segments)]
    chosen = PartOptions(**{name: number(size, "length", name) for name, size in sizes.items()})
    return list(export(specimen, settings.mesh, Path(folder), chosen))


@public()
def compare(first: Result[Any] | File, second: Result[Any] | File) -> pd.DataFrame:
    """List the values that differ between two results of one kind, and by how much.

    Each is a result, the folder where one is stored, or its file there. The rows have the names of
    values in the result's JSON; ``relative`` is the difference over the first. Of lists of numbers
    the element with the largest difference is a row.
    """
    import pandas as pd

    from tympan.reports.comparison import differences

    one, other = (each if isinstance(each, Result) else Result.load(each)
                  for each in (first, second))
    rows = [each.record() for each in differences(one.numbers, other.numbers)]
    return pd.DataFrame(rows, columns=["name", "first", "second", "difference", "relative"]
                        ).set_index("name")


@public()
def report(folder: File) -> list[Path]:
    """Rebuild the figures and pages of what was saved into a folder, and return them."""
    from tympan.reports.rebuild import rebuild

    with alone(Path(folder) if Path(folder).is_dir() else None):
        return rebuild(Path(folder))
