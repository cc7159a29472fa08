"""A plate moved out and back at a speed: loop of a film with viscous branches, and its heat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tympan.base.arrays import Array
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.state import State
from tympan.fem.transient.ends import Followed
from tympan.fem.transient.film_memory import branch_heat, first_memory
from tympan.fem.transient.integrate import StepSettings, Transient
from tympan.studies.force.result import ForceLoop
from tympan.studies.motion import Trace
from tympan.studies.signals import Pieces

#: Errors of the time steps of successive runs of a loop. The runs end when the areas of the loops
#: change by no more than ``_AREA``; the finer run is some five times as accurate. Areas are then
#: within 1e-4 of the heat (a branch of 20 kPa and 0.5 s); for a film without branches, within 1e-8
#: of the work.
_ERRORS = (1e-6, 1e-7, 1e-8)
_AREA = 3e-4

#: Relative rounding error of the times at the ends of each leg.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class HeldMotion:
    """Motion of a plate between two displacements [m] at a speed [m/s], out and back.

    ``cycles``: number of cycles. ``points``: number of points on each leg at which the force is
    stored.
    """

    start: float
    to: float
    rate: float
    cycles: int
    points: int

    @property
    def leg(self) -> float:
        """Duration of one leg [s]."""
        return (self.to - self.start) / self.rate

    @property
    def deflection(self) -> Pieces:
        """Displacements in time."""
        turns = np.arange(2 * self.cycles + 1)
        places = np.where(turns % 2 == 0, self.start, self.to)
        return Pieces(self.leg * turns.astype(float), places.astype(float))

    def times(self) -> Array:
        """Compute the times at which the force is stored [s], turning points included."""
        steps = self.points - 1
        return np.linspace(0.0, 2 * self.cycles * self.leg, 2 * self.cycles * steps + 1)


def loop(model: Model, voltage: float, start: State, motion: HeldMotion) -> ForceLoop:
    """Move the plate of a film at rest at the first displacement, at a nominal voltage [V].

    The film is fully relaxed there. If the film has a mounting time, it is instead displaced there
    at once.
    """
    last: ForceLoop | None = None
    for error in _ERRORS:
        found = _loop(model, voltage, start, motion, StepSettings(error=error))
        if last is not None and len(found.area_J) == len(last.area_J) and np.allclose(
                found.area_J, last.area_J, rtol=_AREA, atol=0.0):
            return found
        last = found
    return found


def _loop(model: Model, voltage: float, start: State, motion: HeldMotion, steps: StepSettings
          ) -> ForceLoop:
    deflection = motion.deflection
    across = max(start.voltage_squared, 0.0) ** 0.5
    charged = Pieces(deflection.time, np.full(len(deflection.time), across))
    held = Transient(model, start.force, charged, settings=steps, pressure=start.pressure,
                     deflection=deflection)
    record: list[tuple[float, float, float]] = []
    followed = Followed(held.moments(start, first_memory(model, start)))
    for moment in followed:
        # The heat of an almost relaxed branch is the difference of two nearly equal numbers.
        heat = max(branch_heat(model, moment.state, moment.memory), 0.0)
        record.append((moment.time, moment.state.force, heat))
    time, force, heats = np.array(record).T
    trace, stopped = Trace(time), followed.stopped
    ways = 2 * motion.cycles
    if stopped is not None:
        # The last leg was not finished.
        ways = 2 * ((len(trace.parts) - 1) // 2)
    work, heat_of_way = (trace.integrals(values) for values in (force, heats))
    told = motion.times()
    told = told[told <= time[-1] * (1 + _ROUNDING)]
    way = np.minimum((told / motion.leg * (1 + _ROUNDING)).astype(int), 2 * motion.cycles - 1)
    return ForceLoop(
        voltage_V=voltage, segment_voltages_V=model.specimen.electrode.voltages(voltage),
        rate_m_per_s=motion.rate, leg_s=motion.leg,
        time_s=tuple(told.tolist()),
        displacement_m=tuple(deflection.within(way, told).tolist()),
        force_N=tuple(trace.at(force, np.minimum(told, time[-1])).tolist()),
        area_J=tuple((motion.rate * (work[:ways:2] - work[1:ways:2])).tolist()),
        heat_J=tuple((heat_of_way[:ways:2] + heat_of_way[1:ways:2]).tolist()),
        stopped_s=None if stopped is None else stopped.time)
