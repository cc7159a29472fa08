"""Eq. (11): the lumped model's static constants from readings at rest of all shapes, masses and voltages at once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, minimize

from fem.density import maxwell
from fem.laws import Separable
from fem.rig import Rig
from geometry.errors import InputError
from geometry.specimen import Specimen
from studies.cone import ConeCircle, radii_of
from studies.lumped.table1 import known

Array = NDArray[np.float64]
Law = Literal["eq8", "film"]
Objective = Literal["deflection", "force", "printed"]

_HIGHEST_STRESS = 1e7


@dataclass(frozen=True, eq=False)
class Readings:
    """Displacements read [m] of specimens (by number) under masses [kg] and voltages [V]; ``noise`` of one, or None."""

    specimens: tuple[Specimen, ...]
    rig: Rig
    which: NDArray[np.int64]
    mass: Array
    voltage: Array
    displacement: Array
    noise: float | None = None


@dataclass(frozen=True)
class Constant:
    """One number to find: a name, a unit, where the search begins, the size it is judged by, and its bounds."""

    name: str
    unit: str
    start: float
    scale: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class StaticProblem:
    """Readings and the law: Eq. (8) with β, γ (``eq8``), or one factor on the films (``film``); and ε_r, α.

    One α of the circle with the short semi-axis serves all shapes that have two, as in the paper. Without such
    a shape it is left out.
    """

    readings: Readings
    law: Law = "eq8"

    @cached_property
    def constants(self) -> tuple[Constant, ...]:
        """What is to be found."""
        first = self.readings.specimens[0].membrane
        found: list[Constant] = []
        if self.law == "eq8":
            for name in ("beta", "gamma"):
                found += [Constant(f"{name}_{i}", "Pa", known(f"{name}_{i}"), 50e3, -_HIGHEST_STRESS, _HIGHEST_STRESS)
                          for i in (1, 2, 3)]
        else:
            found.append(Constant("stiffness", "1", 1.0, 1.0, 1e-3, 1e3))
        found.append(Constant("relative_permittivity", "1", first.relative_permittivity, 5.0, 0.0, 1e3))
        if any(len(circles) > 1 for circles in self._circles):
            found.append(Constant("alpha_1", "1", 0.5, 0.5, 0.0, 1.0))
        return tuple(found)

    def column(self, name: str) -> Array:
        """``start``, ``scale``, ``low`` or ``high`` of all constants."""
        return np.array([getattr(one, name) for one in self.constants])

    @cached_property
    def _circles(self) -> list[list[ConeCircle]]:
        return [[ConeCircle(specimen, radius) for radius in radii_of(specimen.frame)]
                for specimen in self.readings.specimens]

    def _materials(self, specimen: Specimen) -> list[Any]:
        film = specimen.membrane
        if self.law == "film":
            return [film.material]
        reference = film.area_prestretch**0.5
        pairs = [(1.0, 0.0)] * 3 + [(0.0, 1.0)] * 3
        return [Separable((beta,), (gamma,), (2.0 * i,), reference)
                for (beta, gamma), i in zip(pairs, (1, 2, 3, 1, 2, 3), strict=True)]

    def force(self, values: Array, y: Array) -> tuple[Array, Array, Array]:
        """The film's force [N] at deflections of all readings [m], its stiffness, its derivative by the constants."""
        r, count = self.readings, len(self.constants)
        force, stiffness, slopes = np.zeros(len(y)), np.zeros(len(y)), np.zeros((len(y), count))
        squared = np.asarray(r.rig.film_voltage(r.voltage)) ** 2
        for number, (specimen, circles) in enumerate(zip(r.specimens, self._circles, strict=True)):
            own = r.which == number
            at, square = y[own], squared[own]
            unit = maxwell(replace(specimen, membrane=replace(specimen.membrane, relative_permittivity=1.0)), 1.0)
            parts = []
            for circle in circles:
                columns = [circle.pull(material, at) for material in self._materials(specimen)]
                _, drawn, soft = circle.pull(unit, at)
                parts.append((np.array([*(one[1] for one in columns), square * drawn]).T,
                              np.array([*(one[2] for one in columns), square * soft]).T))
            linear = parts[0][0].shape[1]
            weights = [values[-1], 1 - values[-1]] if len(circles) > 1 else [1.0]
            pulls = sum(w * pull for w, (pull, _) in zip(weights, parts, strict=True))
            stiffs = sum(w * stiff for w, (_, stiff) in zip(weights, parts, strict=True))
            force[own] = pulls @ values[:linear] + r.rig.spring * at
            stiffness[own] = stiffs @ values[:linear] + r.rig.spring
            block = np.zeros((int(own.sum()), count))
            block[:, :linear] = pulls
            if len(circles) > 1:
                block[:, -1] = (parts[0][0] - parts[1][0]) @ values[:linear]
            slopes[own] = block
        return force, stiffness, slopes

    @property
    def read(self) -> Array:
        """Deflections that the readings stand for [m]."""
        rig = self.readings.rig
        return np.asarray((self.readings.displacement - rig.sensor_zero) / (1 + rig.sensor_gain))

    @property
    def load(self) -> Array:
        """Weights [N]."""
        return np.asarray(self.readings.rig.force(self.readings.mass))

    def rest(self, values: Array) -> tuple[Array, Array]:
        """Deflections at rest [m] and their exact derivatives by the constants (implicit function theorem).

        Newton from what was read, at most a quarter of it a step.
        """
        y, load = self.read.copy(), self.load
        most = 0.25 * np.abs(self.read) + 1e-5
        for _ in range(40):
            force, stiffness, slopes = self.force(values, y)
            move = np.clip((load - force) / stiffness, -most, most)
            y = y + move
            if np.abs(move).max() < 1e-11:
                break
        return y, -slopes / stiffness[:, None]

    def residual(self, values: Array, objective: Objective) -> tuple[Array, Array]:
        """What the search makes small, and its derivative: metres of deflection, or newtons of Eq. (11).

        ``force`` is Eq. (11) with the signs of Eq. (5); ``printed`` is Eq. (11) as it stands, where what is within its
        brackets has the sign of Eq. (5) reversed, so that it asks the film to push down with the weight.
        """
        if objective == "deflection":
            y, slopes = self.rest(values)
            return y - self.read, slopes
        force, _, slopes = self.force(values, self.read)
        sign = 1.0 if objective == "force" else -1.0
        return self.load - sign * force, -sign * slopes


