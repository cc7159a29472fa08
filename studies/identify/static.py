"""Eq. (11): static constants from readings at rest of all shapes, masses and voltages at once."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from scipy.optimize import minimize

from tympan.base.arrays import Array, Numbers
from tympan.base.errors import InputError
from tympan.fem.film.density import maxwell
from tympan.fem.film.laws import Separable
from tympan.fem.film.laws.stiffened import scaled
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.circles import ConeCircle
from tympan.studies.columns import Sheet
from tympan.studies.data.dataset import Dataset
from tympan.studies.estimation.identifiability import (
    CREDIBLE,
    Identifiability,
    identifiability,
    unseen,
)
from tympan.studies.estimation.least_squares import LeastSquares, minimise
from tympan.studies.estimation.noise import Noise
from tympan.studies.lumped.actuator import Actuator, Viscous
from tympan.studies.lumped.eq8 import table_1_law
from tympan.studies.lumped.equilibria import settle
from tympan.studies.lumped.remarks import is_cone, of_loads, remark, softness

Law = Literal["eq8", "film"]
Sharing = Literal["each", "shared", "given"]
StaticObjective = Literal["deflection", "force", "printed"]
#: Called with the values by name as soon as they are found.
Tell = Callable[[dict[str, float]], None]

#: Largest magnitude of a constant of Eq. (8) [Pa].
_HIGHEST_STRESS = 1e7
#: Powers of Eq. (8).
_POWERS = (2.0, 4.0, 6.0)
#: Standard deviation of a combination, in scales of the constants, above which it has no effect on
#: any response.
_UNNOTICED = 100.0


@dataclass(frozen=True)
class ModelConstant:
    """A number to find: name, unit, start of the search, typical size, bounds."""

    name: str
    unit: str
    start: float
    scale: float
    low: float
    high: float


def readings_at_rest(dataset: Dataset) -> Sheet:
    """Read the readings of static.csv; an InputError where there is no such file."""
    if dataset.static is None:
        raise InputError("has no static.csv: the static constants need readings at rest",
                         key=dataset.name)
    return dataset.static


@dataclass(frozen=True, eq=False)
class StaticProblem:
    """Displacements read [m] of actuators (by number ``which``), and the constants to find.

    The ``actuators`` are the nominal ones, on one rig, whatever their masses. ``noise`` is the
    standard deviation of one reading [m]. The constants are those of a law, ε_r and α. The law is
    Eq. (8) (``eq8``) or one factor on the films (``film``). α is the weight of the first of two
    circles. It is found for every shape that has two (``each``), or once for all as in Eq. (11)
    (``shared``), which leaves the difference of the shapes to the other constants. It is not found
    if it is ``given``.
    """

    actuators: tuple[Actuator, ...]
    which: Numbers
    mass: Array
    voltage: Array
    displacement: Array
    noise: float | None = None
    law: Law = "eq8"
    alpha: Sharing = "each"

    def __post_init__(self) -> None:
        if self.alpha != "given" and any(actuator.count > 2 for actuator in self.actuators):
            raise InputError("an α can be found of two circles at most: take those of the model",
                             key="--alpha", given=self.alpha)

    @classmethod
    def of(cls, dataset: Dataset, actuators: tuple[Actuator, ...], law: Law = "eq8",
           alpha: Sharing = "each") -> StaticProblem:
        """Take the readings at rest of a dataset; ``actuators`` model its specimens in order."""
        static = readings_at_rest(dataset)
        names = [specimen.name for specimen in dataset.specimens]
        which = np.array([names.index(name) for name in static.specimen.tolist()])
        return cls(actuators, which, static.mass, static.voltage, static.displacement,
                   dataset.noise, law, alpha)

    @property
    def specimens(self) -> tuple[Specimen, ...]:
        return tuple(actuator.specimen for actuator in self.actuators)

    @property
    def rig(self) -> Rig:
        return self.actuators[0].rig

    @cached_property
    def constants(self) -> tuple[ModelConstant, ...]:
        first = self.specimens[0].membrane
        constants: list[ModelConstant] = []
        if self.law == "eq8":
            began = table_1_law()
            for name, starts in (("beta", began.beta), ("gamma", began.gamma)):
                constants += [ModelConstant(f"{name}_{i}", "Pa", start, 50e3, -_HIGHEST_STRESS,
                                       _HIGHEST_STRESS) for i, start in enumerate(starts, 1)]
        else:
            constants.append(ModelConstant("stiffness", "1", 1.0, 1.0, 1e-3, 1e3))
        # The range of a film's permittivity: 1 is vacuum.
        constants.append(ModelConstant("relative_permittivity", "1", first.relative_permittivity,
                                       5.0, 1.0, 1e3))
        constants += [ModelConstant(name, "1", 0.5, 0.5, 0.0, 1.0)
                      for name in dict.fromkeys(self._alphas) if name]
        return tuple(constants)

    def column(self, name: str) -> Array:
        """Collect ``start``, ``scale``, ``low`` or ``high`` of all constants."""
        return np.array([getattr(constant, name) for constant in self.constants])

    @cached_property
    def _alphas(self) -> tuple[str, ...]:
        """The name of every actuator's α; empty where no α is to be found."""
        radii = [tuple(np.ravel(actuator.circles.radius).tolist()) for actuator in self.actuators]
        shapes: dict[tuple[float, ...], str] = {}
        for specimen, pair in zip(self.specimens, radii, strict=True):
            if len(pair) > 1 and self.alpha != "given":
                shapes.setdefault(pair, f"alpha_1[{specimen.name}]")
        if self.alpha == "shared" or len(shapes) == 1:
            shapes = dict.fromkeys(shapes, "alpha_1")
        return tuple(shapes.get(pair, "") for pair in radii)

    @cached_property
    def _units(self) -> tuple[tuple[ConeCircle, *tuple[Any, ...]], ...]:
        """Each specimen's circles, and their loads by unit constant: materials, voltage."""
        films = []
        for actuator in self.actuators:
            specimen, film = actuator.specimen, actuator.specimen.membrane
            materials = (film.material,) if self.law == "film" else tuple(
                Separable((beta,), (1 - beta,), (power,), film.area_prestretch**0.5)
                for beta in (1.0, 0.0) for power in _POWERS)
            unit = replace(specimen, membrane=replace(film, relative_permittivity=1.0))
            films.append((actuator.circles, *materials, maxwell(unit, 1.0)))
        return tuple(films)

    def weights(self, number: int, values: Any) -> tuple[Any, ...]:
        if not self._alphas[number]:
            return tuple(self.actuators[number].weights)
        alpha = values[self._place(number)]
        return alpha, 1 - alpha

    def weights_by_constants(self, number: int) -> Array:
        """Differentiate the weights by the constants, shape (circles, constants)."""
        slopes = np.zeros((self.actuators[number].count, len(self.constants)))
        if self._alphas[number]:
            slopes[:, self._place(number)] = 1.0, -1.0
        return slopes

    def _place(self, number: int) -> int:
        return [constant.name for constant in self.constants].index(self._alphas[number])

    def specimen(self, number: int, values: Any) -> Specimen:
        specimen = self.specimens[number]
        film = specimen.membrane
        if self.law == "film":
            law, permittivity = scaled(film.material, values[0]), values[1]
        else:
            law = Separable(tuple(values[:3]), tuple(values[3:6]), _POWERS,
                            film.area_prestretch**0.5)
            permittivity = values[6]
        return replace(specimen,
                       membrane=replace(film, material=law, relative_permittivity=permittivity))

    def force(self, values: Array, y: Array) -> tuple[Array, Array, Array]:
        """Compute the film's force [N] at deflections of all readings [m], and its derivatives.

        They are by the deflection and by the constants. The shapes are (readings,), (readings,) and
        (readings, constants).
        """
        force, stiffness = np.zeros(len(y)), np.zeros(len(y))
        slopes = np.zeros((len(y), len(self.constants)))
        for number in range(len(self.specimens)):
            rows = self.which == number
            force[rows], stiffness[rows], slopes[rows] = self.force_of(number, values, y[rows],
                                                                       self.voltage[rows])
        return force, stiffness, slopes

    def force_of(self, number: int, values: Array, y: Array,
                 voltage: Array) -> tuple[Array, Array, Array]:
        """Compute a specimen's force and derivatives at deflections [m] and voltages [V].

        Deflections and voltages have the shape (points,).
        """
        actuator, (circles, *parts) = self.actuators[number], self._units[number]
        squared = actuator.permittivity * np.asarray(self.rig.film_voltage(voltage))[:, None] ** 2
        parted = (circles.pull(part, y[:, None])[1:] for part in parts)
        # Force and stiffness are linear in the constants: shape (constants, points, circles).
        pulls, stiffs = (np.stack([*(actuator.stiffness * film for film in films), squared * drawn])
                         for *films, drawn in zip(*parted, strict=True))
        weights, linear = np.array(self.weights(number, values)), values[:len(pulls)]
        slopes = np.zeros((len(y), len(self.constants)))
        slopes[:, :len(linear)] = (pulls @ weights).T
        if self._alphas[number]:
            slopes[:, self._place(number)] = linear @ (pulls[..., 0] - pulls[..., 1])
        force = slopes[:, :len(linear)] @ linear
        _, beside, stiffness = actuator.beside(y)
        return force + beside, linear @ (stiffs @ weights) + stiffness, slopes

    @property
    def read(self) -> Array:
        """Deflections of the readings [m], without the sensor's errors."""
        return np.asarray(self.rig.deflection(self.displacement))

    @property
    def load(self) -> Array:
        areas = np.array([actuator.plate_area for actuator in self.actuators])
        return np.asarray(self.rig.force(self.mass, areas[self.which]))

    def rest(self, values: Array) -> tuple[Array, Array]:
        """Compute the deflections at rest [m] and their derivatives by the constants (implicit).

        Newton's method starts at the readings; a step is at most a quarter of the reading.
        """
        def balance(y: Array) -> tuple[Array, Array]:
            force, stiffness, _ = self.force(values, y)
            return force - self.load, stiffness

        y = settle(balance, self.read, 0.25 * np.abs(self.read) + 1e-5)
        _, stiffness, slopes = self.force(values, y)
        return y, -slopes / stiffness[:, None]

    def residual(self, values: Array, objective: StaticObjective) -> tuple[Array, Array]:
        """Compute a search's residual and its derivative: deflections [m] or Eq. (11)'s forces [N].

        ``force`` is Eq. (11) with the signs of Eq. (5). ``printed`` is Eq. (11) as it is printed:
        the terms within its brackets have the sign of Eq. (5) reversed, so that the film would push
        down with the weight.
        """
        if objective == "deflection":
            y, slopes = self.rest(values)
            return y - self.read, slopes
        force, _, slopes = self.force(values, self.read)
        sign = 1.0 if objective == "force" else -1.0
        return self.load - sign * force, -sign * slopes


