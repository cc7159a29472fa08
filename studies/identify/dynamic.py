"""Eq. (12): viscous constants from responses of all shapes, masses and runs at once."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy.optimize import minimize

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.fem.rig import Rig
from tympan.fem.transient.ends import Stopped
from tympan.studies.estimation.identifiability import (
    Identifiability,
    identifiability,
    unseen,
)
from tympan.studies.estimation.least_squares import LeastSquares, minimise
from tympan.studies.estimation.noise import Noise
from tympan.studies.identify.correlation import variance_inflation
from tympan.studies.identify.responses import ResponseRecord
from tympan.studies.identify.static import ModelConstant, StaticFit, Tell
from tympan.studies.lumped.actuator import BORROWED, Actuator, Viscous
from tympan.studies.lumped.collocation import CollocationSolver
from tympan.studies.lumped.equilibria import rest, settle
from tympan.studies.lumped.remarks import of_loads, remark
from tympan.studies.signals import Pieces

#: The viscous constants. Their search begins at the source paper's values, in natural logarithms.
CONSTANTS = (ModelConstant("k_1", "Pa", BORROWED.k1, 1.0, 1e2, 1e12),
             ModelConstant("eta_1", "Pa s", BORROWED.eta1, 1.0, 1e1, 1e14),
             ModelConstant("eta_2", "Pa s", BORROWED.eta2, 1.0, 1e0, 1e9))
#: Half width of the bounds of a logarithm that must not move.
_STILL = 1e-6
#: Change of a logarithm below which it has stayed at its start.
_STAYED = 0.01
#: Largest distance of a run's start from a rest, over the distance between its two rests.
_BEGUN = 0.25

#: Standard deviation of a run's delay, in sampling intervals: a clock is off by about half of one.
_DELAY = 0.5
#: Largest delay of a run, in sampling intervals.
_FURTHEST = 1.5

#: Periods of the fast oscillation that the search sees, first few, then more: a response that is
#: out of phase by half a period has a minimum of its own.
_PERIODS = (1.5, 6.0, 25.0, 100.0)
#: Smallest noise [m]: the errors of the computed motion are not independent either.
FINEST = 1e-8
#: Standard deviation of a logarithm about the start, while only a part of the record is fitted.
_LOOSE = 3.0


@dataclass(frozen=True, eq=False)
class Exact:
    """Actuators whose films and weights are taken as exact, on one rig, whatever their masses.

    ``equal`` says that their weights were not given.
    """

    actuators: tuple[Actuator, ...]
    equal: bool = False
    turns: int = 0

    @property
    def rig(self) -> Rig:
        return self.actuators[0].rig

    @property
    def assumed(self) -> list[str]:
        """Sentences on constants that are taken as exact."""
        weights = "equal weights" if self.equal else "the weights"
        return [f"there is no static.csv: the films' own material, {weights} and permittivity are "
                "taken as exact"]

    def actuator(self, number: int, mass: float, turn: Any, viscous: Viscous) -> Actuator:
        return replace(self.actuators[number], mass=mass, viscous=viscous)

    def rows(self, turn: Array) -> tuple[Array, Array]:
        return np.zeros(0), np.zeros((0, 0))  # there are no readings at rest and no free constants

    def by_turn(self, number: int, turn: Array, y: Array, voltage: Array) -> Array:
        return np.zeros((*y.shape, 0))

    def weights_by_turn(self, number: int) -> Array:
        return np.zeros((self.actuators[number].count, 0))


#: Static constants for a response: actuators, and the directions in which they may still change.
Statics = Exact | StaticFit


@dataclass(frozen=True, eq=False)
class DynamicProblem:
    """Responses, and the unknowns that their motions depend on.

    z = (ln k₁, ln η₁, ln η₂, turns of the statics, delays of the runs). A run's delay, in its
    sampling intervals, is the time from a change of the voltage to the first sample that shows it:
    no record gives it. Delays are unknown with a standard deviation of a half. The readings at rest
    are fitted together with those in time. Where no reading follows the oscillation, η₂ is not
    ``followed`` and stays at its start.
    """

    statics: Statics
    records: tuple[ResponseRecord, ...]
    noise: float | None = None
    followed: bool = True

    @property
    def rig(self) -> Rig:
        return self.statics.rig

    @property
    def size(self) -> int:
        return sum(len(record.time) for record in self.records)

    @cached_property
    def start(self) -> Array:
        """Start of the search: Table 1's constants, the statics unchanged, no delay."""
        logs = np.log([constant.start for constant in CONSTANTS])
        return np.append(logs, np.zeros(self.statics.turns + len(self.records)))

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        room = np.append(np.full(self.statics.turns, 8.0), np.full(len(self.records), _FURTHEST))
        low, high = np.log([(constant.low, constant.high) for constant in CONSTANTS]).T
        if not self.followed:
            low[2], high[2] = self.start[2] + _STILL * np.array([-1, 1])
        return np.append(low, -room), np.append(high, room)

    def split(self, z: Array) -> list[Array]:
        """Split z: logarithms of viscous constants, turns of the statics, delays of the runs."""
        return np.split(z, [len(CONSTANTS), len(CONSTANTS) + self.statics.turns])

    def actuator(self, record: ResponseRecord, z: Array) -> Actuator:
        logs, turn, _ = self.split(z)
        return self.statics.actuator(record.specimen, record.mass, turn, Viscous(*np.exp(logs)))

    def by_constants(self, record: ResponseRecord, z: Array, state: Array, voltage: Array) -> Array:
        """Differentiate a run's rates by viscous constants and turns, (…, size, 3 + turns)."""
        actuator, y = self.actuator(record, z), state[..., 0]
        turned = np.zeros((*state.shape, self.statics.turns))
        film = self.statics.by_turn(record.specimen, self.split(z)[1], y.ravel(), np.ravel(voltage))
        drag = actuator.drag(state) @ self.statics.weights_by_turn(record.specimen)
        turned[..., 1, :] = -(film.reshape(drag.shape) + drag) / actuator.moved
        return np.concatenate([actuator.by_viscous(state), turned], axis=-1)

    @cached_property
    def _solvers(self) -> tuple[CollocationSolver, ...]:
        """Solvers under each run's voltage, whose last value holds until the longest delay ends."""
        solvers = []
        for record in self.records:
            at, volts = record.drive.time, record.drive.voltage
            last = len(at) - int(volts[-1] == volts[-2])
            longer = Pieces(np.append(at[:last], at[-1] + _FURTHEST * record.interval),
                            np.append(volts[:last], volts[-1]))
            solvers.append(CollocationSolver(longer))
        return tuple(solvers)

    def _start(self, record: ResponseRecord, z: Array, began: float, near: float | None) -> Array:
        """Find the rest that a run begins from, and its derivatives by constants and turns."""
        actuator = self.actuator(record, z)
        y = settle(lambda at: actuator.balance(at, began),
                   rest(actuator, began) if near is None else near)
        if np.isnan(y):
            raise InputError("has no stable rest to begin from with these constants",
                             key=actuator.specimen.name)
        state, (_, stiffness) = actuator.rest(y, began), actuator.balance(y, began)
        driven = self.by_constants(record, z, state[None], np.array([began]))[0, 1]
        tangent = actuator.by_rest(y, began)
        return np.column_stack([state, np.outer(tangent, driven * actuator.moved / stiffness)])

    @cached_property
    def began(self) -> tuple[float, ...]:
        """Voltages [V] of the rests that runs began from: their first voltage, or 0 if nearer."""
        return tuple(map(self._began, self.records))

    def _began(self, record: ResponseRecord) -> float:
        first = float(record.drive.voltage[0])
        if first == 0:
            return first
        actuator = self.actuator(record, self.start)
        rests = self.rig.reading(np.array([rest(actuator, volts) for volts in (0.0, first)]))
        away = np.abs(record.first - rests)
        if away.min() > _BEGUN * abs(rests[1] - rests[0]):
            raise InputError("must begin at rest, at its first voltage or without any: record it "
                             "from before the step, or take the model of this actuator (--model)",
                             key=f"transient.csv, {actuator.specimen.name}, run {record.run}",
                             given=f"{1e3 * record.first:.4f} mm, rests {1e3 * rests[1]:.4f} and "
                                   f"{1e3 * rests[0]:.4f} mm")
        return (0.0, first)[int(np.argmin(away))]

    def until(self, length: float) -> DynamicProblem:
        return replace(self, records=tuple(record.until(record.begins + length)
                                           for record in self.records))

    def pole(self, z: Array) -> complex:
        """Find the fastest pole of all runs at their start [1/s]."""
        poles: list[complex] = []
        for record, began in zip(self.records, self.began, strict=True):
            actuator = self.actuator(record, z)
            state = actuator.rest(record.first, began)
            poles.extend(np.linalg.eigvals(actuator.linear(state, began)[1]))
        return complex(max(poles, key=abs))

    @cached_property
    def _latest(self) -> dict[bytes, list[tuple[Array, Array]]]:
        return {}

    def parts(self, z: Array, derivatives: bool = True) -> list[tuple[Array, Array]]:
        """Compute model less reading of every run [m], and its derivative by z; cache the last."""
        key = z.tobytes()
        if derivatives and key in self._latest:
            return self._latest[key]
        self._latest.clear()
        parts, delays = [], self.split(z)[2]
        inner, gain = len(z) - len(delays), self.rig.sensor_slope
        for number, (record, solver, began) in enumerate(zip(self.records, self._solvers,
                                                             self.began, strict=True)):
            near = None if solver.last is None else float(solver.last.nodes[0, 0])
            start = self._start(record, z[:inner], began, near)
            actuator = self.actuator(record, z)
            try:
                motion = solver.solve(actuator, start, constants=z[:inner],
                                      by_constants=partial(self.by_constants, record, z)) \
                    if derivatives else solver.solve(actuator, start[:, :1])
            except Stopped as ending:
                raise InputError("is drawn in with these constants: its motion goes beyond the "
                                 "model's reach", key=actuator.specimen.name,
                                 given=f"after {ending.time:.4g} s") from None
            y, speed, by = motion.deflection(record.time + delays[number] * record.interval)
            shown = np.asarray(self.rig.reading(y, record.time - record.time[0]))
            slopes = np.zeros((len(y), len(z)))
            slopes[:, :by.shape[1]] = gain * by
            slopes[:, inner + number] = gain * record.interval * speed
            parts.append((shown - record.displacement, slopes))
        if derivatives:
            self._latest[key] = parts
        return parts

    def misfit(self, sigma: float) -> LeastSquares:
        """Make the misfit as a function of z, in units of a reading's noise [m].

        Each run's rows are replaced by the triangular factor of (derivative, residual), which has
        the same χ², gradient and curvature: a step of the search over 30,000 readings is cheap.
        """
        turned, prior = len(CONSTANTS), self.split(np.eye(len(self.start)))[2] / _DELAY
        behind = turned + self.statics.turns

        def both(z: Array) -> tuple[Array, Array]:
            try:
                parts = self.parts(z)
            except InputError:  # a trial beyond pull-in: the search steps back
                return np.full(len(prior), np.nan), prior
            rest_residual, rest_slopes = self.statics.rows(z[turned:behind])
            at_rest = np.zeros((len(rest_residual), len(z)))
            at_rest[:, turned:behind] = rest_slopes
            rows = np.concatenate([np.linalg.qr(np.column_stack([slopes, residual]) / sigma,
                                                mode="r")
                                   for residual, slopes in parts])
            return (np.concatenate([rows[:, -1], rest_residual, prior @ (z - self.start)]),
                    np.concatenate([rows[:, :-1], at_rest, prior]))

        return LeastSquares.of(both, *self.bounds)


