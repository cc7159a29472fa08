"""A controller run against a film, and the same film without feedback for comparison."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

import numpy as np
import pandas as pd

from tympan.base.arrays import Array
from tympan.base.errors import InputError, VoltageError
from tympan.base.fields import Key, asks
from tympan.base.progress import Progress, ShareDone
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE
from tympan.fem.rig import Sensor
from tympan.studies.case import Settings
from tympan.studies.lumped.actuator import Actuator, Viscous
from tympan.studies.lumped.case import ChosenActuators, LumpedCase
from tympan.studies.lumped.control.controller import Controller, Method
from tympan.studies.lumped.control.design import ControllerDesign, design_controller
from tympan.studies.lumped.control.result import (
    ControlledFilm,
    ControlledFilms,
    ControlLimit,
    ControlResult,
    ControlStep,
    Disturbance,
    LoopMargins,
)
from tympan.studies.lumped.equilibria import rest_curve
from tympan.studies.lumped.export.fmu import require_compiler
from tympan.studies.lumped.in_time import InTime
from tympan.studies.lumped.linear import Linear, linearise
from tympan.studies.lumped.plants import Plant
from tympan.studies.sense.inverse import Inverse, fit_inverse
from tympan.studies.sense.inverse import SampledCurve as CapacitanceCurve
from tympan.studies.signals import Signal, nominal
from tympan.studies.trace import sample_count

#: Band of a settled step, over the step's height.
WITHIN = 0.02
#: Smallest share of the settling time for which the supply must be needed, to count as the limit.
_NEEDED = 0.5
#: Number of samples below which a settling is limited by the sampling.
_FEW = 10
#: Smallest step of the wanted deflection that gets a row, over the travel.
_STEP = 1e-3
#: Mass that is put on the plate, over the moving mass: about the spread of the weight between
#: films.
_DISTURBED = 0.05
#: Number of random films on which the loop is tried.
_FILMS = 1000
#: Standard deviation of stiffness and permittivity of random films: the usual spread in a workshop.
_FILM_SCATTER = 0.1
#: Standard deviation of the mass on random films: weights of one set and glue.
_MASS_SCATTER = 0.05
#: Standard deviation of the viscous constants of random films, which are the least known.
_VISCOUS_SCATTER = 0.2
#: Duration of a disturbance's run, over the time in which a swing falls by a factor e: to 1e-4.
_DECAYS = 10.0
#: Most samples of a disturbance's run: some seconds of computing.
_LONGEST = 20_000


#: Largest deflection with known capacitance, over the highest at rest: a swing overshoots the rest.
_SENSED = 1.5
#: Capacitances of the curve that the deflection is computed from; every other one tests the fit.
_CAPACITANCES = 401

#: Quantity that a sensor reads.
Measured = Literal["deflection", "capacitance"]


@asks
@dataclass(frozen=True)
class ControlSettings:
    """Supply, sampling, sensor and method of a controller."""

    _: KW_ONLY
    supply: Annotated[float, Key("highest voltage of the supply; the lowest is 0", "voltage",
                                 POSITIVE)] = 7e3
    interval: Annotated[float, Key("sampling interval", "time", POSITIVE)] = 10e-3
    sensor_lag: Annotated[float | None, Key(
        "time by which the sensor lags, by a factor e; left out, the rig's", "time",
        NON_NEGATIVE)] = None
    method: Annotated[Method, Key("how the controller is designed")] = "pi"
    sensor: Annotated[Measured, Key("what is read")] = "deflection"
    fmu: Annotated[bool, Key("whether controllers are stored as FMUs, too")] = False

    if TYPE_CHECKING:
        def __init__(self, *, supply: float | str = 7e3, interval: float | str = 10e-3,
                     sensor_lag: float | str | None = None, method: Method = "pi",
                     sensor: Measured = "deflection", fmu: bool = False) -> None: ...

    def __post_init__(self) -> None:
        for key, allowed in (("method", get_args(Method)), ("sensor", get_args(Measured))):
            if getattr(self, key) not in allowed:
                raise InputError("must be one of " + ", ".join(allowed), key=key,
                                 given=getattr(self, key))

    @property
    def usual_high(self) -> float:
        """Default upper end of a signal [V]: as much of the supply is left above it."""
        return self.supply / 2

    def lag(self, sensor: Sensor) -> float:
        """Find the time by which a rig's sensor lags [s], if no other is given."""
        return sensor.sensor_lag if self.sensor_lag is None else self.sensor_lag