@dataclass(frozen=True, eq=False)
class StaticFit:
    """Constants, what the data determine of them, the misfit, and what the search cost.

    A fit to readings in time may change these constants as far as the readings at rest allow, which
    are part of that fit: many readings in time may determine what few at rest do not. A turn of 1
    moves the constants by one standard deviation along a combination, at most by ten of their
    scales.
    """

    problem: StaticProblem
    values: Array
    sigma: float
    judgement: Identifiability
    rmse: float
    evaluations: int
    seconds: float

    @property
    def assumed(self) -> list[str]:
        """Sentences on constants taken as exact: none, as readings at rest determine them."""
        return []

    @cached_property
    def directions(self) -> Array:
        """Changes of the constants, a column for each combination that may affect a reading."""
        scale = self.problem.column("scale")
        return np.array([scale * combination.coefficients * min(combination.deviation, CREDIBLE)
                         for combination in self.judgement.combinations
                         if combination.deviation < _UNNOTICED]).T

    @property
    def turns(self) -> int:
        return int(self.directions.shape[1])

    @property
    def rig(self) -> Rig:
        return self.problem.rig

    def actuator(self, number: int, mass: float, turn: Any, viscous: Viscous) -> Actuator:
        """Make the actuator of a specimen (by number); ``turn`` is the change by direction."""
        problem, values = self.problem, self.values + self.directions @ turn
        nominal = problem.actuators[number]
        circles = replace(nominal.circles, specimen=problem.specimen(number, values))
        return replace(nominal, circles=circles, weights=problem.weights(number, values),
                       mass=mass, viscous=viscous)

    def rows(self, turn: Array) -> tuple[Array, Array]:
        """Compute the residuals at rest, over their noise, and their derivatives by the turns.

        Further rows are the prior of the constants: :data:`CREDIBLE` of their scales.
        """
        residual, slopes = self.problem.residual(self.values + self.directions @ turn, "deflection")
        firm = self.directions / (CREDIBLE * self.problem.column("scale")[:, None])
        return (np.concatenate([residual / self.sigma, firm @ turn]),
                np.concatenate([slopes @ self.directions / self.sigma, firm]))

    def by_turn(self, number: int, turn: Array, y: Array, voltage: Array) -> Array:
        """Differentiate a specimen's force [N] by the turns, shape (points, turns)."""
        values = self.values + self.directions @ turn
        slopes = self.problem.force_of(number, values, y, voltage)[2]
        return np.asarray(slopes @ self.directions)

    def weights_by_turn(self, number: int) -> Array:
        """Differentiate a specimen's weights by the turns, shape (circles, turns)."""
        return self.problem.weights_by_constants(number) @ self.directions

    def json(self) -> dict[str, Any]:
        return {
            "law": self.problem.law,
            "alpha": self.problem.alpha,
            "noise_um": 1e6 * self.sigma,
            "rmse_um": 1e6 * self.rmse,
            **self.judgement.json(),
            "evaluations": self.evaluations,
            "seconds": self.seconds,
            "warnings": self.warnings,
        }

    @property
    def warnings(self) -> list[str]:
        warnings, given = [], self.problem.noise
        if given is not None and self.sigma > given:
            warnings.append(
                f"the readings do not follow this law: misfit {1e6 * self.sigma:.3g} um, noise "
                f"{1e6 * given:.3g} um; the limits count the misfit as noise, and it is not")
        cones = {softness(actuator): None for actuator in self.problem.actuators
                 if is_cone(actuator)}
        if cones:
            warnings.append(remark("cone_found", factors=", ".join(cones)))
        for number, specimen in enumerate(self.problem.specimens):
            here = self.problem.which == number
            warnings += of_loads(specimen, self.problem.mass[here].tolist(),
                                 self.problem.voltage[here].tolist(), self.rig)
        return warnings


