"""Functions of ``import tympan`` on an actuator; its parts are in :mod:`tympan.parts`."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict, TypeVar, Unpack

from tympan.base.errors import InputError as InputError
from tympan.base.fields import names_arguments, number, numbers
from tympan.base.process.folder import alone, temporary_folder
from tympan.base.process.threads import one_thread
from tympan.fem.film.library import LibraryMaterial, library_material, load_specimen
from tympan.fem.rig import Rig
from tympan.geometry.mesher import MeshSettings as MeshSettings
from tympan.geometry.specimen import Specimen
from tympan.result import Result as Result
from tympan.studies.case import Case as Case
from tympan.studies.case import CaseResult
from tympan.studies.case import Settings as Settings

if TYPE_CHECKING:
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
    from tympan.studies.study import StudyResult
    from tympan.studies.sweep.run import SweepResult
    from tympan.studies.tolerance.given import Tolerances
    from tympan.studies.tolerance.result import ToleranceResult
    from tympan.studies.trace import Responses

File = str | os.PathLike[str]
#: One load, or the lowest and the highest.
Masses = float | str | Sequence[float | str]
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

    mass: float | str
    voltage: float | str
    rig: Rig
    elapsed: float | str
    direction: float | Literal["up", "down", ""]
    pressure: float | str | None


def _case(specimen: Specimen, loads: Loads, settings: Settings) -> Case:
    """Build the case of loads, with the gas pressure on its rig."""
    from tympan.studies.limits import charged

    given: dict[str, Any] = {**loads}
    rig = given.pop("rig", Rig()).pressed(given.pop("pressure", None))
    voltage = given.pop("voltage", 0.0)
    return charged(Case(specimen, rig=rig, **given), voltage, settings)


@names_arguments()
def load(file: File) -> Specimen:
    """Load a specimen from a TOML file.

    Raises
    ------
    InputError
        When it is missing or wrong, naming file, key, what was given and what is allowed.
    """
    return load_specimen(Path(file))


@names_arguments()
def draw(specimen: Specimen, target: Axes | File | None = None) -> Axes:
    """Draw a specimen with its sizes on axes, into a file, or on new axes; return the axes."""
    from tympan.reports.plots import plot

    return plot(specimen, target)


@names_arguments()
def material(name: str) -> LibraryMaterial:
    """Load a material of the library, as ``tympan materials`` lists it with its source.

    A :class:`Film` made of it has what a specimen file's ``material = "name"`` sets: law, viscous
    branches, electric strength, and relative permittivity where the library lists one.

    Examples
    --------
    >>> material("vhb-4910").law, material("vhb-4910").relative_permittivity
    ('ogden', 4.7)
    """
    return library_material(name)


@names_arguments(Loads)
@one_thread()
def solve(specimen: Specimen, settings: Settings = Settings(), *,
          after: float | str | None = None, tolerances: Tolerances | File | None = None,
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
    case = _case(specimen, loads, settings)
    solved = solving.solve(case, settings, after, film=True)
    return Result(_banded(solved, specimen, tolerances, case.rig, settings), specimen)


def _banded(result: Solved, specimen: Specimen, tolerances: Tolerances | File | None,
            rig: Rig, settings: Settings) -> Solved:
    """Add bands to the result, where tolerances are given."""
    if tolerances is None:
        return result
    from tympan.studies.tolerance.bands import banded

    banded_result: Solved = banded(result, specimen, _tolerances(tolerances), rig, settings)
    return banded_result


def _tolerances(given: Tolerances | File) -> Tolerances:
    from tympan.studies.tolerance.given import Tolerances

    return given if isinstance(given, Tolerances) else Tolerances.read(Path(given))


@names_arguments(Loads)
@one_thread()
def limits(specimen: Specimen, settings: Settings = Settings(), *, beyond: bool = False,
           **loads: Unpack[Loads]) -> Result[LimitsResult]:
    """Compute limits of the voltage: loss of tension, breakdown, instability, pull-in.

    ``result.limits.limit`` is the first of them, with ``kind`` and ``voltage_V``. Without a mass
    one is chosen that suits the film. ``beyond``: continue to where no real film gets: far beyond
    its electric strength, and, where it gets thinner without limit, as if it could not wrinkle, to
    its pull-in.
    """
    from tympan.studies.limits import LimitsResult
    from tympan.studies.limits.loads import usual_masses

    case = _case(specimen, loads, settings)
    if specimen.plate is not None and "mass" not in loads:
        case = replace(case, mass=usual_masses(specimen, settings, case.rig)[0])
    return Result(LimitsResult.of(case, settings, beyond))


@names_arguments()
@one_thread()
def curve(specimen: Specimen, *masses: float | str, voltages: Sequence[float | str] = (),
          settings: Settings = Settings(), rig: Rig = Rig(), pressure: float | str | None = None,
          tolerances: Tolerances | File | None = None, beyond: bool = False
          ) -> Result[CurveResult]:
    """Compute deflection against voltage under each mass; by default under usual masses.

    Each curve goes to the film's end. ``voltages`` are additional rows.
    ``result.curves[0].limits.limit.voltage_V`` is the first limit under the first mass.
    ``tolerances`` as for :func:`solve`: then ``result.curves[0].band_deflection_m`` has the band of
    films at ``band_voltage_V``. ``beyond`` as for :func:`limits`.
    """
    from tympan.studies.limits.curve import curve
    from tympan.studies.limits.loads import usual_masses

    rig = rig.pressed(pressure)
    given = [Case(specimen, mass=mass).mass for mass in masses]
    usual = () if given else usual_masses(specimen, settings, rig) if specimen.plate else (0.0,)
    marked = sorted(Case(specimen, voltage=voltage).voltage
                    for voltage in numbers(voltages, "voltage", "voltages"))
    found = curve(specimen, given or usual, settings, rig, marked, beyond=beyond)
    return Result(_banded(found, specimen, tolerances, rig, settings))


@names_arguments()
@one_thread()
def force(specimen: Specimen, *, to: float | str, from_: float | str = 0.0,
          voltages: Sequence[float | str] = (0.0,), points: int = 61,
          loads: Sequence[float | str] = (), rate: float | str | None = None, cycles: int = 1,
          rig: Rig = Rig(), pressure: float | str | None = None, settings: Settings = Settings(),
          tolerances: Tolerances | File | None = None) -> Result[ForceResult]:
    """Compute the force on the plate against its displacement, a curve for each voltage.

    The plate is displacement-controlled, as in a tensile tester, at ``points`` positions between
    two displacements. ``loads`` are masses. With the rig's springs and other biases each is a line
    that crosses the curves at equilibria: ``result.loads[0].crossings``, ``result.stroke_m``,
    ``result.work_J``. ``result.blocked_force_N`` is the change of force of the held plate. With a
    ``rate``, such as "1 mm/s", the plate also moves out and back in time, in ``cycles``:
    ``result.loops[0].area_J`` are the areas of a film with viscous branches. ``tolerances`` as for
    :func:`solve`: then ``result.curves[0].band_force_N`` has the band of films.
    """
    from tympan.studies.force import ForceCase, force

    case = ForceCase(specimen, voltages=voltages, start=from_, to=to, points=points, masses=loads,
                     rate=rate, cycles=cycles, rig=rig.pressed(pressure))
    return Result(_banded(force(case, settings), specimen, tolerances, case.rig, settings))


@names_arguments()
@one_thread()
def sense(specimen: Specimen, *, voltages: Sequence[float | str] = (0.0,),
          masses: Sequence[float | str] = (), from_: float | str = 0.0,
          to: float | str | None = None, points: int = 21, rig: Rig = Rig(),
          pressure: float | str | None = None, settings: Settings = Settings()
          ) -> Result[SenseResult]:
    """Compute capacitance against deflection at several voltages, and the inverse.

    The plate is displaced between two deflections, or a little further than the ``masses`` deflect
    it. ``result.sensed(capacitance, voltage)`` is the deflection [m] by a polynomial with the
    largest error ``result.inverse.error_m``. ``to_pandas()`` is the table; it includes the change
    of the sensed deflection by an error of the capacitance, the prestretch and the permittivity.
    """
    from tympan.studies.sense import SenseCase, sense

    case = SenseCase(specimen, voltages=voltages, masses=masses, start=from_, to=to, points=points,
                     rig=rig.pressed(pressure))
    return Result(sense(case, settings))


@names_arguments()
@one_thread()
def tolerance(specimen: Specimen, tolerances: Tolerances | File | None = None, *,
              want: Mapping[str, object] | str = "",
              mass: float | str | None = None, voltage: float | str | None = None,
              films: int = 10_000, seed: int = 1, rig: Rig = Rig(),
              pressure: float | str | None = None, settings: Settings = Settings()
              ) -> Result[ToleranceResult]:
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
    case = ToleranceCase(specimen, mass=mass, voltage=voltage, tolerances=given,
                         wanted=asked_bounds(file, want), films=films, seed=seed,
                         rig=rig.pressed(pressure))
    return Result(tolerance(case, settings))


@names_arguments()
@one_thread()
def films_within(specimen: Specimen, tolerances: Tolerances | File | None = None, *,
                 mass: Masses = 0.0, voltage: float | str | None = None, films: int = 1000,
                 seed: int = 1, rig: Rig = Rig(), settings: Settings = Settings()) -> Population:
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
    scattered = Scattered.of(specimen, given)
    masses = numbers(mass, "mass", "mass")
    highest = (number(voltage, "voltage", "voltage") if voltage is not None else
               _above_limits(Case(specimen, mass=min(masses), rig=rig), settings))
    Case.greatest(specimen, masses, [highest], rig)  # refuses loads that no film bears
    if not 1 <= films <= _MOST_FILMS:
        raise InputError(f"must be a whole number from 1 to {_MOST_FILMS}", key="films",
                         given=films)
    if seed < 0:
        raise InputError("must be a whole number, 0 or more", key="seed", given=seed)
    return scattered.population((min(masses), max(masses)), highest,
                                drawn_points(scattered.inputs, films, seed), rig, settings)


def _above_limits(case: Case, settings: Settings) -> float:
    """Choose a voltage [V] above the first limits of films like a case's."""
    from tympan.studies.limits.voltages import first_limit
    from tympan.studies.tolerance.tolerance import ABOVE

    first = first_limit(case, settings)
    if first is None:
        raise InputError("must be given: the film without scatter has no first limit to choose it "
                         "by", key="voltage")
    return ABOVE * first.voltage_V