@dataclass(frozen=True, eq=False)
class LoopRun:
    """Samples of a loop: deflections [m] and voltages [V] at times [s], (times, …).

    ``plants`` holds the plants at the requested samples.
    """

    time: Array
    wanted: Array
    deflection: Array
    voltage: Array
    plants: Mapping[int, Any] = field(default_factory=dict)


def closed_loop(controller: Controller, plant: Plant, before: float, wanted: Array,
                sensor_lag: float = 0.0, progress: ShareDone = lambda share: None,
                keep: Container[int] = (), sensed: Inverse | None = None) -> LoopRun:
    """Run a controller on a plant that begins at rest, with a wanted deflection [m] per sample.

    ``before`` is the wanted deflection before the first sample. The voltage of a sample holds until
    the next. ``keep`` lists the samples at which the plant is kept. ``sensed`` computes the
    deflection from the capacitance, where the sensor reads capacitance.
    """
    def read(plant: Plant) -> Any:
        if sensed is None:
            return plant.deflection
        told = sensed.deflection(plant.capacitance, 0.0)
        return np.where(np.isnan(told), controller.inverse.highest_m, told)  # as in the C code

    reached, voltages, plants = [], [], dict[int, Plant]()
    begin = read(plant)
    state = controller.resting(before + 0 * begin, begin)
    sensor, shown = Sensor(sensor_lag=sensor_lag), begin
    for number, each in enumerate(wanted):
        voltage, state = controller.voltage(state, each + 0 * begin, shown)
        reached.append(plant.deflection)
        voltages.append(voltage)
        if number in keep:
            plants[number] = plant
        before = read(plant)
        plant = plant.after(voltage, controller.interval_s)
        shown = sensor.lagged(shown, before, read(plant), controller.interval_s)
        progress((number + 1) / len(wanted))
    time = _times(len(wanted), controller.interval_s)
    return LoopRun(time, wanted, np.array(reached), np.array(voltages), plants)


def supplied(case: LumpedCase, control: ControlSettings, settings: Settings,
             progress: Progress = lambda words: None) -> ChosenActuators:
    """Choose the actuators, valid up to the highest voltage of the supply.

    Raises
    ------
    VoltageError
        Where a film does not bear that voltage.
    """
    try:
        return case.chosen(control.supply, settings, progress)
    except VoltageError as error:
        raise VoltageError(
            f"{error.allowed}. The film must bear the highest voltage of the supply, "
            f"{control.supply / 1e3:g} kV: give a lower one as supply", key=error.key,
            given=error.given) from None


def controlled(chosen: ChosenActuators, signal: Signal, settings: ControlSettings,
               progress: Callable[..., None] = lambda *words, share=0.0: None) -> ControlResult:
    """Design and run actuators' controllers that follow the deflections at a signal's voltages.

    The wanted deflections are those at rest. ``progress`` is called with a specimen's name, then
    with the ``share`` of its run.
    """
    if not 0 <= signal.peak <= settings.supply:
        raise InputError("must be within the supply", key="high", given=f"{signal.peak / 1e3:g} kV")
    if settings.fmu:
        require_compiler()
    count = sample_count(signal.end, settings.interval, len(chosen.actuators))
    films = []
    for actuator in chosen.actuators:
        progress(actuator.specimen.name)
        if not actuator.viscous.eta2 and not actuator.rig.plate_damping:
            raise InputError("must have viscous constants, or its rig plate_damping: nothing damps "
                             "the swing of its plate", key=actuator.specimen.name)
        films.append(_controlled(chosen.in_time(actuator), signal, settings, count,
                                 chosen.remarks, lambda share: progress(share=share)))
    return ControlResult(tuple(films), settings.fmu)