def identify_static(problem: StaticProblem, objective: StaticObjective = "deflection",
                    profiles: bool = True, tell: Tell = lambda _: None) -> StaticFit:
    """Fit the constants by bounded least squares, and judge what the readings determine.

    Combinations that the readings do not determine, found by the singular directions of the
    Jacobian, stay where the search began. Limits are Student's (normal, where the noise is known).
    They are profiles of the misfit in deflection where that was the ``objective``, else linearised.
    ``tell`` is called with the values before the limits are found.
    """
    began, calls = time.perf_counter(), 0
    scale, size = problem.column("scale"), problem.noise or 1e-6
    z = start = problem.column("start") / scale
    if len(problem.read) <= len(z):
        raise InputError(f"needs more readings than constants: {len(z)} are to be found",
                         key="static.csv", given=f"{len(problem.read)} readings")
    # In force the problem is nearly linear: its fit is a safe start.
    safe: list[StaticObjective] = ["force", "force"] if objective == "deflection" else []
    for seek in [*safe, *[objective] * 6]:
        rows, determined = unseen(_misfit(problem, "deflection", size), z, len(z))
        minimum = minimise(_misfit(problem, seek, size).with_rows(rows, start), z)
        moved = float(np.abs(minimum.unknowns - z).max())
        calls, z = calls + minimum.evaluations, minimum.unknowns
        if seek == objective and moved < 1e-4:
            break
    residual = problem.residual(scale * z, "deflection")[0]
    noise = Noise.left(float(residual @ residual), len(residual) - determined, problem.noise,
                     widen=True)
    names = [(constant.name, constant.unit) for constant in problem.constants]
    tell({name: float(value) for (name, _), value in zip(names, scale * z, strict=True)})
    judgement = identifiability(_misfit(problem, "deflection", noise.size), z, names,
                                noise.quantile, scale, profiles and objective == "deflection")
    rmse = float(np.sqrt(np.mean(residual**2)))
    return StaticFit(problem, scale * z, noise.size, judgement, rmse, calls,
                     time.perf_counter() - began)


