"""Eq. (12): viscous constants from responses of all shapes, masses and runs at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.circles.cone import radii_of
from tympan.studies.estimation.identifiability import CREDIBLE
from tympan.studies.estimation.least_squares import LeastSquares
from tympan.studies.identify.responses import Record
from tympan.studies.identify.static_fit import Constant
from tympan.studies.identify.static_search import StaticFit
from tympan.studies.lumped.actuator import Actuator, Viscous
from tympan.studies.lumped.collocation import CollocationSolver
from tympan.studies.lumped.equilibria import rest, settle
from tympan.studies.lumped.signals import Pieces
from tympan.studies.paper.table1 import known

Array = NDArray[np.float64]

#: The search's variables are the constants' natural logarithms.
CONSTANTS = (Constant("k_1", "Pa", known("k_1"), 1.0, 1e2, 1e12),
             Constant("eta_1", "Pa s", known("eta_1"), 1.0, 1e1, 1e14),
             Constant("eta_2", "Pa s", known("eta_2"), 1.0, 1e0, 1e9))
_STILL = 1e-6  # of a logarithm that does not move
_BEGUN = 0.25  # of the way between two rests: how far from one a run may begin
_UNNOTICED = 100.0  # scales: a combination determined no better moves no response
_DELAY, _FURTHEST = 0.5, 1.5  # deviation and bound of a run's delay, in sampling intervals


class Statics(Protocol):
    """What a response needs of the static constants: actuators, and how these may still turn."""

    @property
    def count(self) -> int:
        """How many ways are open."""

    def actuator(self, number: int, mass: float, turn: Any, viscous: Viscous) -> Actuator:
        """The actuator of a specimen (by number); ``turn`` is how far it went each way."""

    def by_turn(self, number: int, turn: Array, y: Array, voltage: Array) -> Array:
        """Derivatives of a specimen's force [N] by the turns, shape (points, turns)."""


@dataclass(frozen=True, eq=False)
class Exact:
    """The films' own material, with given weights α of the circles, or equal ones."""

    specimens: tuple[Specimen, ...]
    rig: Rig
    weights: tuple[float, ...] | None = None

    @property
    def count(self) -> int:
        """None is open."""
        return 0

    def actuator(self, number: int, mass: float, turn: Any, viscous: Viscous) -> Actuator:
        """As the film is."""
        weights = self.weights if len(radii_of(self.specimens[number].frame)) > 1 else None
        return Actuator.of(self.specimens[number], mass, weights, viscous, self.rig)

    def by_turn(self, number: int, turn: Array, y: Array, voltage: Array) -> Array:
        return np.zeros((*y.shape, 0))


@dataclass(frozen=True, eq=False)
class Held:
    """Constants found from readings at rest, held as firmly as those determine them.

    A turn of 1 moves them by one standard deviation along a combination, at most by ten of their
    scales: many readings in time may see what few at rest do not.
    """

    fit: StaticFit

    @cached_property
    def directions(self) -> Array:
        """Changes of the static constants, a column for each combination a reading may notice."""
        scale = self.fit.problem.column("scale")
        return np.array([scale * one.coefficients * min(one.deviation, CREDIBLE)
                         for one in self.fit.judgement.combinations
                         if one.deviation < _UNNOTICED]).T

    @property
    def count(self) -> int:
        """How many ways are open."""
        return int(self.directions.shape[1])

    def actuator(self, number: int, mass: float, turn: Any, viscous: Viscous) -> Actuator:
        """With the constants turned."""
        problem = self.fit.problem
        values = self.fit.values + self.directions @ turn
        return Actuator.of(problem.specimen(number, values), mass, problem.weights(number, values),
                           viscous,
                           problem.readings.rig)

    def by_turn(self, number: int, turn: Array, y: Array, voltage: Array) -> Array:
        values = self.fit.values + self.directions @ turn
        slopes = self.fit.problem.force_of(number, values, y, voltage)[2]
        return np.asarray(slopes @ self.directions)


