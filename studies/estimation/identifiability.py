"""Identifiability of a model's constants: combinations, profiles and 95 % limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

import numpy as np

from tympan.base.arrays import Array, Mask
from tympan.base.fields import Key
from tympan.studies.estimation.least_squares import LeastSquares, minimise
from tympan.studies.estimation.profile import EXACT, Profile, profile

#: Largest 95 % half-width, as a share of its scale, of a constant or combination that counts as
#: determined.
DETERMINED = 0.5
#: Linearised half-width, in scales, up to which a profile is computed: beyond, curvature does not
#: help.
_WORTH = 2 * DETERMINED
#: Most evaluations of all profiles together; limits without any left are linearised.
_BUDGET = 600
#: Share of the largest term of a combination below which terms are not written.
_SLIGHT = 0.03
#: Standard deviation of an undetermined constant, in its scales; an Ogden constant of 500 kPa does
#: not belong to this film. Without it the fits behind a profile follow valleys without an end.
CREDIBLE = 10.0
#: Ratio of linearised limits to a profile's width from which on its fit has not converged.
_DOUBTFUL = 5.0
#: Stiffness that keeps undetermined combinations where the search began, in standard deviations per
#: scale.
_FIRM = 100.0


@dataclass(frozen=True)
class Combination:
    """A combination Σ c z of constants z, in units of their scales, that the data see separately.

    ``half`` is half its linearised 95 % interval, None if it is not determined; ``deviation`` its
    linearised standard deviation in any case.
    """

    coefficients: tuple[float, ...]
    value: float
    half: float | None
    deviation: float


@dataclass(frozen=True)
class Relation:
    """A combination of constants that the data determine."""

    formula: Annotated[str, Key("the combination as the constants write it")]
    value: Annotated[float, Key("its value")]
    low: Annotated[float, Key("lower 95 % limit")]
    high: Annotated[float, Key("upper 95 % limit")]
    unit: Annotated[str, Key("unit of the value")]


@dataclass(frozen=True)
class Estimate:
    """A constant's value and its 95 % limits."""

    name: Annotated[str, Key("name of the constant")]
    unit: Annotated[str, Key("unit of all its numbers")]
    value: Annotated[float, Key("value of the constant")]
    low: Annotated[float | None, Key("lower 95 % limit; none where the data do not determine it")]
    high: Annotated[float | None, Key("upper 95 % limit; none where the data do not determine it")]
    linear_low: Annotated[float | None, Key("lower limit, linearised; none where wider than its "
                                            "scale allows")]
    linear_high: Annotated[float | None, Key("upper limit, linearised")]
    by: Annotated[Literal["profile", "linear"], Key("way to the limits: linear where profiles were "
                                                    "not asked for or took too long")] = "profile"


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Limits of every constant and, if computed, the profile of its values.

    ``combinations`` are the right singular vectors of the Jacobian, the best determined first;
    errors along them are independent. ``correlations`` are those of the constants, linearised.
    ``quantile`` of the noise gives the 95 % limits. ``scales`` are the constants', shape (n,), None
    where the search was in their logarithms.
    """

    constants: tuple[Estimate, ...]
    combinations: tuple[Combination, ...]
    correlations: Array
    profiles: tuple[Profile | None, ...]
    quantile: float
    scales: Array | None = None

    @property
    def relations(self) -> list[Relation]:
        """Combinations of constants that the data determine, the best determined first."""
        return [self._relation(np.array(combination.coefficients), combination.half)
                for combination in self.combinations if combination.half is not None]

    def _relation(self, coefficients: Array, half: float) -> Relation:
        """Write a combination in the unit of its main constant, whose coefficient is 1."""
        first = int(np.argmax(np.abs(coefficients)))
        weights = np.where(np.abs(coefficients) < _SLIGHT * np.abs(coefficients[first]), 0.0,
                           coefficients / coefficients[first])
        half /= abs(coefficients[first])
        values = np.array([constant.value for constant in self.constants])
        unit = self.constants[first].unit
        if self.scales is None:
            value = float(np.exp(weights @ np.log(values)))
            return Relation(self._written(weights, "{name}^{weight:.3g}", " "), value,
                            value * float(np.exp(-half)), value * float(np.exp(half)),
                            unit if np.count_nonzero(weights) == 1 else "")
        weights = weights * self.scales[first] / self.scales
        half, value = half * float(self.scales[first]), float(weights @ values)
        return Relation(self._written(weights, "{weight:.3g} {name}", " + "), value, value - half,
                        value + half, unit)

    def _written(self, weights: Array, form: str, between: str) -> str:
        terms = [constant.name if weight == 1 else form.format(name=constant.name, weight=weight)
                 for constant, weight in zip(self.constants, weights, strict=True) if weight]
        return between.join(terms).replace("+ -", "- ")

    @property
    def determined(self) -> int:
        """Number of independent combinations that the data determine."""
        return sum(combination.half is not None for combination in self.combinations)

    @property
    def undetermined(self) -> list[str]:
        """Names of the constants that the data do not determine."""
        return [constant.name for constant in self.constants if constant.low is None]

    def json(self) -> dict[str, Any]:
        """Write the result as a JSON object, as the command prints it."""
        names = [constant.name for constant in self.constants]
        return {
            "determined": self.determined,
            "constants": [vars(constant) for constant in self.constants],
            "not_determined": self.undetermined,
            "combinations": [
                {"coefficients": dict(zip(names, combination.coefficients, strict=True)),
                 "value": combination.value, "half_width": combination.half}
                for combination in self.combinations],
            "relations": [vars(relation) for relation in self.relations],
            "correlations": self.correlations.tolist(),
        }


def _seen(problem: LeastSquares, at: Array, count: int) -> tuple[Array, Array]:
    """Compute the sensitivity of readings to the first unknowns, and its rows; others are free."""
    slopes = problem.at(at).jacobian
    free = np.linalg.qr(slopes[:, count:])[0]
    constants = slopes[:, :count] - free @ (free.T @ slopes[:, :count])
    _, singular, right = np.linalg.svd(constants, full_matrices=False)
    return singular, right


def unseen(problem: LeastSquares, at: Array, count: int) -> tuple[Array, int]:
    """Make rows that hold undetermined combinations of the first unknowns; count the others.

    The rows serve :meth:`LeastSquares.with_rows`, centred where the search began: without them
    these combinations would follow the noise to the ends of their bounds.
    """
    singular, right = _seen(problem, at, count)
    determined = int(np.sum(singular > 2 / DETERMINED))
    rows = np.zeros((count - determined, len(at)))
    rows[:, :count] = _FIRM * right[determined:]
    return rows, determined


def seen_by(jacobian: Array) -> tuple[Array, Array, Mask]:
    """Compute the sensitivity of readings to unknowns from derivatives of residuals, (n, p).

    The result is an orthonormal basis of residuals that unknowns change, (n, k); the unknowns by
    their parts in it, (p, k); and a mask of unknowns that change nothing, (p,).
    """
    lengths = np.linalg.norm(jacobian, axis=0)
    safe = np.where(lengths > 0, lengths, 1.0)
    basis, singular, right = np.linalg.svd(jacobian / safe, full_matrices=False)
    seen = singular > 1e-10 * singular[0]
    hidden = (np.abs(right[~seen]) > 1e-6).any(axis=0) | (lengths == 0)
    back = right[seen].T / singular[seen] / safe[:, None]
    return basis[:, seen], back, hidden


def covariance(jacobian: Array, sigma: float) -> Array:
    """Compute the linearised covariance of unknowns, (p, p); inf where an unknown changes nothing.

    ``jacobian`` is that of the residuals, shape (n, p), in units in which a reading's standard
    deviation is ``sigma``.
    """
    _, back, hidden = seen_by(jacobian)
    unseen = np.diag(np.where(hidden, np.inf, 0.0))
    return np.asarray(sigma**2 * back @ back.T + unseen)


def identifiability(problem: LeastSquares, best: Array, names: Sequence[tuple[str, str]],
                    quantile: float, scales: Array | None, profiles: bool = True,
                    most: int = _BUDGET) -> Identifiability:
    """Compute limits at a minimum of a problem in units of the noise, constants in their scales.

    The first unknowns in ``best``, shape (p,), are the constants of these ``names`` and units; the
    others are fitted again. Constants are unknowns times ``scales`` or, without scales, their
    exponentials. Without ``profiles`` the limits are linearised, and so are those that are not done
    after ``most`` evaluations.
    """
    count, spent = len(names), 0

    def value_of(index: int, z: float) -> float:
        return float(np.exp(z) if scales is None else scales[index] * z)

    singular, right = _seen(problem, best, count)
    with np.errstate(divide="ignore"):
        halves = quantile / singular
    deviations = 1 / np.maximum(singular, 1e-14 * singular[0])
    credible, wide = ((right.T * width**2) @ right
                      for width in (np.minimum(deviations, CREDIBLE), deviations))
    spread = quantile * np.sqrt(np.diag(credible))
    anchored = problem.with_rows(np.eye(len(best))[:count] / CREDIBLE, best)
    # With everything free, undetermined combinations follow the noise, and χ² is smaller by about
    # one for each of them.
    free = minimise(anchored, best, precision=0.0, exact=EXACT).unknowns if profiles else best
    estimates, lines = [], []
    for index, (name, unit) in enumerate(names):
        z, half = float(best[index]), float(spread[index])
        least, largest = float(problem.low[index]), float(problem.high[index])
        inside = least < z < largest
        rough = (max(z - half, least), min(z + half, largest)) if inside and half < DETERMINED \
            else None
        worth = profiles and inside and half < _WORTH
        line = profile(anchored, free, index, quantile, most=most - spent) if worth else None
        spent += line.evaluations if line else 0
        linear = not profiles or spent > most
        limits = rough if linear else (line.low, line.high) if line else None
        sure = _credible(limits, z, 2 * half / _DOUBTFUL)
        low, high, linear_low, linear_high = (limits and value_of(index, limits[side])
                                              for limits in (sure, rough) for side in (0, 1))
        estimates.append(Estimate(name, unit, value_of(index, z), low, high, linear_low,
                                  linear_high, "linear" if linear else "profile"))
        lines.append(None if line is None or linear else _in_values(line, index, value_of))
    combinations = tuple(
        Combination(tuple(direction.tolist()), float(direction @ best[:count]),
                    float(half) if half < DETERMINED else None, float(half / quantile))
        for direction, half in zip(right, halves, strict=True))
    lengths = np.sqrt(np.diag(wide))
    return Identifiability(tuple(estimates), combinations, wide / np.outer(lengths, lengths),
                           tuple(lines), quantile, scales)


def _credible(limits: tuple[float | None, float | None] | None, best: float,
              least: float) -> tuple[float, float] | None:
    """Check limits: both exist, on both sides of the best value, neither too far nor too close."""
    low, high = limits or (None, None)
    if low is None or high is None or not least <= high - low <= 2 * DETERMINED:
        return None
    return (low, high) if low <= best <= high else None


def _in_values(line: Profile, index: int, value_of: Callable[[int, float], float]) -> Profile:
    low, high = (None if z is None else value_of(index, z) for z in (line.low, line.high))
    values = np.array([value_of(index, z) for z in line.values.tolist()])
    return replace(line, values=values, low=low, high=high)
