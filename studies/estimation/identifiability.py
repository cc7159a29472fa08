"""What readings determine of a model's constants: independent combinations and 95 % limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.studies.estimation.least_squares import LeastSquares
from tympan.studies.estimation.profile import Profile, profile, settled_minimum

Array = NDArray[np.float64]

#: A constant or combination counts as determined when its 95 % half-width is below this share of
#: its scale.
DETERMINED = 0.5
#: Up to so many scales of linearised half-width a profile is worth its time: beyond, no curvature
#: mends it.
_WORTH = 4.0
#: How far a constant nobody sees may be off, as a standard deviation in its scales; an Ogden
#: constant of 500 kPa is not one of this film. Without it the fits behind a profile wander along
#: valleys without an end.
CREDIBLE = 10.0
#: A profile so many times narrower than the linearised limits comes of a fit that did not arrive.
_DOUBTFUL = 5.0
#: How firmly what readings do not determine stays where the search began, in standard deviations
#: per scale.
_FIRM = 100.0


@dataclass(frozen=True)
class Combination:
    """Σ c z of the constants z in units of their scales, which the data see on its own.

    ``half`` is half its linearised 95 % interval, None where it is not determined; ``deviation``
    its linearised standard deviation in any case.
    """

    coefficients: tuple[float, ...]
    value: float
    half: float | None
    deviation: float


@dataclass(frozen=True)
class Estimate:
    """A constant's value in its ``unit``, and its 95 % limits.

    ``low`` and ``high`` are by profile, None where the data do not determine it; ``linear_low`` and
    ``linear_high`` are the linearised ones, None where they are wider than its scale allows.
    """

    name: str
    unit: str
    value: float
    low: float | None
    high: float | None
    linear_low: float | None
    linear_high: float | None


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Of every constant its limits and, where one was made, its profile (in units of the scales).

    ``combinations`` are the right singular vectors of the Jacobian, the best determined first;
    errors along them are independent. ``correlations`` are of the constants, linearised.
    ``quantile`` of the noise makes the 95 % limits.
    """

    constants: tuple[Estimate, ...]
    combinations: tuple[Combination, ...]
    correlations: Array
    profiles: tuple[Profile | None, ...]
    quantile: float
    values_of: Callable[[int, float], float]

    @property
    def determined(self) -> int:
        """How many independent numbers the data determine."""
        return sum(combination.half is not None for combination in self.combinations)

    @property
    def undetermined(self) -> list[str]:
        """Names of the constants the data do not determine."""
        return [constant.name for constant in self.constants if constant.low is None]

    def to_value(self, name: str, z: float) -> float:
        """The value of a constant that is z in the search's unit."""
        return self.values_of([constant.name for constant in self.constants].index(name), z)

    def json(self) -> dict[str, Any]:
        """As the command prints it."""
        names = [constant.name for constant in self.constants]
        return {
            "determined": self.determined,
            "constants": [vars(constant) for constant in self.constants],
            "not_determined": self.undetermined,
            "combinations": [
                {"coefficients": dict(zip(names, combination.coefficients, strict=True)),
                 "value": combination.value, "half_width": combination.half}
                for combination in self.combinations],
            "correlations": self.correlations.tolist(),
        }


def seen(problem: LeastSquares, at: Array, count: int) -> tuple[Array, Array]:
    """How well, and along which directions (rows), readings see the first ``count`` unknowns.

    The others are left free.
    """
    slopes = problem.at(at).jacobian
    free = np.linalg.qr(slopes[:, count:])[0]
    constants = slopes[:, :count] - free @ (free.T @ slopes[:, :count])
    _, singular, right = np.linalg.svd(constants, full_matrices=False)
    return singular, right