@dataclass(frozen=True, eq=False)
class DynamicFit:
    """The viscous constants, what the data determine of them, the misfit, and the search's cost.

    ``z`` holds all unknowns of :class:`DynamicProblem`. ``sigma`` is the noise of a reading [m];
    ``inflation`` is the number of readings that count as one. ``fast`` [s] is the time in which the
    fastest motion at rest covers a radian. ``waited`` [s] is the time after a jump of the voltage
    whose readings were left out because they are too sparse to follow it.
    """

    problem: DynamicProblem
    z: Array
    sigma: float
    inflation: float
    judgement: Identifiability
    rmse: float
    evaluations: int
    seconds: float
    fast: float
    waited: float

    @property
    def viscous(self) -> Viscous:
        return Viscous(*np.exp(self.problem.split(self.z)[0]).tolist())

    def json(self) -> dict[str, Any]:
        problem = self.problem
        return {
            "noise_um": 1e6 * self.sigma,
            "rmse_um": 1e6 * self.rmse,
            "readings": problem.size,
            "variance_inflation": self.inflation,
            **self.judgement.json(),
            "runs": [{"specimen": problem.actuator(record, self.z).specimen.name,
                      "mass_kg": record.mass, "run": record.run, "began_at_V": began,
                      "interval_s": record.interval, "delay_s": float(delay * record.interval)}
                     for record, began, delay in zip(problem.records, problem.began,
                                                     problem.split(self.z)[2], strict=True)],
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "warnings": self.warnings,
        }

    @property
    def warnings(self) -> list[str]:
        warnings, given = [], self.problem.noise
        if given is not None and self.sigma > max(given, FINEST):
            warnings.append("the responses do not follow this model: misfit "
                         f"{1e6 * self.sigma:.3g} um, noise {1e6 * given:.3g} um; the limits count "
                         "the misfit as noise, and it is not")
        if self.inflation > 1:
            warnings.append(remark("alike", count=self.inflation, wide=self.inflation**0.5))
        warnings += self.problem.statics.assumed
        if self.waited:
            often = min(record.interval for record in self.problem.records)
            warnings.append(f"a reading every {1e3 * often:.3g} ms does not follow the fast "
                         f"oscillation, a radian of which takes {1e3 * self.fast:.3g} ms: those "
                         f"within {self.waited:.2g} s after a jump of the voltage were left out, "
                         "and eta_2, which damps it, is not determined")
        begun = np.abs(self.problem.split(self.z - self.problem.start)[0]) < _STAYED
        unmoved = [constant.name for constant, stays in zip(CONSTANTS, begun, strict=True)
                   if stays and constant.name in self.judgement.undetermined]
        if unmoved:
            warnings.append(remark("stays", names=", ".join(unmoved)))
        for number in dict.fromkeys(record.specimen for record in self.problem.records):
            runs = [record for record in self.problem.records if record.specimen == number]
            specimen = self.problem.actuator(runs[0], self.z).specimen
            warnings += of_loads(specimen, [run.mass for run in runs],
                                 [run.drive.peak for run in runs], self.problem.rig)
        return warnings


