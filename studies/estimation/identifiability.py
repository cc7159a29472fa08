"""What readings determine of a model's constants: independent combinations, and 95 % limits of each constant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from tympan.studies.estimation.least_squares import Noise
from tympan.studies.estimation.profile import Misfit, Profile, profile, settled

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
#: A misfit above so many times the stated noise is the law's, not the noise's.
MISFIT = 2.0


class Named(Protocol):
    """A constant as the limits need it."""

    @property
    def name(self) -> str:
        """What it is called."""

    @property
    def unit(self) -> str:
        """Its unit."""


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
class Found:
    """One constant found; ``low``, ``high`` are 95 % limits by profile, None where the data do not determine it.

    ``linear_low`` and ``linear_high`` are the linearised ones, None where they are wider than its
    scale allows.
    """

    name: str
    unit: str
    value: float
    low: float | None
    high: float | None
    linear_low: float | None
    linear_high: float | None


@dataclass(frozen=True, eq=False)
class Judgement:
    """Of every constant its limits and, where one was made, its profile (in units of the scales); the combinations.

    ``combinations`` are the right singular vectors of the Jacobian, the best determined first;
    errors along them are independent. ``correlations`` are of the constants, linearised.
    ``quantile`` of the noise makes the 95 % limits.
    """

    constants: tuple[Found, ...]
    combinations: tuple[Combination, ...]
    correlations: Array
    profiles: tuple[Profile | None, ...]
    quantile: float
    values_of: Callable[[int, float], float]

    @property
    def determined(self) -> int:
        """How many independent numbers the data determine."""
        return sum(one.half is not None for one in self.combinations)

    @property
    def undetermined(self) -> list[str]:
        """Names of the constants the data do not determine."""
        return [one.name for one in self.constants if one.low is None]

    def to_value(self, name: str, z: float) -> float:
        """The value of a constant that is z in the search's unit."""
        return self.values_of([one.name for one in self.constants].index(name), z)

    def json(self) -> dict[str, Any]:
        """As the command prints it."""
        names = [one.name for one in self.constants]
        return {
            "determined": self.determined,
            "constants": [vars(one) for one in self.constants],
            "not_determined": self.undetermined,
            "combinations": [{"coefficients": dict(zip(names, one.coefficients, strict=True)),
                              "value": one.value,
                              "half_width": one.half} for one in self.combinations],
            "correlations": self.correlations.tolist(),
        }


def noise_of(squares: float, freedom: int, given: float | None) -> Noise:
    """The noise stated, or that of the residuals; their misfit where the stated noise cannot explain it."""
    estimated = Noise.of(squares, freedom, None)
    if given is None:
        return estimated
    stated = Noise.of(squares, freedom, given)
    # A misfit that noise cannot explain widens the limits, which it would make too narrow.
    return stated if estimated.sigma < MISFIT * given else Noise(estimated.sigma, stated.quantile)


def seen(misfit: Misfit, at: Array, count: int) -> tuple[Array, Array]:
    """How well, and along which directions (rows), readings see the first ``count`` constants, the others left free."""
    _, slopes = misfit.both(at)
    free = np.linalg.qr(slopes[:, count:])[0]
    own = slopes[:, :count] - free @ (free.T @ slopes[:, :count])
    _, singular, right = np.linalg.svd(own, full_matrices=False)
    return singular, right


#: How firmly what readings do not determine stays where the search began, in standard deviations
#: per scale.
_FIRM = 100.0


def unseen(misfit: Misfit, at: Array, count: int) -> tuple[Array, int]:
    """Rows that hold what readings do not see of the first constants where a search began; and what they do see.

    Left to itself it would follow the noise to the ends of its bounds.
    """
    singular, right = seen(misfit, at, count)
    known = int(np.sum(singular > 2 / DETERMINED))
    rows = np.zeros((count - known, len(at)))
    rows[:, :count] = _FIRM * right[known:]
    return rows, known


def judge(misfit: Misfit, best: Array, constants: Sequence[Named], quantile: float,
          values_of: Callable[[int, float], float], profiles: bool = True) -> Judgement:
    """Limits at a minimum of a misfit in units of the noise; ``values_of(index, z)`` turns z into a constant's value.

    What the misfit depends on beyond these constants is left to fit. Without ``profiles`` the
    limits are linearised.
    """
    count = len(constants)
    singular, right = seen(misfit, best, count)
    with np.errstate(divide="ignore"):
        halves = quantile / singular
    deviations = 1 / np.maximum(singular, 1e-14 * singular[0])
    covariance, wide = ((right.T * width**2) @ right for width in (np.minimum(deviations, CREDIBLE),
                                                                   deviations))
    spread = np.sqrt(np.diag(covariance))
    credible = misfit.with_rows(np.eye(len(best))[:count] / CREDIBLE, best)
    free = settled(credible, best) if profiles else best
    found, drawn = [], []
    for index, constant in enumerate(constants):
        z, half = float(best[index]), quantile * float(spread[index])
        open_ = misfit.low[index] < z < misfit.high[index]
        linear = (max(z - half, misfit.low[index]), min(z + half, misfit.high[index]))
        line = profile(credible, free, index,
                       quantile) if profiles and open_ and half < _WORTH else None
        limits = linear if not profiles else (None, None) if line is None else (line.low, line.high)
        drawn.append(line)
        sure = _limited(limits,
                        2 * half / _DOUBTFUL) if profiles or (open_ and half < DETERMINED) else None
        rough = linear if open_ and half < DETERMINED else None
        ends = [None if pair is None else values_of(index, pair[side]) for pair in (sure, rough)
                for side in (0, 1)]
        found.append(Found(constant.name, constant.unit, values_of(index, z), *ends))
    combinations = tuple(
        Combination(tuple(direction.tolist()), float(direction @ best[:count]),
                    float(half) if half < DETERMINED else None, float(half / quantile))
        for direction, half in zip(right, halves, strict=True))
    lengths = np.sqrt(np.diag(wide))
    return Judgement(tuple(found), combinations, wide / np.outer(lengths, lengths), tuple(drawn),
                     quantile,
                     values_of)


def _limited(pair: tuple[float | None, float | None], least: float) -> tuple[float, float] | None:
    """The limits, where there are two, close enough to say something and not so close that they cannot be."""
    low, high = pair
    return None if low is None or high is None or not least <= high - low <= 2 * DETERMINED else (low, high)