def unseen(problem: LeastSquares, at: Array, count: int) -> tuple[Array, int]:
    """Rows that hold what readings do not see of the first unknowns, and how many they do see.

    For :meth:`LeastSquares.with_rows`, centred where the search began: left to itself it would
    follow the noise to the ends of its bounds.
    """
    singular, right = seen(problem, at, count)
    determined = int(np.sum(singular > 2 / DETERMINED))
    rows = np.zeros((count - determined, len(at)))
    rows[:, :count] = _FIRM * right[determined:]
    return rows, determined


def covariance(jacobian: Array, sigma: float) -> Array:
    """Linearised covariance of unknowns, shape (p, p); inf on the diagonal where nothing sees one.

    Parameters
    ----------
    jacobian
        Of the residuals, shape (n, p), in units in which a reading's standard deviation is
        ``sigma``.
    """
    lengths = np.linalg.norm(jacobian, axis=0)
    safe = np.where(lengths > 0, lengths, 1.0)
    _, singular, right = np.linalg.svd(jacobian / safe, full_matrices=False)
    seen_at_all = singular > 1e-10 * singular[0]
    unit = (right[seen_at_all].T / singular[seen_at_all] ** 2) @ right[seen_at_all]
    result = sigma**2 * unit / np.outer(safe, safe)
    hidden = (np.abs(right[~seen_at_all]) > 1e-6).any(axis=0) | (lengths == 0)
    result[np.diag_indices_from(result)] = np.where(hidden, np.inf, np.diag(result))
    return np.asarray(result)


def identifiability(problem: LeastSquares, best: Array, names: Sequence[tuple[str, str]],
                    quantile: float, values_of: Callable[[int, float], float],
                    profiles: bool = True) -> Identifiability:
    """Limits at a minimum of a problem in units of the noise, each constant in units of its scale.

    Parameters
    ----------
    best
        The minimum, shape (p,); what comes after the constants is left to fit.
    names
        Each constant's name and unit.
    values_of
        ``values_of(index, z)`` is a constant's value at z.
    profiles
        Without them the limits are linearised.
    """
    count = len(names)
    singular, right = seen(problem, best, count)
    with np.errstate(divide="ignore"):
        halves = quantile / singular
    deviations = 1 / np.maximum(singular, 1e-14 * singular[0])
    credible, wide = ((right.T * width**2) @ right
                      for width in (np.minimum(deviations, CREDIBLE), deviations))
    spread = quantile * np.sqrt(np.diag(credible))
    anchored = problem.with_rows(np.eye(len(best))[:count] / CREDIBLE, best)
    free = settled_minimum(anchored, best) if profiles else best
    estimates, lines = [], []
    for index, (name, unit) in enumerate(names):
        z, half = float(best[index]), float(spread[index])
        inside = problem.low[index] < z < problem.high[index]
        linear = (max(z - half, float(problem.low[index])),
                  min(z + half, float(problem.high[index])))
        line = None
        if profiles and inside and half < _WORTH:
            line = profile(anchored, free, index, quantile)
        lines.append(line)
        rough = linear if inside and half < DETERMINED else None
        if profiles:
            sure = None if line is None else _limited(line.low, line.high, 2 * half / _DOUBTFUL)
        else:
            sure = rough and _limited(*rough, 2 * half / _DOUBTFUL)
        ends = [None if limits is None else values_of(index, limits[side])
                for limits in (sure, rough) for side in (0, 1)]
        estimates.append(Estimate(name, unit, values_of(index, z), *ends))
    combinations = tuple(
        Combination(tuple(direction.tolist()), float(direction @ best[:count]),
                    float(half) if half < DETERMINED else None, float(half / quantile))
        for direction, half in zip(right, halves, strict=True))
    lengths = np.sqrt(np.diag(wide))
    return Identifiability(tuple(estimates), combinations, wide / np.outer(lengths, lengths),
                           tuple(lines), quantile, values_of)


def _limited(low: float | None, high: float | None, least: float) -> tuple[float, float] | None:
    """The limits, where both are there and neither too far apart nor closer than can be."""
    if low is None or high is None or not least <= high - low <= 2 * DETERMINED:
        return None
    return low, high