@dataclass(frozen=True)
class Combination:
    """Σ c v/scale of the constants v, which the data see on its own; half its 95 % interval, None: not determined."""

    coefficients: tuple[float, ...]
    value: float
    half: float | None


@dataclass(frozen=True)
class Found:
    """One constant found; ``low``, ``high`` are 95 % limits, None where the data do not determine it."""

    name: str
    unit: str
    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True, eq=False)
class StaticFit:
    """Constants, what the data determine of them, the misfit, and what the search cost.

    ``combinations`` are the right singular vectors of the Jacobian in units of ``Constant.scale`` and of the noise, the
    best determined first; errors along them are independent. ``correlations`` are of the constants, linearised.
    """

    problem: StaticProblem
    values: Array
    sigma: float
    constants: tuple[Found, ...]
    combinations: tuple[Combination, ...]
    correlations: Array
    rmse: float
    evaluations: int
    seconds: float

    @property
    def determined(self) -> int:
        """How many numbers the data determine."""
        return sum(one.half is not None for one in self.combinations)

    def json(self) -> dict[str, Any]:
        """As the command prints it."""
        names = [one.name for one in self.constants]
        return {
            "law": self.problem.law,
            "noise_um": 1e6 * self.sigma,
            "rmse_um": 1e6 * self.rmse,
            "determined": self.determined,
            "constants": [vars(one) for one in self.constants],
            "not_determined": [one.name for one in self.constants if one.low is None],
            "combinations": [{"coefficients": dict(zip(names, one.coefficients, strict=True)), "value": one.value,
                              "half_width": one.half} for one in self.combinations],
            "correlations": self.correlations.tolist(),
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "warnings": self.warnings,
        }

    @property
    def warnings(self) -> list[str]:
        """What a reader must know."""
        given = self.problem.readings.noise
        if given is None or self.sigma <= given:
            return []
        return [f"the readings do not follow this law: misfit {1e6 * self.sigma:.3g} um, noise {1e6 * given:.3g} um; "
                "the limits count the misfit as noise, and it is not"]


