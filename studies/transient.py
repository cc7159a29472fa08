"""Motion of a film under a voltage signal: creep, oscillation of its plate, charging."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, astuple, dataclass, field, replace
from itertools import islice
from math import inf
from typing import TYPE_CHECKING, Annotated

import numpy as np
import pandas as pd

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key, asks
from tympan.base.progress import ShareDone
from tympan.base.toml_reader import NON_NEGATIVE
from tympan.fem.equilibrium.newton import Solution
from tympan.fem.equilibrium.ramp import Outcome, Status
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.film.admissibility import failures
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.results.fields import node_fields
from tympan.fem.results.solved_states import SolvedStates
from tympan.fem.rig import Rig
from tympan.fem.transient.ends import SLACK, Followed, Stopped, status_of
from tympan.fem.transient.energy import Energy, EnergyBalance
from tympan.fem.transient.film_memory import relaxed_memory
from tympan.fem.transient.integrate import Moment, StepSettings, Transient
from tympan.geometry.specimen import Specimen, require_different_names
from tympan.studies.case import (
    Case,
    CaseResult,
    Settings,
    WallTime,
    breakdown_warning,
    build_model,
    deflection_without_voltage,
    failure_reason,
    summaries,
    with_surface,
)
from tympan.studies.film_surface import NO_SURFACE, FilmSurface, film_surface
from tympan.studies.limits.loads import usual_masses
from tympan.studies.limits.voltages import first_limit
from tympan.studies.modes import carried
from tympan.studies.motion import Trace
from tympan.studies.signals import Pieces, Signal, Supplied, Wave, nominal, ramp
from tympan.studies.trace import Response, Responses, unclosed, with_rest
from tympan.studies.variables import rows_of_variables

#: Voltage at which a loop turns, over that of the first limit, so that the film stays below it.
_NEAR_LIMIT = 0.95
#: Number of films of a loop that are kept where its fields are requested.
MOMENTS_OF_LOOP = 25
#: Number of samples of a loop, for a smooth line.
_SAMPLES = 2000

#: Errors of steps in time for a loop's runs, one after the other, until its area changes by no more
#: than ``_AREA``. The last run takes about 10 s where the loop is thin.
_LOOP_ERRORS = (1e-6, 1e-7, 1e-8)
#: Largest relative change of the area between the last two runs.
_AREA = 1e-3
#: Error of an area over its change from the run before: the finer run may err by as much.
_DOUBT = 2.0

#: Factor by which a deflection must grow to count as larger: at rest it changes by rounding alone.
_MORE = 1 + 1e-6

#: Number of values that are kept of each moment.
_NUMBERS = 6


@asks
@dataclass(frozen=True)
class TransientCase:
    """A specimen on a rig under a nominal ``mass`` [kg] and a signal of nominal voltages.

    Before the signal begins, it has rested under mass and first voltage for ``rest`` [s], by
    default for ever, or for 0 s if the film has a mounting time. ``inertia``: the plate has
    inertia; else it follows the film at once. Texts carry their unit.
    """

    specimen: Specimen
    signal: Signal
    _: KW_ONLY
    mass: Annotated[float, Key("nominal load on the plate", "mass")]
    rig: Rig = Rig()
    rest: Annotated[float | None, Key("under mass and first voltage before the signal", "time",
                                      NON_NEGATIVE)] = None
    inertia: bool = False
    steps: StepSettings = field(default_factory=StepSettings)

    if TYPE_CHECKING:
        def __init__(self, specimen: Specimen, signal: Signal, *, mass: float | str,
                     rig: Rig = Rig(), rest: float | str | None = None, inertia: bool = False,
                     steps: StepSettings = ...) -> None: ...

    def __post_init__(self) -> None:
        highest = self.highest  # raises InputError for loads that no film bears
        if self.inertia and highest.specimen.plate is None:
            raise InputError("must be left out: the film has no plate that swings, and moves "
                             "without inertia itself", key="--swing", given=self.specimen.name)
        if self.inertia and self.rig.guide == "fixed":
            raise InputError("must be left out: the guide holds the plate, and the film has no "
                             "inertia itself", key="--swing", given=self.rig.guide)
        if self.inertia and self.rig.moving_mass(self.mass) <= 0:
            raise InputError("must be positive where the plate swings: the film has no inertia",
                             key="mass", given=f"{self.mass:g} kg")

    @property
    def highest(self) -> Case:
        """Case at rest under the highest voltage of the signal."""
        return Case(self.specimen, mass=self.mass, voltage=self.signal.peak, rig=self.rig)

    @property
    def rested(self) -> float:
        """Time at rest under mass and first voltage before the signal [s]."""
        if self.rest is not None:
            return self.rest
        return inf if self.specimen.membrane.mounted is None else 0.0


@dataclass(frozen=True, eq=False)
class History(Trace):
    """History of a film by moment; after a jump of the voltage the same time appears twice.

    ``deflection`` [m], ``voltage`` across the film [V], ``capacitance`` [F], ``tilt`` [rad] and
    ``current`` into the electrodes [A] have the shape (moments,). ``before`` is the deflection when
    the signal began [m], 0 where the film had no load until then. ``stopped`` says where the motion
    ended early. ``slack`` is when the film first lost tension [s], None where it did not.
    ``balance`` is its energy balance. ``farthest`` is the time of the largest deflection [s];
    ``failures`` names breakdown there, and the criteria that the film's law fails there. ``states``
    has a row with time and variables for each of the times at which these were asked for.
    """

    deflection: Array
    voltage: Array
    capacitance: Array
    tilt: Array
    current: Array
    before: float
    stopped: Stopped | None
    slack: float | None
    balance: EnergyBalance
    farthest: float
    failures: list[str]
    films: dict[float, FilmSurface] = field(default_factory=dict)
    states: list[dict[str, float | None]] = field(default_factory=list)


def history(case: TransientCase, settings: Settings, films: tuple[float, ...] = (),
            progress: ShareDone = lambda share: None, states: Sequence[float] = ()) -> History:
    """Simulate the motion of a film, with its fields at some times [s].

    ``states``: times [s], ascending, at which its variables are computed. ``progress`` is called
    with the finished share of the signal.

    Raises
    ------
    InputError
        If the film has no equilibrium under the mass and the signal's first voltage.
    """
    transient, state, memory = begun(case, settings)
    model = transient.model
    past, slack = list[Moment](), None
    # Only numbers are kept: a signal read from a table may have millions of moments.
    record, energies = array("d"), array("d")
    farthest: Moment | None = None
    most = 0.0
    before = Energy.of(transient, Moment(0.0, state, memory))
    wanted, pictures = sorted(films), dict[float, FilmSurface]()
    shown, plate = list[dict[str, float | None]](), case.specimen.plate is not None
    followed = Followed(transient.moments(state, memory))
    for moment in followed:
        jumped = bool(past) and moment.time == past[-1].time
        past = [moment] if jumped else [*past[-2:], moment]
        deflected = abs(model.deflection(moment.state))
        if farthest is None or deflected > _MORE * most:
            farthest, most = moment, deflected
        record.extend(_numbers(model, moment))
        energies.extend(astuple(Energy.of(transient, moment)))
        progress(moment.time / case.signal.end)
        if slack is None and not model.in_tension(moment.state):
            slack = moment.time
        while wanted and wanted[0] <= moment.time:
            at = transient.moment_at(past, wanted[0])
            surface, time = film_surface(transient.remembering(at), at.state), wanted.pop(0)
            if surface is not None:
                pictures[time] = surface
        while len(shown) < len(states) and states[len(shown)] <= moment.time:
            at = transient.moment_at(past, states[len(shown)])
            found = SolvedStates(transient.remembering(at), [at.state])
            values, = rows_of_variables(found, plate=plate)
            shown.append({"t_s": at.time, **values})
    stopped = followed.stopped
    if farthest is None:
        reason = ((stopped and stopped.why)
                  or "the film has no equilibrium at once after the mass is put on")
        raise InputError(case.highest.doubted(reason), key="mass", given=f"{case.mass:g} kg")
    moments = np.frombuffer(record).reshape(-1, _NUMBERS)
    balance = EnergyBalance.of(np.frombuffer(energies).reshape(len(moments), -1), before)
    times, deflection, voltage, capacitance, tilt, current = moments.T.copy()
    if not transient.circuit.resistance:  # the source charges the film at once
        current = Trace(times).rates(capacitance * voltage)
    return History(times, deflection, voltage, capacitance, tilt, current, model.deflection(state),
                   stopped, slack, balance, farthest.time,
                   _failures(transient, farthest), pictures, shown)


def _failures(transient: Transient, moment: Moment) -> list[str]:
    """Word breakdown and failed criteria of the film's law at a moment, as for a film at rest."""
    fields, = node_fields(transient.remembering(moment), [moment.state])
    if not len(fields.position):
        return []
    weakest = int(np.argmax(fields.breakdown_share))
    x, y, _ = fields.position[weakest].tolist()
    return [*breakdown_warning(fields.breakdown_share[weakest], fields.electric_field[weakest],
                               fields.breakdown_strength[weakest], x, y),
            *failures(transient.model.specimen.membrane, fields.position, fields.stretch_1,
                      fields.stretch_2)]