@names_arguments(Loads)
@one_thread()
def path(specimen: Specimen, along: Literal["voltage", "charge", "mass", "pressure"] = "voltage",
         settings: Settings = Settings(), *, rate: float | str | None = None,
         to: float | str | None = None, fields: bool = False, beyond: bool = False,
         **loads: Unpack[Loads]) -> Result[PathResult | Responses]:
    """Follow equilibria while one quantity grows from the loads on, through limit points.

    With a ``rate`` such as "100 V/s": a loop in time, up to a voltage ``to`` and down again, of a
    film with viscous branches; by default it turns at 95 % of the film's first limit. ``fields``:
    include the film of every state, or at 25 moments of a loop. ``beyond`` as for :func:`limits`.
    """
    from tympan import solving

    return Result(solving.follow(_case(specimen, loads, settings), settings, along, rate, to,
                                 fields, beyond))


@names_arguments(Waves)
@one_thread()
def transient(specimen: Specimen | Sequence[Specimen], signal: str = "step", *,
              mass: float | str | None = None, rest: float | str | None = None,
              swing: bool = False, films: Sequence[float | str] = (), states: bool = False,
              rig: Rig = Rig(), settings: Settings = Settings(), **wave: Unpack[Waves]
              ) -> Result[Responses]:
    """Simulate one film or several under a step, ramp, sine, random voltages, or a CSV file's.

    Before the signal the film rests under mass and first voltage for ``rest``, by default for ever,
    unless the film states when it was mounted. ``swing``: the plate has inertia; else it follows
    the film at once. The mass suits the film where none is given. ``result.responses[0]`` has the
    numbers, ``to_pandas()`` the samples at ``interval``; ``result.films[0]`` the film at each of
    the times ``films``. With ``states``, ``result.responses[0].states`` has the variables of the
    film's state at each sample, such as ``max_stretch``. Arguments of the signal: ``low`` and
    ``high`` voltage, ``duration`` of step, ramp, a random level or a period, ``count`` of levels or
    periods, and a ``seed``.
    """
    from tympan.studies.signals import Wave
    from tympan.studies.trace import sample_count
    from tympan.studies.transient import responses

    specimens = (specimen,) if isinstance(specimen, Specimen) else tuple(specimen)
    form = Wave(signal, **wave)
    voltages = form.signal()
    sample_count(voltages.end, form.interval, len(specimens))
    return Result(responses(specimens, form, voltages, settings, mass=mass, rest=rest, swing=swing,
                            films=numbers(films, "time", "films"), rig=rig, states=states))


