"""Figures 9 to 12: a step to 3.5 kV under both masses, by the fitted film and the lumped model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.paper_in_time.fit import Fit, swing, with_constants
from tympan.base.arrays import Array
from tympan.fem.rig import Rig
from tympan.paper import published
from tympan.paper.figures import Decay
from tympan.paper.missing_parameters import MissingParameters
from tympan.studies.case import Settings
from tympan.studies.films.film import FilmLoads, ReducedFilm
from tympan.studies.lumped.simulate import simulate
from tympan.studies.signals import step
from tympan.studies.transient import TransientCase, history

#: How long figures 9 and 11 last, and their zooms, 10 and 12 [s]: their time axes are lost.
LONG, ZOOM = 30.0, 3.0
#: Over how long what has moved is averaged [s], a swing or more; of how many swings a period is the
#: mean; to what a response of the lumped model is followed [m].
_MEAN, _SWINGS, _PRECISION = 0.1, 3, 1e-10
#: The cases in which the field model is asked, by number of mass and actuator; how long [s].
_CORNERS, _ASKED = ((0, 0), (1, 2)), 1.0


@dataclass(frozen=True, eq=False)
class StepResponses:
    """What the plate moves after the step from its rest under the weight [m].

    ``in_time``, by seeds that the film was fitted to, and ``lumped`` by mass, actuator and ``time``
    [s]; ``at_rest`` for ever, by mass and actuator; ``field``: times and movements of the field
    model of the first seed's film in some cases, by number of mass and actuator.
    """

    time: Array
    in_time: dict[int, Array]
    lumped: Array
    at_rest: Array
    field: dict[tuple[int, int], tuple[Array, Array]]

    @property
    def shown(self) -> Array:
        """The first seed's film."""
        return next(iter(self.in_time.values()))

    def after(self, moved: Array, time: float) -> Array:
        """What has moved until a time [s], without the swing, by mass and actuator [m]."""
        chosen = (self.time > time - _MEAN) & (self.time <= time)
        return np.asarray(moved[..., chosen].mean(-1))

    def period(self, moved: Array) -> Array:
        """Of the first swings [s], by mass and actuator."""
        turns = [[Decay.of(self.time, y).time[:2 * _SWINGS + 1] for y in row] for row in moved]
        return np.array([[2 * np.diff(times).mean() for times in row] for row in turns])

    @property
    def error(self) -> float:
        """The largest of the reduced films where the field model is asked, over what moves."""
        errors = [np.abs(np.interp(times, self.time, self.shown[case]) - moved).max()
                  / np.ptp(moved) for case, (times, moved) in self.field.items()]
        return float(max(errors))


def step_responses(films: Sequence[ReducedFilm], in_time: dict[int, Fit], at_rest: Fit,
                   lumped: MissingParameters, damper: float) -> StepResponses:
    """Of films with the constants of fits, a damper [N s/m], and the paper's lumped model."""
    jump = step(*published.STEP, 0.0, LONG)
    changed = {seed: with_constants(films, fit.constants) for seed, fit in in_time.items()}
    swings = {seed: [[swing(film, mass, damper, jump) for film in fitted]
                     for mass in published.MASSES] for seed, fitted in changed.items()}
    first, *_ = changed
    time = swings[first][0][0][0]
    cones = [[simulate(actuator, jump, precision=_PRECISION).deflection(time)
              for actuator in lumped.actuators(mass)] for mass in published.MASSES]
    return StepResponses(
        time, {seed: _moved([[y for _, y in row] for row in rows])
               for seed, rows in swings.items()},
        _moved(cones), _between_rests(with_constants(films, at_rest.constants)),
        {case: _field(changed[first][case[1]], published.MASSES[case[0]], damper)
         for case in _CORNERS})


def _moved(deflections: list[list[Array]]) -> Array:
    whole = np.array(deflections)
    return np.asarray(whole - whole[..., :1])


def _between_rests(films: Sequence[ReducedFilm]) -> Array:
    forces = np.array([float(Rig().force(mass)) for mass in published.MASSES])
    low, high = (np.array([film.at_rest(FilmLoads(forces, voltage**2))[:, 0] for film in films])
                 for voltage in published.STEP)
    return np.asarray((high - low).T)


def _field(film: ReducedFilm, mass: float, damper: float) -> tuple[Array, Array]:
    """Times [s] and what the field model's plate has moved then [m]."""
    case = TransientCase(film.specimen, step(*published.STEP, 0.0, _ASKED), mass=mass,
                         rig=replace(Rig(), plate_damping=damper), inertia=True)
    motion = history(case, Settings())
    when = np.linspace(0.0, _ASKED, 1 + round(_ASKED / 1e-3))
    return when, motion.at(motion.deflection, when) - motion.deflection[0]