def solve_after(case: Case, after: float, settings: Settings, film: bool = False) -> CaseResult:
    """Solve a case at a time [s] after its voltage was switched on; before it rests under the mass.

    A film with a mounting time is loaded with mass and voltage at once. ``film`` adds its fields on
    a surface. Its stresses include those of the viscous branches.
    """
    began = time.perf_counter()
    status: Status
    signal = Pieces(np.array([0.0, 0.0, after or 1.0]), np.array([0.0, *2 * [case.voltage]]))
    creep = TransientCase(case.specimen, signal, mass=case.mass, rig=case.rig)
    transient, state, memory = begun(creep, settings)
    moment, status, advice = Moment(0.0, state, memory), "equilibrium", ""
    followed = Followed(islice(transient.moments(state, memory), None if after else 1))
    for passed in followed:
        moment = passed
    if followed.stopped is not None:
        status, advice = "no_equilibrium", str(followed.stopped)
    model = transient.remembering(moment)
    outcome = Outcome(status, Solution(moment.state, True, 0, None), advice)
    (result, _), = summaries(model, [(case, outcome)])
    result = replace(result, warnings=(*result.warnings, *case.rig.in_motion))
    if (case.voltage and result.deflection_m is not None
            and creep.rested == inf):
        rest = transient.model.deflection(state)
        result = result.showing(stroke_m=result.deflection_m - rest)
    if film and status == "equilibrium":
        result = with_surface(result, film_surface(model, moment.state))
    return replace(result, wall_s=time.perf_counter() - began)


