"""Actuators in time: the common interface of circles and reduced films."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.progress import ShareDone
from tympan.fem.rig import Rig
from tympan.studies.films.film import ReducedFilm
from tympan.studies.lumped.actuator import Actuator, Viscous
from tympan.studies.lumped.film_response import film_deflections, film_response
from tympan.studies.lumped.model_file import LumpedModel
from tympan.studies.lumped.plants import FilmPlant, LumpedPlant, Plant
from tympan.studies.lumped.remarks import origin
from tympan.studies.lumped.simulate import ModelResponse, sample, simulate
from tympan.studies.signals import Signal, Wave


class InTime(Protocol):
    """An actuator under a mass on a rig, as it moves in time."""

    @property
    def origin(self) -> list[str]:
        """Remarks on the origin of constants that are not the film's own."""

    def circles(self, voltage: float) -> Actuator:
        """Make circles that move alike about a nominal voltage [V]: a controller's design model."""

    def resting(self, voltage: float) -> Plant:
        """Bring the actuator to rest at a nominal voltage [V]."""

    def driven(self, signal: Signal, time: Array) -> Array:
        """Simulate deflections [m] at times [s] under a signal, from rest at its first voltage.

        Raises
        ------
        InputError
            Where the motion stops before the signal's end.
        """

    def response(self, wave: Wave, signal: Signal, swing: bool, progress: ShareDone
                 ) -> ModelResponse:
        """Simulate the response to the signal of a wave, sampled at the wave's interval.

        ``swing``: the plate has inertia; without ``swing`` that of a reduced film has none.
        ``progress`` is called with the finished share of the signal.
        """


@dataclass(frozen=True, eq=False)
class CirclesInTime:
    """The lumped model of an actuator in time; ``remarks`` on how it was chosen."""

    actuator: Actuator
    remarks: tuple[str, ...] = ()

    @property
    def origin(self) -> list[str]:
        return origin(self.actuator)

    def circles(self, voltage: float) -> Actuator:
        return self.actuator

    def resting(self, voltage: float) -> LumpedPlant:
        return LumpedPlant.resting(self.actuator, voltage)

    def driven(self, signal: Signal, time: Array) -> Array:
        motion = simulate(self.actuator, signal)
        if motion.stopped is not None:
            raise _pulls_in(self.actuator.label, signal)
        return motion.deflection(time)

    def response(self, wave: Wave, signal: Signal, swing: bool, progress: ShareDone
                 ) -> ModelResponse:
        motion = simulate(self.actuator, signal, progress=progress)
        return sample(motion, wave.interval, wave.period, wave.kind == "step", self.remarks)


@dataclass(frozen=True, eq=False)
class FilmInTime:
    """The reduced film of a model in time, under a nominal mass [kg] on a rig."""

    model: LumpedModel
    mass: float
    rig: Rig

    @property
    def film(self) -> ReducedFilm:
        assert self.model.film is not None
        return self.model.film

    @property
    def origin(self) -> list[str]:
        return []

    def circles(self, voltage: float) -> Actuator:
        """Make circles of the model with one branch that replaces the film's branches.

        At the voltage the branch has the instantaneous stiffness of the film's branches against the
        plate. Its time is the mean of their times, weighted with their moduli.
        """
        still, film = self.model.actuator(self.mass, self.rig), self.film
        plant = self.resting(voltage)
        moment = plant.moment
        at_once = moment.memory.step(film.strain(moment.q), 0.0)
        frozen, relaxed = (
            _along_plate(film.pull(moment.q, moment.loads.voltage_squared, flow)[1])
            for flow in (at_once, None))
        y = plant.deflection
        unit = replace(still, viscous=Viscous(1.0, 1.0, 0.0))
        strains = unit.strains(unit.rest(y, voltage))
        of_one = unit.balance(y, voltage, strains)[1] - unit.balance(y, voltage)[1]
        k1 = float((frozen - relaxed) / of_one)
        branches = film.specimen.membrane.branches
        time = np.average([branch.time for branch in branches],
                          weights=[branch.modulus for branch in branches])
        return replace(still, viscous=Viscous(k1, k1 * float(time), 0.0))

    def resting(self, voltage: float) -> FilmPlant:
        return FilmPlant.resting(self.film, self.mass, self.rig, voltage)

    def driven(self, signal: Signal, time: Array) -> Array:
        deflections, = film_deflections(self.film, [signal], [self.mass], time, self.rig,
                                        inertia=True)
        if np.isnan(deflections).any():
            raise _pulls_in(self.film.specimen.name, signal)
        return np.asarray(deflections)

    def response(self, wave: Wave, signal: Signal, swing: bool, progress: ShareDone
                 ) -> ModelResponse:
        return film_response(self.model, signal, self.mass, self.rig, wave.interval, wave.period,
                             wave.kind == "step", swing, progress)


def _along_plate(stiffness: Array) -> float:
    """Compute the stiffness against the plate's deflection, other shapes in equilibrium [N/m]."""
    return float(1 / np.linalg.inv(stiffness)[0, 0])


def _pulls_in(name: str, signal: Signal) -> InputError:
    return InputError("meets pull-in on its way without feedback: lower its voltages", key=name,
                      given=f"{signal.peak / 1e3:g} kV")
