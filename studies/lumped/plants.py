"""Actuators at a moment, and after a voltage was held for a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import Failure
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.model import Model
from tympan.fem.membrane.rigid_plate import RigidPlate
from tympan.fem.membrane.state import PlateMotion, turned
from tympan.fem.rig import Rig
from tympan.fem.transient.collocation import newton_matrix, radau
from tympan.fem.transient.film_memory import first_memory
from tympan.fem.transient.integrate import Moment, Transient
from tympan.studies.films.driven_film import ReducedMoment
from tympan.studies.films.film import ReducedFilm
from tympan.studies.films.segmented import driven_model
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import settle, squared_at
from tympan.studies.lumped.film_response import film_motion
from tympan.studies.signals import Pieces

#: Stages of a step: order 7, so that a step of one radian of the swing has an error of 1e-6.
_STAGES = 4
#: Largest phase of the swing in a step [rad].
_RADIANS = 1.0
#: Longest step, over the charging time: the remaining charge is then accurate to 1e-4 of itself.
_FALLEN = 3.0
#: Most steps that the charging alone requires; a faster film is taken as charged at once.
_CHARGING = 50
#: Most of Newton's corrections of a step; it needs two or three.
_CORRECTIONS = 6
#: Size of the last correction [m]: the error after it is of second order, 1e-12 m at most. With
#: 1e-9, samples of a controlled film differ by less than 1e-12 m and take twice the time.
_LAST = 1e-7


class Plant(Protocol):
    """A film with its plate at a moment; one film or several at once."""

    @property
    def deflection(self) -> Any:
        """Deflection [m]."""

    @property
    def capacitance(self) -> Any:
        """Capacitance [F]."""

    def after(self, voltage: Any, duration: float) -> Self:
        """Move the plant while a nominal voltage [V] is held for a time [s]."""

    def holds(self, deflection: Any, voltage: Any) -> Any:
        """Test whether a nominal voltage [V] holds the crept film at a deflection [m] or beyond."""

    def under(self, mass: Any) -> Self:
        """Put another mass [kg] on the plant in its motion."""

    def rested(self, voltage: float) -> Self:
        """Bring the plant to rest at a nominal voltage [V]."""


@dataclass(frozen=True, eq=False)
class LumpedPlant:
    """The lumped model of an actuator, or of an array of actuators, in a state.

    ``past``: the length of its last step [s], and the states at the step's start and stages.
    """

    actuator: Actuator
    state: Array
    past: tuple[float, Array] | None = None

    @classmethod
    def resting(cls, actuator: Actuator, voltage: float = 0.0) -> LumpedPlant:
        """Make the plant at rest at a voltage [V]."""
        y = settle(lambda at: actuator.balance(at, voltage), actuator.flat)
        if not np.isfinite(y).all():
            raise Failure(f"the film does not rest at {voltage / 1e3:g} kV")
        return cls(actuator, actuator.rest(y, voltage))

    @property
    def deflection(self) -> Array:
        return np.asarray(self.state[..., 0])

    @property
    def capacitance(self) -> Any:
        return self.actuator.capacitance(self.deflection)

    def rested(self, voltage: float) -> LumpedPlant:
        return self.resting(self.actuator, voltage)

    def under(self, mass: Any) -> LumpedPlant:
        return LumpedPlant(replace(self.actuator, mass=mass), self.state)

    def holds(self, deflection: Any, voltage: Any) -> Any:
        needed = squared_at(self.actuator, deflection, self.actuator.strains(self.state))
        return needed <= self.actuator.film_voltage(self.state, voltage) ** 2

    def after(self, voltage: Any, duration: float) -> LumpedPlant:
        """Step by Radau's rule, as finely as the swing needs."""
        held = np.asarray(voltage)
        if self.past and self.past[0] == duration:
            return self._stepped(held, duration)
        slopes = self.actuator.linear(self.state, held)[1]
        swing = np.sqrt(np.abs(slopes[..., 1, 0]).max())
        steps = duration * swing / _RADIANS
        if self.actuator.charges:
            fallen = duration * np.abs(slopes[..., -1, -1]).max()
            steps = max(steps, min(fallen / _FALLEN, _CHARGING))
        count = max(1, int(np.ceil(steps)))
        plant = self
        for _ in range(count):
            plant = plant._stepped(held, duration / count)
        return plant

    def _stepped(self, voltage: Any, duration: float) -> LumpedPlant:
        rule, state, size = radau(_STAGES), self.state, self.state.shape[-1]
        weights = duration * rule.matrix
        # The stages are the first axis; the actuators broadcast on the axes behind it.
        stages = np.tensordot(rule.beyond(1.0), self.past[1], 1) \
            if self.past and self.past[0] == duration else np.repeat(state[None], _STAGES, 0)
        for _ in range(_CORRECTIONS):
            rates, slopes = self.actuator.linear(stages, voltage)
            missed = stages - state - np.tensordot(weights, rates, 1)
            matrix = newton_matrix(weights, np.moveaxis(slopes, 0, -3))
            flat = np.moveaxis(missed, 0, -2).reshape(*state.shape[:-1], -1, 1)
            moved = np.linalg.solve(matrix, flat).reshape(*state.shape[:-1], _STAGES, size)
            stages = stages - np.moveaxis(moved, -2, 0)
            if not np.abs(moved[..., 0]).max() > _LAST:
                break
        return replace(self, state=stages[-1],
                       past=(duration, np.concatenate([state[None], stages])))


