"""A plate moved out and back at a speed: the loop of a film with viscous branches, and its heat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.film.density import from_virgin
from tympan.fem.film.memory import Memory
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.transient.dense_output import spline
from tympan.fem.transient.ends import Stopped
from tympan.fem.transient.integrate import Moment, StepSettings, Transient
from tympan.studies.force.result import ForceLoop
from tympan.studies.signals import Pieces

#: Errors of steps in time with which a loop is followed, one after the other, until its areas
#: change by no more than a share: the finer run is some five times nearer. Areas are then within
#: 1e-4 of the heat (a branch of 20 kPa and 0.5 s); of a film without branches within 1e-8 of the
#: work.
_ERRORS = (1e-6, 1e-7, 1e-8)
_AREA = 3e-4


@dataclass(frozen=True)
class Motion:
    """A plate that moves between two displacements [m] at a speed [m/s], out and back.

    ``cycles`` times; the force is told at so many ``points`` of each way.
    """

    start: float
    to: float
    rate: float
    cycles: int
    points: int

    @property
    def leg(self) -> float:
        """Time of one way [s]."""
        return (self.to - self.start) / self.rate

    @property
    def heave(self) -> Pieces:
        """Displacements in time."""
        turns = np.arange(2 * self.cycles + 1)
        places = np.where(turns % 2 == 0, self.start, self.to)
        return Pieces(self.leg * turns.astype(float), places.astype(float))

    def times(self) -> Array:
        """Times at which the force is told [s], the turns among them."""
        steps = self.points - 1
        return np.linspace(0.0, 2 * self.cycles * self.leg, 2 * self.cycles * steps + 1)


def loop(model: Model, voltage: float, start: State, motion: Motion) -> ForceLoop:
    """Move the plate of a film that rests at the first displacement, at a nominal voltage [V].

    It has rested there for ever, unless the film says when it was mounted: then it is displaced at
    once.
    """
    last: ForceLoop | None = None
    for error in _ERRORS:
        found = _loop(model, voltage, start, motion, StepSettings(error=error))
        if last is not None and len(found.area_J) == len(last.area_J) and np.allclose(
                found.area_J, last.area_J, rtol=_AREA, atol=0.0):
            return found
        last = found
    return found


def _loop(model: Model, voltage: float, start: State, motion: Motion, steps: StepSettings
          ) -> ForceLoop:
    film, heave, state = model.specimen.membrane, motion.heave, start
    strain = from_virgin(model.cauchy_green(state.positions), film.prestretch)
    memory = (Memory.relaxed(film, strain) if film.mounted is None
              else Memory.mounted(film, strain[0].shape))
    charged = Pieces(heave.time, np.full(len(heave.time), max(state.voltage_squared, 0.0) ** 0.5))
    held = Transient(model, state.force, charged, settings=steps, pressure=state.pressure,
                     heave=heave)
    record: list[tuple[float, float, float]] = []
    stopped = None
    try:
        for moment in held.moments(state, memory):
            record.append((moment.time, moment.state.force, _heat(model, moment)))
    except Stopped as ending:
        stopped = ending.time
    time, force, heat = np.array(record).T
    pieces = _pieces(time)
    told = motion.times()
    told = told[told <= time[-1] * (1 + 1e-12)]
    at = np.minimum((told / motion.leg * (1 + 1e-12)).astype(int), len(pieces) - 1)
    forces = np.array([spline(time[pieces[piece]], force[pieces[piece]])(when)
                       for piece, when in zip(at, told, strict=True)])
    whole = range(0, 2 * motion.cycles if stopped is None else 2 * ((len(pieces) - 1) // 2), 2)
    areas, heats = [], []
    for number in whole:
        out, back = ((time[piece], force[piece], heat[piece])
                     for piece in pieces[number : number + 2])
        areas.append(motion.rate * (_integral(*out[:2]) - _integral(*back[:2])))
        heats.append(sum(_integral(when, power) for when, _, power in (out, back)))
    return ForceLoop(
        voltage_V=voltage, rate_m_per_s=motion.rate, leg_s=motion.leg,
        time_s=tuple(told.tolist()),
        displacement_m=tuple(heave.within(np.minimum(at, 2 * motion.cycles - 1), told).tolist()),
        force_N=tuple(forces.tolist()), area_J=tuple(areas), heat_J=tuple(heats),
        stopped_s=stopped)


def _heat(model: Model, moment: Moment) -> float:
    """Power that the branches turn into heat [W]."""
    strain = from_virgin(model.cauchy_green(moment.state.positions),
                         model.specimen.membrane.prestretch)
    power = (moment.memory.dissipation(strain) * model.volumes).sum()
    # Of a branch that is all but relaxed it is the difference of two numbers alike.
    return max(float(power) * model.discretisation.mirrored, 0.0)


def _pieces(time: Array) -> list[slice]:
    """Moments of each way: at a turn the same time stands twice."""
    starts = (np.flatnonzero(np.diff(time) == 0) + 1).tolist()
    return [slice(*ends) for ends in zip([0, *starts], [*starts, len(time)], strict=True)]


def _integral(time: Array, values: Array) -> float:
    """∫ over moments, of the spline through them."""
    return float(spline(time, values).integrate(time[0], time[-1]))