def identify_dynamic(problem: DynamicProblem, profiles: bool = True,
                     tell: Tell = lambda _: None) -> DynamicFit:
    """Fit k₁, η₁ and η₂ to all responses, by bounded least squares in their logarithms.

    The fit begins with the first part of every response, then takes more of it. As in the static
    fit, constants that the responses do not determine stay at their start, and limits are found by
    profiles of the misfit. ``tell`` is called with the values before the limits are found.
    """
    began, calls, z = time.perf_counter(), 0, problem.start
    problem, waited = _calm(problem)
    if problem.size <= len(z):
        raise InputError(f"needs more readings than the {len(z)} numbers to find",
                         key="transient.csv", given=problem.size)
    sigma, count = problem.noise or 1e-6, len(CONSTANTS)
    loose = np.eye(len(z))[:count] / _LOOSE
    whole = max(float(record.time[-1]) - record.begins for record in problem.records)
    period = 2 * np.pi / abs(problem.pole(problem.start))
    for length in (periods * period for periods in _PERIODS):
        if waited or length >= whole / 2:
            break
        beginning = problem.until(length).misfit(sigma).with_rows(loose, problem.start)
        minimum = minimise(beginning, z, precision=1e-2)
        calls, z = calls + minimum.evaluations, minimum.unknowns
    for _ in range(4):
        misfit = problem.misfit(sigma)
        rows, determined = unseen(misfit, z, count)
        minimum = minimise(misfit.with_rows(rows, problem.start), z, precision=1e-6)
        moved = float(np.abs(minimum.unknowns - z).max())
        calls, z = calls + minimum.evaluations, minimum.unknowns
        parts = problem.parts(z)
        squares = sum(float(residual @ residual) for residual, _ in parts)
        freedom = problem.size - determined - (len(z) - count)
        noise = Noise.left(squares, freedom, problem.noise, widen=True)
        noise = noise.with_own(np.maximum(noise.sigma, FINEST))
        inflation = variance_inflation(parts, count, noise.size)
        wide = noise.size * inflation**0.5
        settled, sigma = 0.9 < wide / sigma < 1.1, wide
        if settled and (moved < 1e-4 or determined == count):
            break
    names = [(constant.name, constant.unit) for constant in CONSTANTS]
    tell({name: float(np.exp(log)) for (name, _), log in zip(names, z[:count], strict=True)})
    judgement = identifiability(problem.misfit(sigma), z, names, noise.quantile, None, profiles)
    return DynamicFit(problem, z, noise.size, inflation, judgement,
                      (squares / problem.size) ** 0.5, calls, time.perf_counter() - began,
                      1 / abs(problem.pole(z)), waited)