@names_arguments(Loads)
@one_thread()
def modes(specimen: Specimen, count: int = 6, settings: Settings = Settings(), *,
          point_mass: float | str = 0.0, **loads: Unpack[Loads]) -> Result[ModesResult]:
    """Solve small vibrations about an equilibrium at constant voltage.

    ``point_mass``: part of the mass in the plate's centre; the rest is spread over the plate.
    """
    from tympan.studies.modes import modes

    return Result(modes(_case(specimen, loads, settings), settings, count,
                        number(point_mass, "mass", "point_mass")), specimen)


@names_arguments(Loads)
@one_thread()
def response(specimen: Specimen, *frequencies: float | str, settings: Settings = Settings(),
             **loads: Unpack[Loads]) -> Result[ResponseResult]:
    """Compute amplitude and phase of the deflection under a small sine of the voltage.

    ``frequencies`` are numbers [Hz] or texts; by default they suit the film.
    """
    from tympan.studies.response import response

    asked = numbers(frequencies, "frequency", "frequencies")
    return Result(response(_case(specimen, loads, settings), settings, asked), specimen)


@names_arguments(Loads)
@one_thread()
def sensitivity(specimen: Specimen, *quantities: str, settings: Settings = Settings(),
                **loads: Unpack[Loads]) -> Result[SensitivityResult]:
    """Differentiate named quantities, by default "heave", by all they depend on."""
    from tympan.studies.sensitivity import sensitivity

    return Result(sensitivity(_case(specimen, loads, settings), settings, quantities or ("heave",)))