#: A combination counts as determined when its 95 % half-width is below this share of the constants' scales.
_DETERMINED = 0.5
#: A misfit above so many times the stated noise is the law's, not the noise's.
_MISFIT = 2.0


def identify_static(problem: StaticProblem, objective: Objective = "deflection") -> StaticFit:
    """Fit the constants by least squares with exact derivatives, over what the data determine.

    The search moves along the singular directions of the Jacobian that the data see; the others keep the value the
    search began with, which the data, by the same decomposition, do not notice. A constant that meets its bound is held
    there. Limits are Student's (normal, where the noise is known), linearised.

    Raises
    ------
    InputError
        When there are no more readings than constants to find.
    """
    began, calls = time.perf_counter(), 0
    values, scale = problem.column("start"), problem.column("scale")
    if len(problem.read) <= len(values):
        raise InputError(f"needs more readings than constants: {len(values)} are to be found", key="static.csv",
                         given=f"{len(problem.read)} readings")
    size = problem.readings.noise or 1e-6
    free = np.ones(len(values), bool)
    # In force the problem is nearly linear: its fit is a safe place to begin from.
    safe: list[Objective] = ["force", "force", "force"] if objective == "deflection" else []
    rounds = [*safe, *[objective] * 6]
    for seek in rounds:
        kept = _directions(problem, values, free, size)
        base = values.copy()

        both = _Remembered(problem, seek, base, scale[:, None] * kept)
        done = least_squares(both.residual, np.zeros(kept.shape[1]), both.slopes, method="lm", xtol=1e-9, ftol=1e-12,
                             gtol=1e-12, max_nfev=100)
        calls += int(done.nfev)
        values = both.point(done.x)
        out = free & ((values < problem.column("low")) | (values > problem.column("high")))
        values = np.clip(values, problem.column("low"), problem.column("high"))
        free &= ~out
        if seek == objective and not out.any() and np.linalg.norm(done.x) < 1e-4:
            break
    return _judged(problem, values, calls, time.perf_counter() - began)


@dataclass(eq=False)
class _Remembered:
    """Residual and derivative along directions, in micrometres or their force, computed together and once."""

    problem: StaticProblem
    objective: Objective
    base: Array
    directions: Array
    last: tuple[Array, Array, Array] | None = None

    def point(self, z: Array) -> Array:
        """The constants at a place along the directions."""
        return np.asarray(self.base + self.directions @ z)

    def residual(self, z: Array) -> Array:
        """In the unit."""
        return self._both(z)[0]

    def slopes(self, z: Array) -> Array:
        """Its derivative along the directions."""
        return self._both(z)[1]

    def _both(self, z: Array) -> tuple[Array, Array]:
        if self.last is None or not np.array_equal(self.last[0], z):
            stiffness = float(np.mean(self.problem.load / np.abs(self.problem.read)))
            unit = 1e-6 * (1.0 if self.objective == "deflection" else stiffness)
            residual, slopes = self.problem.residual(self.point(z), self.objective)
            self.last = z.copy(), residual / unit, slopes @ self.directions / unit
        return self.last[1:]


