"""A controller run against a film, beside the same film without feedback."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.geometry.fields import Key, require, takes_units
from tympan.geometry.toml_reader import NON_NEGATIVE, POSITIVE
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.case import ChosenActuators
from tympan.studies.lumped.control.controller import Controller, ControllerState
from tympan.studies.lumped.control.design import design
from tympan.studies.lumped.control.loop import Margins
from tympan.studies.lumped.control.plants import LumpedPlant, Plant
from tympan.studies.lumped.control.result import (
    ControlledFilm,
    ControlResult,
    ControlStep,
    Disturbance,
    Limit,
    LoopMargins,
)
from tympan.studies.lumped.equilibria import rest, rest_curve
from tympan.studies.lumped.linear import Linear, linearise
from tympan.studies.lumped.remarks import origin
from tympan.studies.signals import Signal, nominal
from tympan.studies.trace import sample_count

Array = NDArray[np.float64]

#: Share of a step within which it has settled.
WITHIN = 0.02
#: Share of the settling time for which the voltage must be at an end of the supply to limit it.
_AT_END = 0.5
#: How near to an end of the supply a voltage counts as there, over its highest.
_NEAR = 1e-3
#: Samples of a settling that are too few to shape it.
_FEW = 10
#: A step of the wanted deflection over the travel that is worth a row.
_STEP = 1e-3
#: Mass that is put on the plate over that which is on it: in steps of the weight as films differ.
_DISTURBED = 0.05
#: Times in which a swing falls by a factor e that a disturbance is followed: to 1e-4.
_DECAYS = 10.0


@takes_units
@dataclass(frozen=True)
class ControlSettings:
    """Supply, sampling and sensor of a controller."""

    _: KW_ONLY
    supply: Annotated[float, Key("highest voltage of the supply; the lowest is 0", "voltage",
                                 POSITIVE)] = 7e3
    interval: Annotated[float, Key("sampling interval", "time", POSITIVE)] = 10e-3
    sensor_lag: Annotated[float, Key("time by which the sensor lags, by a factor e", "time",
                                     NON_NEGATIVE)] = 0.0

    if TYPE_CHECKING:
        def __init__(self, *, supply: float | str = 7e3, interval: float | str = 10e-3,
                     sensor_lag: float | str = 0.0) -> None: ...

    def __post_init__(self) -> None:
        require(self)


@dataclass(frozen=True, eq=False)
class Sensor:
    """A reading [m] that lags behind the deflection."""

    lag: float
    reading: Any

    def after(self, before: Any, now: Any, duration: float) -> Sensor:
        """The reading after the deflection went straight from one value to another."""
        if not self.lag:
            return replace(self, reading=now)
        behind = (now - before) / duration * self.lag
        left = np.exp(-duration / self.lag)
        return replace(self, reading=now - behind + (self.reading - before + behind) * left)


@dataclass(frozen=True, eq=False)
class LoopRun:
    """Samples of a loop: deflections [m] and voltages [V] at times [s], (times, …)."""

    time: Array
    wanted: Array
    deflection: Array
    voltage: Array


def closed_loop(controller: Controller, plant: Plant, before: float, wanted: Array,
                sensor_lag: float = 0.0, progress: Callable[[float], None] = lambda share: None
                ) -> LoopRun:
    """A plant that begins at rest, at each sample's wanted deflection [m], and ``before`` them.

    The voltage of a sample holds until the next.
    """
    reached, voltages = [], []
    begin = plant.deflection
    state = ControllerState.resting(before + 0 * begin, begin)
    sensor = Sensor(sensor_lag, begin)
    for number, each in enumerate(wanted):
        voltage, state = controller.voltage(state, each + 0 * begin, sensor.reading)
        reached.append(plant.deflection)
        voltages.append(voltage)
        before = plant.deflection
        plant = plant.after(voltage, controller.interval_s)
        sensor = sensor.after(before, plant.deflection, controller.interval_s)
        progress((number + 1) / len(wanted))
    time = _times(len(wanted), controller.interval_s)
    return LoopRun(time, wanted, np.array(reached), np.array(voltages))


def open_loop(plant: Plant, wanted: Array, voltage: Array, interval: float) -> LoopRun:
    """The same under given voltages [V], without feedback."""
    reached = []
    for each in voltage:
        reached.append(plant.deflection)
        plant = plant.after(each, interval)
    return LoopRun(_times(len(wanted), interval), wanted, np.array(reached), voltage)


def controlled(chosen: ChosenActuators, signal: Signal, settings: ControlSettings,
               progress: Callable[..., None] = lambda *words, share=0.0: None) -> ControlResult:
    """Controllers of actuators, run so that they follow the rests at a signal's voltages.

    ``progress`` is called with a specimen's name, then with the ``share`` of its run.
    """
    if not 0 <= signal.peak <= settings.supply:
        raise InputError("must be within the supply", key="high", given=f"{signal.peak / 1e3:g} kV")
    count = sample_count(signal.end, settings.interval, len(chosen.actuators))
    films = []
    for actuator in chosen.actuators:
        progress(actuator.specimen.name)
        if not actuator.viscous.eta2 and not actuator.rig.plate_damping:
            raise InputError("must have viscous constants: nothing damps the swing of its plate",
                             key=actuator.specimen.name)
        films.append(_controlled(chosen, actuator, signal, settings, count,
                                 lambda share: progress(share=share)))
    return ControlResult(tuple(films))


def _controlled(chosen: ChosenActuators, actuator: Actuator, signal: Signal,
                settings: ControlSettings, count: int, progress: Callable[[float], None]
                ) -> ControlledFilm:
    designed = design(actuator, settings.supply, settings.interval, settings.sensor_lag)
    controller = designed.controller
    time = _times(count, settings.interval)
    voltages = np.abs(nominal(signal, time))
    wanted = rest_curve(actuator, voltages)
    begin = LumpedPlant.resting(actuator, abs(signal.first))
    before = float(begin.deflection)
    run = closed_loop(controller, begin, before, wanted, settings.sensor_lag, progress)
    free = open_loop(begin, wanted, voltages, settings.interval)
    ends = [linearise(actuator, voltage, by="U2") for voltage in (0.0, settings.supply)]
    swings = [_swing(each) for each in ends]
    return ControlledFilm(
        specimen=actuator.specimen.name, mass_kg=float(actuator.mass), controller=controller,
        margins=_margins(designed.margins),
        travel_m=(controller.inverse.lowest_m, controller.inverse.highest_m),
        swing_Hz=(swings[0][0], swings[1][0]), damping_ratio=(swings[0][1], swings[1][1]),
        creep_share=(_creep(ends[0])[0], _creep(ends[1])[0]),
        creep_s=(_creep(ends[0])[1], _creep(ends[1])[1]),
        lowest_V=float(run.voltage.min()), highest_V=float(run.voltage.max()),
        error_rms_m=_rms(run), open_error_rms_m=_rms(free),
        steps=tuple(_steps(run, free, controller, before)),
        disturbance=_disturbed(controller, actuator, settings),
        warnings=(*chosen.remarks, *origin(actuator), *actuator.case(settings.supply).remarks),
        samples=pd.DataFrame({
            "specimen": actuator.specimen.name, "t": time, "wanted": wanted,
            "displacement": run.deflection, "voltage": run.voltage,
            "open_displacement": free.deflection, "open_voltage": free.voltage}))


def _times(count: int, interval: float) -> Array:
    """Times of samples [s]."""
    return np.asarray(interval * np.arange(count), float)


def _rms(run: LoopRun) -> float:
    return float(np.sqrt(np.mean((run.wanted - run.deflection) ** 2)))


def _margins(found: Margins) -> LoopMargins:
    def limit(value: float) -> float | None:
        return value if np.isfinite(value) else None

    return LoopMargins(gain=limit(found.gain), phase_deg=limit(found.phase),
                       delay_s=limit(found.delay), sensitivity=found.sensitivity)


def _swing(linear: Linear) -> tuple[float, float]:
    """Frequency [Hz] and damping ratio of the plate's swing."""
    pole = max((pole for pole in linear.named_poles if "creep" not in pole.name),
               key=lambda pole: abs(pole.value))
    return pole.frequency, pole.damping_ratio