def _controlled(driven: InTime, signal: Signal, settings: ControlSettings, count: int,
                remarks: tuple[str, ...], progress: ShareDone) -> ControlledFilm:
    """Design a controller on an actuator's circles and run it on the actuator in time."""
    actuator = driven.circles(settings.supply / 2)
    lag = settings.lag(actuator.rig)
    designed = design_controller(actuator, settings.supply, settings.interval, lag, settings.method)
    controller = designed.controller
    time = _times(count, settings.interval)
    voltages = np.abs(nominal(signal, time))
    wanted = rest_curve(actuator, voltages)
    begin = driven.resting(abs(signal.first))
    before = float(rest_curve(actuator, abs(signal.first)))
    parts = _parts(wanted, before, controller)
    sensed = _sensed(actuator, controller) if settings.sensor == "capacitance" else None
    run = closed_loop(controller, begin, before, wanted, lag, progress,
                      {part.start for part in parts}, sensed)
    free = LoopRun(time, wanted, driven.driven(signal, time), voltages)
    ends = [linearise(actuator, voltage, by="U2") for voltage in (0.0, settings.supply)]
    swings = [_swing(each) for each in ends]
    return ControlledFilm(
        specimen=actuator.specimen.name, mass_kg=float(actuator.mass), controller=controller,
        margins=LoopMargins.of(designed.margins),
        travel_m=(controller.inverse.lowest_m, controller.inverse.highest_m),
        swing_Hz=(swings[0][0], swings[1][0]), damping_ratio=(swings[0][1], swings[1][1]),
        creep_share=(_creep(ends[0])[0], _creep(ends[1])[0]),
        creep_s=(_creep(ends[0])[1], _creep(ends[1])[1]),
        lowest_V=float(run.voltage.min()), highest_V=float(run.voltage.max()),
        error_rms_m=_rms(run), open_error_rms_m=_rms(free),
        steps=tuple(_step(run, free, controller, part, before) for part in parts),
        scattered=_scattered(designed, actuator),
        sensed=sensed, disturbance=_disturbed(controller, actuator, begin, settings, sensed),
        warnings=(*remarks, *driven.origin, *actuator.rig.in_motion,
                  *actuator.case(settings.supply).remarks),
        samples=pd.DataFrame({
            "specimen": actuator.specimen.name, "t": time, "wanted": wanted,
            "displacement": run.deflection, "voltage": run.voltage,
            "open_displacement": free.deflection, "open_voltage": free.voltage}))


def _sensed(actuator: Actuator, controller: Controller) -> Inverse:
    """Fit the deflection as a function of the circles' capacitance, from the flat film on."""
    y = np.linspace(0.0, _SENSED * controller.inverse.highest_m, _CAPACITANCES)
    return fit_inverse([CapacitanceCurve(0.0, y, actuator.capacitance(y))], [], [])


def scattered_films(actuator: Actuator, count: int, seed: int = 0) -> Actuator:
    """Draw films that differ in stiffness, permittivity, mass and viscous constants.

    Each quantity is multiplied by a factor whose logarithm is normally distributed.
    """
    made, viscous = np.random.default_rng(seed), actuator.viscous

    def factor(deviation: float) -> Array:
        return np.exp(deviation * made.normal(size=count))

    return replace(
        actuator, stiffness=actuator.stiffness * factor(_FILM_SCATTER),
        permittivity=actuator.permittivity * factor(_FILM_SCATTER),
        mass=actuator.mass * factor(_MASS_SCATTER), viscous=Viscous(
            *(each * factor(_VISCOUS_SCATTER)
              for each in (viscous.k1, viscous.eta1, viscous.eta2))))


def _scattered(designed: ControllerDesign, actuator: Actuator) -> ControlledFilms:
    poles = designed.largest_pole(scattered_films(actuator, _FILMS))
    return ControlledFilms(films=_FILMS, stable=int((poles < 1).sum()))


def _times(count: int, interval: float) -> Array:
    """Compute the times of samples [s]."""
    return np.asarray(interval * np.arange(count), float)


def _rms(run: LoopRun) -> float:
    return float(np.sqrt(np.mean((run.wanted - run.deflection) ** 2)))


def _swing(linear: Linear) -> tuple[float, float]:
    """Find the frequency [Hz] and the damping ratio of the plate's swing."""
    pole = max((pole for pole in linear.named_poles
                if "creep" not in pole.name and pole.name != "charging"),
               key=lambda pole: abs(pole.value))
    return pole.frequency, pole.damping_ratio


def _creep(linear: Linear) -> tuple[float, float | None]:
    """Find the share of the gain that creeps, and the slowest time [s]."""
    poles = [pole for pole in linear.named_poles if pole.name == "creep"]
    return (sum(pole.share or 0.0 for pole in poles),
            max((pole.time or 0.0 for pole in poles), default=None))