def nelder_mead(problem: StaticProblem, objective: Objective = "force", most: int = 20_000) -> dict[str, Any]:
    """The paper's way: Nelder and Mead's simplex on the sum of squares of Eq. (11), from the same start."""
    began, scale = time.perf_counter(), problem.column("scale")
    low, high, start = problem.column("low"), problem.column("high"), problem.column("start")
    unit = float(np.mean(problem.load)) if objective != "deflection" else 1e-3

    def cost(z: Array) -> float:
        return float(np.sum((problem.residual(np.clip(start + scale * z, low, high), objective)[0] / unit) ** 2))

    done = minimize(cost, np.zeros(len(start)), method="Nelder-Mead",
                    options={"maxfev": most, "maxiter": most, "xatol": 1e-10, "fatol": 1e-16, "adaptive": True})
    values = np.clip(start + scale * done.x, low, high)
    misfit = problem.residual(values, "deflection")[0]
    return {"values": dict(zip((c.name for c in problem.constants), values.tolist(), strict=True)),
            "rmse_um": 1e6 * float(np.sqrt(np.mean(misfit**2))), "evaluations": int(done.nfev),
            "converged": bool(done.success), "seconds": time.perf_counter() - began}


def _directions(problem: StaticProblem, values: Array, free: Array, size: float) -> Array:
    """Directions in units of the scales that readings with a noise [m] determine, shape (constants, directions)."""
    jacobian = problem.residual(values, "deflection")[1] * problem.column("scale") * free / size
    _, singular, right = np.linalg.svd(jacobian, full_matrices=False)
    return right[singular > 2 / _DETERMINED].T


def _judged(problem: StaticProblem, values: Array, calls: int, seconds: float) -> StaticFit:
    from scipy.stats import norm, t

    residual, slopes = problem.residual(values, "deflection")
    scale, given = problem.column("scale"), problem.readings.noise
    _, singular, right = np.linalg.svd(slopes * scale, full_matrices=False)
    freedom = len(residual) - int(np.sum(singular > 2 * (given or 1e-6) / _DETERMINED))
    sigma = float(np.sqrt(np.sum(residual**2) / freedom))
    # A misfit that noise cannot explain widens the limits, which it would make too narrow.
    if given is not None and sigma < _MISFIT * given:
        sigma = given
    quantile = float(t.ppf(0.975, freedom)) if given is None else float(norm.ppf(0.975))
    with np.errstate(divide="ignore"):
        halves = quantile * sigma / singular
    covariance = (right.T * np.minimum(sigma / np.maximum(singular, 1e-300), 1e6) ** 2) @ right
    spread = np.sqrt(np.diag(covariance))
    found = []
    for constant, value, one in zip(problem.constants, values, spread, strict=True):
        sure = quantile * one < _DETERMINED and constant.low < value < constant.high
        half = quantile * one * constant.scale
        low, high = (max(value - half, constant.low), min(value + half, constant.high)) if sure else (None, None)
        found.append(Found(constant.name, constant.unit, float(value), low, high))
    combinations = tuple(
        Combination(tuple(direction.tolist()), float(direction @ (values / scale)),
                    float(half) if half < _DETERMINED else None)
        for direction, half in zip(right, halves, strict=True))
    return StaticFit(problem, values, sigma, tuple(found), combinations, covariance / np.outer(spread, spread),
                     float(np.sqrt(np.mean(residual**2))), calls, seconds)


def readings_of(dataset: Any) -> Readings:
    """The readings at rest of a dataset.

    Raises
    ------
    InputError
        When it has no static.csv.
    """
    static = dataset.static
    if static is None:
        raise InputError("has no static.csv: the static constants need readings at rest", key=dataset.name)
    names: Sequence[str] = [specimen.name for specimen in dataset.specimens]
    which = np.array([names.index(name) for name in static.specimen.tolist()])
    return Readings(dataset.specimens, dataset.rig, which, static.mass, static.voltage, static.displacement,
                    dataset.noise)