@names_arguments()
@one_thread()
def alpha(specimen: Specimen, alpha_settings: AlphaSettings | None = None,
          settings: Settings = Settings(), rig: Rig = Rig(), *, circles: int = 2,
          radii: str = "semi_axes", uncertainty: bool = False) -> Result[AlphaResult]:
    """Compute weights of the circles that represent a specimen in a lumped model.

    ``circles``: their number; ``radii``: semi_axes, sectors or fit; ``alpha_settings`` may give the
    loads. ``uncertainty``: also compute how the weights change with mesh, material and loads.
    """
    from tympan.studies import alpha as study

    chosen = alpha_settings or study.AlphaSettings(circles=circles, radii=radii)
    result = study.alpha(specimen, settings, chosen, rig)
    if uncertainty:
        result = replace(result, uncertainty=study.uncertainty(specimen, settings, chosen, rig,
                                                               result))
    return Result(result)


@names_arguments()
@one_thread()
def sweep(file: File, folder: File | None = None, workers: int = 1,
          settings: Settings = Settings(), at: float | str | None = None, *,
          scheduler: str | None = None, wait: float | str = 60.0, exact: bool = False,
          tolerances: Tolerances | File | None = None) -> Result[SweepResult]:
    """Solve all cases of SWEEP.toml; cases stored in a ``folder`` are not solved again.

    Many specimens that differ in numbers alone are solved by a reduced film, with its error in each
    row; ``exact``: all by finite elements. ``tolerances`` as for :func:`solve`: then the table also
    has ``deflection_low_m`` and ``deflection_high_m``, 5 and 95 % of films.

    Its maps, and ``result.best("stroke", under="max_true_stress < 131 kPa")``, compare films ``at``
    one of its voltages, by default the highest. With more than one worker the calling script needs
    a main guard. ``scheduler``: the address of a Dask cluster that solves instead; it must have a
    worker within ``wait``.
    """
    from functools import partial

    from tympan.studies.parallel import processes, serial
    from tympan.studies.sweep.cluster import cluster
    from tympan.studies.sweep.plan import read_sweep
    from tympan.studies.sweep.run import run_sweep

    given = None if tolerances is None else _tolerances(tolerances)
    planned = read_sweep(Path(file), settings, exact, given)
    planned = planned if at is None else planned.compared_at(at)
    pool = serial if workers == 1 else partial(processes, workers=workers)
    if scheduler is not None:
        pool = partial(cluster, address=scheduler, wait=number(wait, "time", "wait"), say=print)
    with temporary_folder() as scratch, alone(Path(folder or scratch)):
        return Result(run_sweep(planned, Path(folder or scratch), pool))


@names_arguments()
@one_thread()
def study(file: File | None = None, *, tolerances: Tolerances | File | None = None
          ) -> Result[StudyResult]:
    """Run the study of STUDY.toml, by default of the paper's three actuators.

    ``tolerances`` as for :func:`solve`: then results, curves and forces have bands.
    """
    from tympan.studies.study import default_study, read_study, run_study

    planned = default_study() if file is None else read_study(Path(file))
    given = None if tolerances is None else _tolerances(tolerances)
    return Result(run_study(replace(planned, tolerances=given)))


@names_arguments()
def data(dataset: File) -> dict[str, Any]:
    """Summarise a dataset with warnings, as ``tympan data --json`` prints it."""
    from tympan.studies.data.checks import summary
    from tympan.studies.data.dataset import read_dataset

    return summary(read_dataset(Path(dataset)))


