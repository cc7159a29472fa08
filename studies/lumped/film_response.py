"""Response of a model with a reduced film to a signal, sampled as all responses are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.progress import ShareDone
from tympan.fem.equilibrium.newton import WORK, Budget
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.rig import Rig, checked_load
from tympan.fem.transient.ends import Followed, Stopped, status_of
from tympan.studies.case import Case, Settings, solved_loading
from tympan.studies.films.driven_film import ERROR, ReducedMoment
from tympan.studies.films.film import NoBalance, ReducedFilm
from tympan.studies.films.motion import ReducedMotion
from tympan.studies.lumped.model_file import LumpedModel
from tympan.studies.lumped.simulate import ModelResponse
from tympan.studies.motion import Trace
from tympan.studies.signals import JointSignal, Signal, Supplied, nominal
from tympan.studies.trace import unclosed


def film_deflections(film: ReducedFilm, signals: Sequence[Signal], masses: Sequence[float],
                     when: Array, rig: Rig = Rig(), inertia: bool = False) -> Array:
    """Simulate the deflections [m] at times [s] of many runs, each under a signal and a mass [kg].

    Shape (runs, times); nan from the time on at which a film pulls in. The signals must have the
    same breaks, so that the runs share their steps: thirty runs cost about as much as three single
    ones. ``inertia``: the plates have inertia.
    """
    motions = [film_motion(film, signal, mass, rig, inertia)
               for signal, mass in zip(signals, masses, strict=True)]
    return _deflections(motions, when)


def _deflections(motions: Sequence[ReducedMotion], when: Array) -> Array:
    first, *others = motions
    together = first if not others else replace(
        first, force=np.array([motion.force for motion in motions]),
        signal=JointSignal([motion.signal for motion in motions]))
    try:
        followed = Followed(together.moments())
    except NoBalance:
        followed = Followed((), Stopped("pull_in", 0.0))
    moments = list(followed)
    if followed.stopped is not None and others:
        half = len(motions) // 2
        return np.concatenate([_deflections(motions[:half], when),
                               _deflections(motions[half:], when)])
    if len(moments) < 2:
        return np.full((1, len(when)), np.nan)
    time = np.array([moment.time for moment in moments])
    deflections = np.array([moment.deflection for moment in moments]).reshape(len(time), -1)
    return Trace(time).at(deflections, when).T


def film_motion(film: ReducedFilm, signal: Signal, mass: float, rig: Rig = Rig(),
                inertia: bool = False, error: float = ERROR, budget: Budget | None = None
                ) -> ReducedMotion:
    """Put a reduced film in motion under a nominal mass [kg] and a signal on a rig.

    ``inertia``: the plate has inertia.

    Raises
    ------
    InputError
        When the rig has a part that the reduced film cannot model.
    """
    checked_load(mass, signal.peak)
    if any(rig.weight_offset):
        raise InputError("the reduced film has no weight beside the centre: take tympan transient",
                         key="rig")
    if rig.gas_pressure and film.gas_area is None:
        raise InputError("the model's file has no gas_area_m2: build it again",
                         key="rig.gas_pressure", given=f"{rig.gas_pressure:g} Pa")
    moved = rig.moving_mass(mass)
    if inertia and moved <= 0:
        raise InputError("must be positive where the plate swings: the film has no inertia",
                         key="mass", given=f"{mass:g} kg")
    biases = solved_loading(rig.loading, Settings()).biases
    plate = float(film.specimen.plate_area) if rig.plate_pressure else 0.0
    force = float(rig.force(mass, plate)) - rig.gas_pressure * (film.gas_area or 0.0)
    # Where the film charges through a resistance, the circuit includes the leak.
    supplied = Supplied(signal, rig.source if rig.series_resistance else rig)
    return ReducedMotion(film, force, supplied, biases, _plate(film, moved) if inertia else None,
                         rig.plate_damping, error, budget, rig.circuit)


def _plate(film: ReducedFilm, moved: float) -> RigidPlate:
    """Make the rigid plate of a moving mass [kg], uniform over the plate's outline."""
    plate = film.specimen.plate
    return RigidPlate(moved) if plate is None else RigidPlate.uniform(plate.outline, moved)


def film_response(model: LumpedModel, signal: Signal, mass: float, rig: Rig, interval: float,
                  period: float | None = None, step: bool = False, inertia: bool = False,
                  progress: ShareDone = lambda share: None) -> ModelResponse:
    """Simulate the response of a model with a film in time, sampled at an interval [s].

    ``period`` is the signal's period [s], if it has one. ``step`` says that the signal is a step.
    ``progress`` is called with the finished share of the signal.
    """
    assert model.film is not None
    motion = film_motion(model.film, signal, mass, rig, inertia, budget=Budget(WORK))
    name = model.specimen.name
    case = Case(model.specimen, mass=mass, voltage=signal.peak, rig=rig)
    warnings = [*rig.in_motion, *case.remarks]
    try:
        followed = Followed(motion.moments())
    except NoBalance:
        reason = "must have an equilibrium under the signal's first voltage"
        raise InputError(case.doubted(reason), key="mass", given=f"{mass:g} kg") from None
    moments = list[ReducedMoment]()
    for moment in followed:
        moments.append(moment)
        progress(moment.time / signal.end)
    stopped = followed.stopped
    if not moments:
        reason = "the film has no equilibrium at once after the mass is put on"
        raise InputError(case.doubted(reason), key="mass", given=f"{mass:g} kg")
    if stopped is not None:
        warnings.append(str(stopped))
    trace = Trace(np.array([moment.time for moment in moments]))
    deflection = np.array([moment.deflection for moment in moments])
    (_, low), (_, high) = trace.extremes(deflection)
    when = np.linspace(trace.time[0], trace.end, max(2, round(trace.end / interval) + 1))
    sampled = trace.at(deflection, when)
    loop = area = None
    if period is not None and stopped is None:
        loop, area = trace.last_loop(signal, period, deflection)
        warnings += unclosed(loop)
    return ModelResponse.of(
        signal, when, sampled, low, high, step and inertia, specimen=name, mass_kg=mass,
        status=status_of(stopped), hysteresis_area_V_m=area,
        stopped_s=np.nan if stopped is None else stopped.time, film_error=dict(model.film.errors),
        steps=len(moments), warnings=tuple(warnings), loop=loop, samples=pd.DataFrame({
            "specimen": name, "mass": mass, "run": "simulated", "t": when,
            "voltage": nominal(signal, when),
            "displacement": rig.recorded(when, sampled)}))