@dataclass(frozen=True, eq=False)
class FilmPlant:
    """A reduced film in time on a rig; its plate of a nominal mass [kg] has inertia."""

    film: ReducedFilm
    mass: float
    rig: Rig
    moment: ReducedMoment

    @classmethod
    def resting(cls, film: ReducedFilm, mass: float, rig: Rig, voltage: float = 0.0) -> FilmPlant:
        """Make the plant at rest at a voltage [V]."""
        begin = film_motion(film, _held(voltage, 1.0), mass, rig, inertia=True).begin
        return cls(film, mass, rig, begin)

    @property
    def deflection(self) -> float:
        return float(self.moment.deflection)

    @property
    def capacitance(self) -> float:
        moment = self.moment
        return float(self.film.capacitance(moment.q, moment.loads.voltage_squared))

    def rested(self, voltage: float) -> FilmPlant:
        return self.resting(self.film, self.mass, self.rig, voltage)

    def under(self, mass: float) -> FilmPlant:
        return replace(self, mass=mass)

    def holds(self, deflection: float, voltage: float) -> bool:
        """Test whether a plate without inertia would reach this deflection [m] at once."""
        film, moment = self.film.tabulated, self.moment
        flow = moment.memory.step(film.strain(moment.q), 0.0)
        loads = moment.loads
        if not self.rig.series_resistance:  # through a resistance, the film is not charged at once
            squared = float(self.rig.film_voltage(voltage)) ** 2
            loads = replace(loads, voltage_squared=squared)
        return bool(film.carried(moment.q, moment.loads, loads, flow)[0] >= deflection)

    def after(self, voltage: Any, duration: float) -> FilmPlant:
        """Move the plant under a held voltage, or under one of each segment, (segments,) [V]."""
        film, top = self.film, voltage
        if np.ndim(voltage):
            named = zip(film.specimen.electrode.names, voltage.tolist(), strict=True)
            film, top = film.tabulated.driven(dict(named))
        motion = film_motion(film, _held(float(top), duration), self.mass, self.rig, inertia=True)
        moment = replace(self.moment, time=0.0)
        if np.ndim(voltage):
            # Other shares of the same voltage are a jump, too.
            squared = float(self.rig.film_voltage(top)) ** 2
            moment = motion.after_jump(moment, replace(moment.loads, voltage_squared=squared))
        *_, last = motion.moments(moment)
        return replace(self, moment=last)

    @property
    def plate(self) -> Array:
        """The plate's six freedoms [m, rad]."""
        return self.film.plate(self.moment.q)


@dataclass(frozen=True, eq=False)
class FieldPlant:
    """A film of finite elements in time whose segments have a voltage each; its plate swings."""

    model: Model
    mass: float
    rig: Rig
    moment: Moment

    @classmethod
    def resting(cls, model: Model, mass: float, rig: Rig, voltages: Mapping[str, float]
                ) -> FieldPlant:
        """Make the plant at rest at voltages of segments [V]."""
        wired, top = driven_model(model, voltages)
        area = float(model.specimen.plate_area)
        outcome = equilibrium(wired, float(rig.force(mass, area)), top)
        if outcome.status != "equilibrium":
            raise Failure("the film has no equilibrium at these voltages")
        return cls(model, mass, rig, Moment(0.0, outcome.state,
                                            first_memory(wired, outcome.state)))

    def after(self, voltages: Array, duration: float) -> FieldPlant:
        """Move the plant under a held voltage of each segment, (segments,) [V]."""
        names = self.model.specimen.electrode.names
        wired, top = driven_model(self.model, dict(zip(names, voltages.tolist(), strict=True)))
        plate = self.model.specimen.needed_plate().outline
        motion = Transient(wired, self.moment.state.force, _held(top, duration),
                           RigidPlate.uniform(plate, self.rig.moving_mass(self.mass)),
                           self.rig.plate_damping)
        begin = motion.after_jump(replace(self.moment, time=0.0), top)
        *_, last = motion.onward(begin)
        return replace(self, moment=last)

    @property
    def plate(self) -> Array:
        """The plate's six freedoms [m, rad]."""
        plate = self.moment.state.plate
        return np.concatenate([plate.translation, turned(plate, PlateMotion.rest())])


def _held(voltage: float, duration: float) -> Pieces:
    return Pieces(np.array([0.0, duration]), np.array([voltage, voltage]))