def settled(deflection: Array, wanted: float, band: float, interval: float) -> float | None:
    """Find the time after which deflections stay in a band [m] about a target; else None."""
    away = np.flatnonzero(~(np.abs(deflection - wanted) <= band))
    if len(away) and away[-1] == len(deflection) - 1:
        return None
    return float(interval * (away[-1] + 1)) if len(away) else 0.0


def _parts(wanted: Array, before: float, controller: Controller) -> Sequence[slice]:
    """Split the samples at jumps of the wanted deflection; keep parts where it is constant."""
    least = _STEP * (controller.inverse.highest_m - controller.inverse.lowest_m)
    jumps = np.flatnonzero(np.abs(np.diff(wanted, prepend=before)) > least).tolist()
    return [slice(start, end) for start, end in pairwise([*jumps, len(wanted)])
            if end - start > 1 and np.ptp(wanted[start:end]) <= least]


def _step(run: LoopRun, free: LoopRun, controller: Controller,
          part: slice, before: float) -> ControlStep:
    interval, target = controller.interval_s, float(run.wanted[part.start])
    height = target - (float(run.wanted[part.start - 1]) if part.start else before)
    band = WITHIN * abs(height)
    time, open_time = (settled(each.deflection[part], target, band, interval)
                       for each in (run, free))
    length = interval * (part.stop - part.start)
    soonest = _soonest(run.plants[part.start], target, height, controller, length)
    beyond = np.sign(height) * (run.deflection[part] - target) / abs(height)
    return ControlStep(
        start_s=float(run.time[part.start]), from_m=target - height, to_m=target, settled_s=time,
        open_settled_s=open_time, soonest_s=soonest,
        times_as_soon=None if time is None else (open_time or length) / max(time, interval),
        overshoot=max(0.0, float(beyond.max())),
        limited_by=_limit(run.deflection[part] - target, time, soonest, interval))


def _soonest(plant: Plant, target: float, height: float, controller: Controller,
             length: float) -> float | None:
    """Find the time [s] until the supply at its end can hold the plate in the settled band.

    No voltage within the supply makes the film creep faster, except a voltage that swings the plate
    by millimetres on a long way down. The plate's swing is left out because it decays. None where
    the supply needs longer than the step lasts.
    """
    near, up = target - WITHIN * height, height > 0
    voltage = controller.supply_V if up else 0.0
    for number in range(round(length / controller.interval_s)):
        if bool(plant.holds(near, voltage)) == up:
            return number * controller.interval_s
        plant = plant.after(voltage, controller.interval_s)
    return None


def _limit(missed: Array, time: float | None, soonest: float | None, interval: float
           ) -> ControlLimit:
    """Find the limit of a step whose distance from its target is ``missed`` [m]."""
    if soonest is None or soonest > _NEEDED * (len(missed) * interval if time is None else time):
        return "supply"
    count = len(missed) if time is None else max(round(time / interval), 1)
    if count < _FEW:
        return "sampling"
    # A swing leaves the band on both sides, or on its last way back; creep leaves it on one side.
    late = missed[:count][count // 2:]
    return "swing" if (late > 0).any() and (late < 0).any() else "creep"


def _disturbed(controller: Controller, actuator: Actuator, plant: Plant,
               settings: ControlSettings, sensed: Inverse | None) -> Disturbance:
    """Run the loop with a mass put on the plate in mid-travel, until swing and loop settle."""
    inverse = controller.inverse
    voltage = float(np.sqrt(inverse.squared((inverse.lowest_m + inverse.highest_m) / 2)))
    begin, mass = plant.rested(voltage), _DISTURBED * float(actuator.moved)
    target, heavier = float(begin.deflection), begin.under(actuator.mass + mass)
    swing, ratio = _swing(linearise(replace(actuator, mass=actuator.mass + mass), voltage,
                                    by="U2"))
    rates = filter(None, (2 * np.pi * swing * ratio, controller.integral_per_s))
    count = 1 + int(min(_DECAYS / min(rates) / controller.interval_s, _LONGEST))
    run = closed_loop(controller, heavier, target,
                      np.full(count, target),
                      settings.lag(actuator.rig), sensed=sensed)
    shifted = float(heavier.rested(voltage).deflection) - target
    return Disturbance(mass_kg=mass, open_m=shifted,
                       largest_m=float(np.abs(run.deflection - target).max()),
                       settled_s=settled(run.deflection, target, WITHIN * abs(shifted),
                                         controller.interval_s))