@names_arguments()
def draft(file: File, target: File | None = None, kind: str | None = None) -> Path:
    """Write a first dataset.toml for a table of yours, beside it or to a ``target``.

    Every line is a guess with its reason. ``kind``: "static", "transient", "force", "coupon",
    "frequency" or "range", where the guess is wrong.
    """
    from tympan.studies.data.draft import write_draft

    return write_draft(Path(file), None if target is None else Path(target), kind)


@names_arguments()
@one_thread()
def diagnose(dataset: File, workers: int = 1, seed: int = 0, *, self_check: int = 0,
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


@names_arguments()
@one_thread()
def plan(dataset: File, workers: int = 1, seed: int = 0, *, self_check: int = 0,
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


@names_arguments(CouponTable)
@one_thread()
def fit_material(*files: File, laws: Sequence[str] = (), noise: float | str | None = None,
                 branches: int | None = None, constants: Sequence[str] = (),
                 film: Case | None = None, settings: Settings = Settings(),
                 **table: Unpack[CouponTable]) -> Result[MaterialFitResult | FilmFit]:
    """Fit laws to coupon tests, or a film to readings of its actuators.

    ``files`` are one set of coupon tests; ``result.best`` is the law to take, ``result.fits`` are
    all laws. ``laws``: those to compare, by default all; ``noise``: standard deviation of one
    stress; ``film``: a case that is solved with the fitted laws, in
    ``result.numbers.numbers["film"]``. Or ``files`` is one folder of a dataset, whose law keeps its
    form: ``result.stiffness_factor`` and ``result.permittivity_factor`` have 95 % limits, and
    ``result.not_told`` names what the readings do not determine. ``constants``: keys of its law,
    such as ``["mu"]``, or ``["all"]``, that are fitted individually: ``result.law.constants``.
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
    for key, given in {"laws": laws, "noise": noise, "film": film, **table}.items():
        if given not in (None, ()):
            raise InputError("is for coupons: a dataset's specimens have their law and their noise",
                             key=key, given=str(given))
    dataset = by_formula(read_dataset(paths[0]), settings.formula)
    return Result(fit_film(dataset, branches, constants=constants))


@names_arguments()
@one_thread()
def design(requirements: Requirements | File | None = None, settings: Settings = Settings(),
           workers: int = 1) -> Result[DesignResult]:
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
    return Result(best_films(requirements, settings, workers=workers))


@names_arguments()
def optimise(file: File | None = None, settings: Settings = Settings()
             ) -> Result[DesignResult]:
    """Call :func:`design`, which replaces this former name."""
    return design(file, settings)


@names_arguments()
def materials() -> dict[str, LibraryMaterial]:
    """List the materials of the library by name, each with its source, for :func:`material`.

    Examples
    --------
    >>> materials()["vhb-4910"].law
    'ogden'
    """
    from tympan.fem.film.library import MATERIALS

    return dict(MATERIALS)


@names_arguments()
def show_material(name: str, held: float | None = None) -> Examination:
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


@names_arguments()
def effects() -> dict[str, Any]:
    """List effects a model may leave out, with units and priors, as ``tympan effects --json`` does.

    Examples
    --------
    >>> effects()["sensor_zero"]["on_one_specimen"]
    False
    """
    from tympan.studies.effects.listing import listing

    return listing()


@names_arguments(PartSizes)
def export(specimen: Specimen, folder: File, *, inp: bool = False,
           masses: float | str | Sequence[float | str] = (),
           voltages: float | str | Sequence[float | str] = (), pressure: float | str = 0.0,
           settings: Settings = Settings(), **sizes: Unpack[PartSizes]) -> list[Path]:
    """Write frame, clamp, plate, film and mesh into a folder, and return the files.

    As STEP, DXF, SVG and VTU; ``sizes`` are those of the parts. ``inp``: instead the film as input
    of CalculiX or Abaqus, a step for each of the ``masses``, then for each of the ``voltages``,
    above a gas of a ``pressure`` [Pa].
    """
    from tympan.geometry.cad.parts import PartOptions
    from tympan.studies.export import export, export_input

    settings.require_elements()
    carried, applied = numbers(masses, "mass", "masses"), numbers(voltages, "voltage", "voltages")
    if inp:
        return [export_input(specimen, settings.mesh, Path(folder), carried, sorted(applied),
                             number(pressure, "stress", "pressure"))]
    chosen = PartOptions(**{name: number(size, "length", name) for name, size in sizes.items()})
    return list(export(specimen, settings.mesh, Path(folder), chosen))


@names_arguments()
def report(folder: File) -> list[Path]:
    """Rebuild the figures and pages of what was saved into a folder, and return them."""
    from tympan.reports.rebuild import rebuild

    with alone(Path(folder) if Path(folder).is_dir() else None):
        return rebuild(Path(folder))