def _remarks(case: TransientCase) -> list[str]:
    """Collect the remarks of every result of a case in time."""
    return [*case.rig.in_motion, *case.highest.remarks]


def _at_once(case: TransientCase) -> tuple[str, ...]:
    """Remark on a film in which nothing takes time: it is in equilibrium at every moment."""
    plate, rig = case.specimen.plate, case.rig
    if (case.inertia or case.specimen.membrane.branches or rig.plate_damping
            or rig.circuit.resistance):
        return ()
    swings = plate is not None and rig.guide != "fixed"
    return ("the film has no viscous branches (membrane.branch), so it follows the voltage at once"
            + "; --swing (in Python swing=True) gives the plate its inertia" * swings,)


def begun(case: TransientCase, settings: Settings) -> tuple[Transient, State, Memory]:
    """Build the moving parts, and their state and memory when the signal begins."""
    rig = case.rig
    model = build_model(case.specimen, settings, rig.loading)
    force = float(rig.force(case.mass, model.plate_area))
    supplied = Supplied(case.signal, rig.source)
    first = float(rig.film_voltage(case.signal.first))
    plate = carried(Case(case.specimen, mass=case.mass, rig=rig)) if case.inertia else None
    transient = Transient(model, force, supplied, plate, rig.plate_damping,
                          rig.circuit, case.steps,
                          rig.gas_pressure)
    if case.rested == inf:
        outcome = equilibrium(model, force, first, rig.gas_pressure)
        if outcome.status != "equilibrium":
            raise InputError("must have an equilibrium under the signal's first voltage: "
                             f"{case.highest.doubted(failure_reason(outcome))}", key="mass",
                             given=f"{case.mass:g} kg")
        return transient, outcome.state, relaxed_memory(model, outcome.state)
    flat, memory = model.mounted(), Memory.mounted(case.specimen.membrane, model.volumes.shape)
    if not case.rested:
        return transient, flat, memory
    resting = Transient(model, force, Pieces(np.array([0.0, case.rested]), np.full(2, first)),
                        settings=case.steps, pressure=rig.gas_pressure)
    followed = Followed(resting.moments(flat, memory))
    moments = list(followed)
    if followed.stopped is not None:
        raise InputError("must leave the film at rest before the signal begins: pull-in after "
                         f"{followed.stopped.time:.4g} s", key="mass", given=f"{case.mass:g} kg")
    last = moments[-1]
    return transient, last.state, last.memory