@dataclass(frozen=True, eq=False)
class DynamicProblem:
    """Responses and what their motions depend on.

    z = (ln k₁, ln η₁, ln η₂, turns of the statics, delays of the runs). A run's delay, in its
    sampling intervals, is how long before the sample that first shows it a voltage came: no record
    says. Turns and delays are unknown with a standard deviation of 1 and a half. Where no reading
    follows the oscillation, η₂ is not ``followed`` and stays where it begins.
    """

    statics: Statics
    rig: Rig
    records: tuple[Record, ...]
    noise: float | None = None
    followed: bool = True

    @property
    def size(self) -> int:
        """How many readings there are."""
        return sum(len(record.time) for record in self.records)

    @cached_property
    def start(self) -> Array:
        """Table 1's constants, the statics as they are, no delay."""
        return np.append(np.log([one.start for one in CONSTANTS]),
                         np.zeros(self.statics.count + len(self.records)))

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper ends of z."""
        room = np.append(np.full(self.statics.count, 8.0), np.full(len(self.records), _FURTHEST))
        low, high = (np.log([getattr(one, side) for one in CONSTANTS]) for side in ("low", "high"))
        if not self.followed:
            low[2], high[2] = self.start[2] + _STILL * np.array([-1, 1])
        return np.append(low, -room), np.append(high, room)

    def actuator(self, record: Record, z: Any) -> Actuator:
        """The actuator of a run."""
        return self.statics.actuator(record.specimen, record.mass, z[3:3 + self.statics.count],
                                     Viscous(*np.exp(z[:3])))

    def by_constants(self, record: Record, z: Array, state: Array, voltage: Array) -> Array:
        """Derivatives of a run's rates by viscous constants and turns, (…, size, 3 + turns)."""
        actuator, y = self.actuator(record, z), state[..., 0]
        turned = self.statics.by_turn(record.specimen, z[3:3 + self.statics.count], y.ravel(),
                                      np.ravel(voltage)).reshape(*y.shape, -1)
        result = np.zeros((*state.shape, 3 + turned.shape[-1]))
        result[..., :3] = actuator.by_viscous(state)
        result[..., 1, 3:] = -turned / actuator.moved
        return result

    @cached_property
    def _solvers(self) -> tuple[CollocationSolver, ...]:
        return tuple(CollocationSolver(_longer(record.drive, _FURTHEST * record.interval))
                     for record in self.records)

    def _start(self, record: Record, z: Array, began: float, near: float | None) -> Array:
        """The rest a run begins from, and its derivatives by viscous constants and turns."""
        actuator = self.actuator(record, z)
        y = settle(lambda at: actuator.balance(at, began),
                   rest(actuator, began) if near is None else near)
        if np.isnan(y):
            raise InputError("has no stable rest to begin from with these constants",
                             key=actuator.specimen.name)
        state, (_, stiffness) = actuator.rest(y), actuator.balance(y, began)
        driven = self.by_constants(record, z, state[None], np.array([began]))[0, 1]
        tangent = np.array([1.0, 0.0, *actuator.circles.stretch(y)[1]])
        return np.column_stack([state, np.outer(tangent, driven * actuator.moved / stiffness)])

    @cached_property
    def began(self) -> tuple[float, ...]:
        """The voltages [V] of the rests that runs began from: their first, or none, if nearer."""
        return tuple(self._began(record) for record in self.records)

    def _began(self, record: Record) -> float:
        first = float(record.drive.voltage[0])
        if first == 0:
            return first
        actuator = self.actuator(record, self.start)
        rests = np.array([float(self.rig.reading(rest(actuator, volts)))
                          for volts in (0.0, first)])
        away = np.abs(record.first - rests)
        if away.min() > _BEGUN * abs(rests[1] - rests[0]):
            raise InputError("must begin at rest, at its first voltage or without any: record it "
                             "from before the step",
                             key=f"transient.csv, {actuator.specimen.name}, run {record.run}",
                             given=f"{1e3 * record.first:.4f} mm, rests {1e3 * rests[1]:.4f} and "
                                   f"{1e3 * rests[0]:.4f} mm")
        return (0.0, first)[int(np.argmin(away))]

    def until(self, length: float) -> DynamicProblem:
        """The same up to so long after each run's voltage first changes [s]."""
        return replace(self, records=tuple(record.until(record.begins + length)
                                           for record in self.records))

    @cached_property
    def _latest(self) -> dict[str, Any]:
        return {}

    def pole(self, z: Array) -> complex:
        """The fastest pole of all runs at their start [1/s]."""
        poles: list[complex] = []
        for record, began in zip(self.records, self.began, strict=True):
            actuator = self.actuator(record, z)
            poles.extend(np.linalg.eigvals(actuator.jacobian(actuator.rest(float(record.first)),
                                                             began)))
        return complex(max(poles, key=abs))

    def parts(self, z: Array, derivatives: bool = True) -> list[tuple[Array, Array]]:
        """Of every run model less reading [m], and its derivative by z; the last is kept."""
        if not derivatives or not np.array_equal(self._latest.get("z", ()), z):
            self._latest.update(found=self._parts(z, derivatives),
                                z=z.copy() if derivatives else ())
        found: list[tuple[Array, Array]] = self._latest["found"]
        return found

    def _parts(self, z: Array, derivatives: bool) -> list[tuple[Array, Array]]:
        inner, found = 3 + self.statics.count, []
        gain = 1 + self.rig.sensor_gain
        for number, (record, solver, began) in enumerate(zip(self.records, self._solvers,
                                                             self.began, strict=True)):
            near = None if solver.last is None else float(solver.last.nodes[0, 0])
            start = self._start(record, z[:inner], began, near)
            motion = solver.solve(self.actuator(record, z), start, constants=z[:inner],
                                  by_constants=partial(self.by_constants, record, z)) \
                if derivatives else solver.solve(self.actuator(record, z), start[:, :1])
            y, speed, by = motion.deflection(record.time + z[inner + number] * record.interval)
            residual = np.asarray(self.rig.reading(y, record.time
                                                   - record.time[0])) - record.displacement
            slopes = np.zeros((len(y), len(z)))
            slopes[:, :by.shape[1]] = gain * by
            slopes[:, inner + number] = gain * record.interval * speed
            found.append((residual, slopes))
        return found

    def misfit(self, sigma: float) -> LeastSquares:
        """Of z, in units of a reading's noise [m].

        Each run's rows are replaced by the triangular factor of (derivative, residual), which has
        the same χ², the same gradient and the same curvature: nothing is lost of 30,000 readings,
        and a step of the search is cheap.
        """
        spread = np.concatenate([np.full(self.statics.count, 1.0),
                                 np.full(len(self.records), _DELAY)])
        prior = np.eye(len(self.start))[3:] / spread[:, None]

        def both(z: Array) -> tuple[Array, Array]:
            try:
                parts = self.parts(z)
            except InputError:  # a trial beyond pull-in: the search steps back
                return np.full(len(prior), np.nan), prior
            rows = np.concatenate([np.linalg.qr(np.column_stack([slopes, residual]) / sigma,
                                                mode="r")
                                   for residual, slopes in parts])
            return (np.concatenate([rows[:, -1], prior @ (z - self.start)]),
                    np.concatenate([rows[:, :-1], prior]))

        return LeastSquares.of(both, *self.bounds)


def _longer(drive: Pieces, by: float) -> Pieces:
    """The voltage with its last value held for longer [s]."""
    last = len(drive.time) - int(drive.voltage[-1] == drive.voltage[-2])
    return Pieces(np.append(drive.time[:last], drive.time[-1] + by),
                  np.append(drive.voltage[:last], drive.voltage[-1]))