def _creep(linear: Linear) -> tuple[float, float | None]:
    """Share of the gain that creeps, and the slowest time [s]."""
    poles = [pole for pole in linear.named_poles if pole.name == "creep"]
    return (sum(pole.share or 0.0 for pole in poles),
            max((pole.time or 0.0 for pole in poles), default=None))


def settled(deflection: Array, wanted: float, band: float, interval: float) -> float | None:
    """Time after which deflections stay in a band [m] about one; None where they do not."""
    away = np.flatnonzero(~(np.abs(deflection - wanted) <= band))
    if len(away) and away[-1] == len(deflection) - 1:
        return None
    return float(interval * (away[-1] + 1)) if len(away) else 0.0


def _steps(run: LoopRun, free: LoopRun, controller: Controller, before: float
           ) -> Sequence[ControlStep]:
    """Where the wanted deflection jumps, and what follows until it jumps again."""
    travel = controller.inverse.highest_m - controller.inverse.lowest_m
    heights = np.diff(run.wanted, prepend=before)
    jumps = np.flatnonzero(np.abs(heights) > _STEP * travel)
    found = []
    for start, end in zip(jumps, [*jumps[1:], len(run.wanted)], strict=True):
        if np.ptp(run.wanted[start:end]) > _STEP * travel or end - start < 2:
            continue  # no step, but a part of a curve
        height, target = float(heights[start]), float(run.wanted[start])
        part = slice(start, end)
        times = [settled(each.deflection[part], target, WITHIN * abs(height),
                         controller.interval_s) for each in (run, free)]
        length = controller.interval_s * float(end - start)
        ratio = None if times[0] is None else (times[1] or length) / max(
            times[0], controller.interval_s)
        beyond = np.sign(height) * (run.deflection[part] - target) / abs(height)
        found.append(ControlStep(
            start_s=float(run.time[start]), from_m=target - height, to_m=target,
            settled_s=times[0], open_settled_s=times[1], times_as_soon=ratio,
            overshoot=max(0.0, float(beyond.max())),
            limited_by=_limit(run, part, times[0], controller, target, abs(height))))
    return found