def _calm(problem: DynamicProblem) -> tuple[DynamicProblem, float]:
    """Leave out an oscillation that no run follows; find how long it lasts [s].

    A fit to it has further minima, out of phase by whole periods. The time is twice that in which
    the oscillation falls from the whole range to the noise.
    """
    pole = problem.pole(problem.start)
    if any(record.interval < np.pi / abs(pole) for record in problem.records):
        return problem, 0.0
    span = max(float(np.ptp(record.displacement)) for record in problem.records)
    wait = 2 * float(np.log(max(span / (problem.noise or 1e-6), np.e)) / abs(pole.real))
    return replace(problem, records=tuple(record.calm(wait) for record in problem.records),
                   followed=False), wait


def nelder_mead_dynamic(problem: DynamicProblem) -> dict[str, Any]:
    """Fit by the paper's method: Nelder and Mead's simplex on Eq. (12), in logarithms.

    The statics are fixed.
    """
    began, start = time.perf_counter(), problem.start

    def cost(logs: Array) -> float:
        try:
            parts = problem.parts(np.append(np.clip(logs, *(end[:3] for end in problem.bounds)),
                                            start[3:]), False)
        except InputError:
            return 1e12
        return sum(float(np.mean((1e6 * residual) ** 2)) for residual, _ in parts)

    simplex = start[:3] + np.vstack([np.zeros(3), 0.3 * np.eye(3)])
    done = minimize(cost, start[:3], method="Nelder-Mead", options={
        "maxfev": 400, "maxiter": 400, "xatol": 1e-6, "fatol": 1e-9, "initial_simplex": simplex})
    return {"values": dict(zip((constant.name for constant in CONSTANTS), np.exp(done.x).tolist(),
                               strict=True)),
            "rmse_um": float((done.fun / len(problem.records)) ** 0.5),
            "evaluations": int(done.nfev),
            "converged": bool(done.success), "seconds": time.perf_counter() - began}