def _numbers(model: Model, moment: Moment) -> tuple[float, ...]:
    """Compute the :data:`_NUMBERS` values that are kept of every moment."""
    state = moment.state
    return (moment.time, model.deflection(state), float(np.sqrt(state.voltage_squared)),
            float(model.capacitance(state)), state.plate.tilt, moment.current)


@dataclass(frozen=True, kw_only=True, eq=False)
class FieldResponse(Response):
    """Response of a film in time, computed with finite elements."""

    file = "transient.json"
    writer = "tympan transient -o"
    drawn = ("gif", "mp4")

    stroke_m: Annotated[float | None, Key(
        "largest deflection less that without voltage, in equilibrium under the same mass; none "
        "without voltage, or where the film did not rest before the signal")] = None
    lowest_s: Annotated[float, Key("when the deflection is smallest")]
    highest_s: Annotated[float, Key("when it is largest")]
    hysteresis_area_error_V_m: Annotated[float | None, Key(
        "how far off that may be, of `path --rate`: twice what two runs differ by")] = None
    highest_film_voltage_V: Annotated[float, Key("largest voltage across the film")]
    highest_current_A: Annotated[float, Key(
        "largest current into its electrodes, either way; without a series resistance not that of "
        "a jump")]
    energy: Annotated[EnergyBalance, Key("where the work has gone")]
    stopped_s: Annotated[float | None, Key("when it stopped before the end")]
    slack_s: Annotated[float | None, Key("when the film first lost tension")]
    steps: Annotated[int, Key("steps in time")]
    wall_s: WallTime


def respond(case: TransientCase, settings: Settings, interval: float, period: float | None = None,
            step: bool = False, films: tuple[float, ...] = (),
            progress: ShareDone = lambda share: None, states: bool = False
            ) -> tuple[FieldResponse, History]:
    """Simulate the response of a film, sampled at an interval [s].

    ``period`` is the signal's period [s], if it has one. ``step`` says that the signal is a step.
    ``progress`` is called with the finished share of the signal. ``states``: compute the state's
    variables at each sample.
    """
    began = time.perf_counter()
    done = history(case, settings, films, progress,
                   _sampled(case.signal.end, interval).tolist() if states else ())
    when = _sampled(done.end, interval)
    deflection = done.at(done.deflection, when)
    (low_s, low), (high_s, high) = done.extremes(done.deflection)
    warnings = _remarks(case)
    warnings += [f"at {done.farthest:.4g} s, where it deflects most, {words}"
                 for words in done.failures]
    if done.stopped is not None:
        warnings.append(str(done.stopped))
    if films and not done.films:
        warnings.append(NO_SURFACE)
    if done.slack is not None:
        warnings.append(SLACK.format(time=done.slack))
    loop = area = None
    if period is not None and done.stopped is None:
        loop, area = done.last_loop(case.signal, period, done.deflection)
        warnings += unclosed(loop)
    rest = _without_voltage(case, done, settings)
    return FieldResponse.of(
        case.signal, when, deflection, low, high, step and case.inertia,
        specimen=case.specimen.name, mass_kg=case.mass,
        status=status_of(done.stopped),
        stroke_m=None if rest is None else max(low, high, key=abs) - rest,
        lowest_s=low_s, highest_s=high_s, hysteresis_area_V_m=area,
        highest_film_voltage_V=float(done.voltage.max()),
        highest_current_A=float(np.abs(done.current).max()), energy=done.balance,
        stopped_s=None if done.stopped is None else done.stopped.time, slack_s=done.slack,
        steps=len(done.time), wall_s=time.perf_counter() - began, warnings=tuple(warnings),
        samples=_samples(case, done, when), loop=loop, films=done.films,
        states=pd.DataFrame(done.states, dtype=float).assign(specimen=case.specimen.name)
        if states else None), done


def _sampled(end: float, interval: float) -> Array:
    """Choose the times of samples up to an end [s]."""
    return np.linspace(0.0, end, max(2, round(end / interval) + 1))


def _without_voltage(case: TransientCase, done: History, settings: Settings) -> float | None:
    """Find the deflection at 0 V [m] of a film that rested until a signal with voltage began."""
    if case.rested != inf or not case.signal.peak:
        return None
    return (deflection_without_voltage(case.highest, settings) if case.signal.first
            else done.before)