def _misfit(problem: StaticProblem, objective: StaticObjective, size: float) -> LeastSquares:
    """Make the residuals over the scaled constants, in a reading's noise [m] or its force."""
    scale = problem.column("scale")
    stiffness = float(np.mean(problem.load / np.abs(problem.read)))
    unit = size * (1.0 if objective == "deflection" else stiffness)

    def both(z: Array) -> tuple[Array, Array]:
        residual, slopes = problem.residual(scale * z, objective)
        return residual / unit, slopes * scale / unit

    return LeastSquares.of(both, problem.column("low") / scale, problem.column("high") / scale)


def nelder_mead(problem: StaticProblem, most: int = 20_000) -> dict[str, Any]:
    """Fit by the paper's method: Nelder and Mead's simplex on Eq. (11), from the same start."""
    began = time.perf_counter()
    scale, low, high, start = (problem.column(name) for name in ("scale", "low", "high", "start"))
    unit = float(np.mean(problem.load))

    def values_of(z: Array) -> Array:
        return np.clip(start + scale * z, low, high)

    def cost(z: Array) -> float:
        return float(np.sum((problem.residual(values_of(z), "force")[0] / unit) ** 2))

    done = minimize(cost, np.zeros(len(start)), method="Nelder-Mead",
                    options={"maxfev": most, "maxiter": most, "xatol": 1e-10, "fatol": 1e-16,
                             "adaptive": True})
    values = values_of(done.x)
    misfit = problem.residual(values, "deflection")[0]
    return {"values": dict(zip((c.name for c in problem.constants), values.tolist(), strict=True)),
            "rmse_um": 1e6 * float(np.sqrt(np.mean(misfit**2))), "evaluations": int(done.nfev),
            "converged": bool(done.success), "seconds": time.perf_counter() - began}