def _limit(run: LoopRun, part: slice, time: float | None, controller: Controller, target: float,
           height: float) -> Limit:
    count = part.stop - part.start if time is None else max(round(time / controller.interval_s), 1)
    voltage = run.voltage[part][:count]
    top = controller.supply_V
    if np.mean((voltage < _NEAR * top) | (voltage > (1 - _NEAR) * top)) > _AT_END:
        return "supply"
    if count < _FEW:
        return "sampling"
    # A swing leaves the band on both sides, or on its last way back; creep on one side alone.
    error = (run.deflection[part][:count] - target) / height
    late = error[count // 2:]
    return "swing" if (late > 0).any() and (late < 0).any() else "creep"


def _disturbed(controller: Controller, actuator: Actuator, settings: ControlSettings
               ) -> Disturbance:
    """A mass put on the plate in the middle of its travel, until the swing is over."""
    inverse = controller.inverse
    voltage = float(np.sqrt(inverse.squared((inverse.lowest_m + inverse.highest_m) / 2)))
    begin = LumpedPlant.resting(actuator, voltage)
    target, mass = float(begin.deflection), _DISTURBED * float(actuator.moved)
    heavier = replace(actuator, mass=actuator.mass + mass)
    swing, ratio = _swing(linearise(heavier, voltage, by="U2"))
    length = _DECAYS / (2 * np.pi * swing * ratio or controller.integral_per_s)
    run = closed_loop(controller, LumpedPlant(heavier, begin.state), target,
                      np.full(int(length / controller.interval_s) + 1, target),
                      settings.sensor_lag)
    shifted = rest(heavier, voltage) - target
    return Disturbance(mass_kg=mass, open_m=shifted,
                       largest_m=float(np.abs(run.deflection - target).max()),
                       settled_s=settled(run.deflection, target, WITHIN * abs(shifted),
                                         controller.interval_s))