def responses(specimens: Sequence[Specimen], wave: Wave, signal: Signal, settings: Settings, *,
              mass: float | str | None = None, rest: float | str | None = None,
              swing: bool = False, films: tuple[float, ...] = (), rig: Rig = Rig(),
              progress: Callable[..., None] = lambda *words, share=0.0: None,
              states: bool = False) -> Responses:
    """Simulate films' responses to the signal of a wave, sampled at the wave's interval.

    Each film bears the ``mass``, by default a mass that suits all films with a plate. ``films``
    holds the times [s] at which each film is kept; with ``states`` the state's variables are
    computed at each sample. ``progress`` is called with a specimen's name, then with the finished
    ``share`` of the signal.
    """
    def over(share: float) -> None:
        progress(share=share)

    require_different_names(specimens)
    usual = [usual_masses(specimen, settings, rig)[0] for specimen in specimens
             if mass is None and specimen.plate is not None]
    carried = min(usual, default=0.0) if mass is None else mass
    done = []
    for specimen in specimens:
        progress(specimen.name)
        load = 0.0 if mass is None and specimen.plate is None else carried
        case = TransientCase(specimen, signal, mass=load, rig=rig, rest=rest, inertia=swing)
        response, _ = respond(case, settings, wave.interval, wave.period, wave.kind == "step",
                              films, over, states)
        done.append(replace(response, warnings=(*response.warnings, *_at_once(case))))
    return Responses(tuple(done), tuple(specimens), rig)


def _samples(case: TransientCase, done: History, when: Array) -> pd.DataFrame:
    """Make rows of transient.csv at times [s], with the time that the film had rested."""
    sampled = when, nominal(case.signal, when), done.at(done.deflection, when)
    if case.rested:
        sampled = with_rest(case.signal, *sampled, done.before)
    time, voltage, deflection = sampled
    # Where the signal begins with a jump, a sample at rest may be added in front.
    added = len(time) - len(when)
    # The curve between moments may go below 0 by its rounding.
    film_voltage = np.append(np.repeat(float(case.rig.film_voltage(case.signal.first)), added),
                             np.maximum(done.at(done.voltage, when), 0.0))
    current = np.append(np.zeros(added), done.at(done.current, when))
    shown = case.rig.recorded(time, deflection)
    samples = pd.DataFrame({
        "specimen": case.specimen.name, "mass": case.mass, "run": "simulated", "t": time,
        "voltage": voltage, "displacement": shown, "film_voltage": film_voltage,
        "current": current})
    return samples if case.rested == inf else samples.assign(rest=case.rested)


def loop(case: Case, rate: float, turn: float | None, settings: Settings, films: int = 0
         ) -> Responses:
    """Raise the case's voltage at a rate [V/s] to ``turn`` [V], and lower it again.

    The default ``turn`` is 95 % of the film's first limit at rest. ``films`` is the number of films
    to keep, at equal times. The runs have ever shorter steps, until the loop's area differs by at
    most a thousandth between two of them. The result states this difference.
    """
    if turn is None:
        first = first_limit(case, settings)
        if first is None:
            raise InputError("must be given: the film has no limit to turn before", key="turn")
        turn = _NEAR_LIMIT * first.voltage_V
        if turn <= case.voltage:
            raise InputError(
                f"must be given: a loop turns at {100 * _NEAR_LIMIT:.0f} % of the film's first "
                f"limit, {first.words}, and this one begins at {case.voltage / 1e3:g} kV",
                key="turn")
    if not 0 < rate < inf:
        raise InputError("must be positive", key="rate", given=f"{rate:g} V/s")
    if not case.voltage < turn < inf:
        raise InputError("must be above the voltage where the loop begins, "
                         f"{case.voltage / 1e3:g} kV", key="turn", given=f"{turn / 1e3:g} kV")
    duration = 2 * (turn - case.voltage) / rate
    ramped = TransientCase(case.specimen, ramp(case.voltage, turn, duration), mass=case.mass,
                           rig=case.rig)
    moments = tuple(np.linspace(0.0, duration, films).tolist())
    before, began = np.nan, time.perf_counter()
    for error in _LOOP_ERRORS:
        shorter = replace(ramped, steps=replace(ramped.steps, error=error))
        response, _ = respond(shorter, settings, duration / _SAMPLES, duration, films=moments)
        area = response.hysteresis_area_V_m
        if area is None:  # the film pulls in: there is no loop
            break
        apart, before = _DOUBT * abs(area - before), area
        if np.isfinite(apart):
            response = replace(response, hysteresis_area_error_V_m=apart)
        if apart <= _AREA * abs(area):
            break
    return Responses((replace(response, wall_s=time.perf_counter() - began),))
