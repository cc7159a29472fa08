"""Profile of one unknown: least misfit while it is held away from its best value."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.estimation.least_squares import LeastSquares, minimise

#: A value of the unknown, with the rise of the misfit there [standard deviations].
Place = tuple[float, float]

#: Accuracy of a limit, as a share of the quantile.
_MET = 0.01
_MOST = 20
#: Rise of a fit, in quantiles, from which on it may be in another valley and starts no other fit.
_FAR = 2.0
#: Largest further fall of half of χ² at which a profile's fit stops: 0.1 % of the 3.84 that make a
#: 95 % limit.
EXACT = 2e-3
#: Fall of χ², in multiples of that, which is calculated from derivatives of the other unknowns
#: without fitting them again.
_LITTLE = 20.0


@dataclass(frozen=True, eq=False)
class Profile:
    """Growth of the least misfit as one unknown is held away from its best value.

    ``values`` ascend; ``rise`` is ±√(χ² − χ²min) there, in standard deviations: a straight line if
    the problem is linear. ``low`` and ``high`` are where it reaches the quantile, None where it
    does not within the bounds.
    """

    values: Array
    rise: Array
    low: float | None
    high: float | None
    evaluations: int


def profile(problem: LeastSquares, best: Array, index: int, quantile: float,
            met: float = _MET, most: float = np.inf) -> Profile:
    """Compute the profile of one unknown about a minimum, out to where χ² has grown by quantile².

    At each value of it all others are fitted again, also those that the readings do not determine
    (Bates and Watts, *Nonlinear Regression Analysis*, 1988, §6.1). Limits are accurate to the share
    ``met`` of the quantile. After more than ``most`` evaluations the search stops.
    """
    point = problem.at(best)
    along = _followed(problem, best, index, point.jacobian)
    search = _Search(problem, best, index, along, point.squares, quantile, met, most)
    sharp = float(np.linalg.norm(point.jacobian @ along))
    first = quantile / sharp if sharp > 0 else np.inf
    low, high = search.limit(-first), search.limit(first)
    values, rise = np.array(sorted(search.places, key=lambda place: place[0])).T
    return Profile(values, rise, low, high, search.evaluations)


def _followed(problem: LeastSquares, best: Array, index: int, jacobian: Array) -> Array:
    """Compute the motion of all unknowns with the one, to first order; those at a bound stay."""
    moving = (np.arange(len(best)) != index) & (problem.low < best) & (best < problem.high)
    along = np.zeros(len(best))
    along[moving] = -np.linalg.lstsq(jacobian[:, moving], jacobian[:, index], rcond=1e-12)[0]
    along[index] = 1.0
    return along


@dataclass
class _Search:
    """A search for both limits; ``places`` are the points found, ``evaluations`` their cost."""

    problem: LeastSquares
    best: Array
    index: int
    along: Array
    least: float
    quantile: float
    met: float
    most: float
    evaluations: int = 0
    places: list[Place] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.places.append((float(self.best[self.index]), 0.0))

    def limit(self, step: float) -> float | None:
        """Find the limit on the side of ``step``, which is the first guess of its distance."""
        sign = np.sign(step)
        end = float((self.problem.low if sign < 0 else self.problem.high)[self.index])
        centre = inside = self.places[0]
        outside: Place | None = None
        last, at, same_side = self.best, centre[0] + step, 0
        for _ in range(_MOST):
            if self.evaluations > self.most:
                return None
            at = float(sign * min(sign * at, sign * end))
            unknowns, rise = self._refitted(last, at)
            if rise < _FAR * self.quantile:
                last = unknowns
            if np.isfinite(rise):
                self.places.append((at, float(sign * rise)))
            if abs(rise - self.quantile) < self.met * self.quantile:
                return at
            if rise > self.quantile:
                outside, same_side = (at, rise), min(same_side, 0) - 1
            elif at == end:
                return None
            else:
                inside, same_side = (at, rise), max(same_side, 0) + 1
            at = _next(self.quantile, centre[0], inside, outside, halve=abs(same_side) > 1)
        return None if outside is None or not np.isfinite(outside[1]) else outside[0]

    def _refitted(self, last: Array, at: float) -> tuple[Array, float]:
        """Fit all others again at a value of the unknown; compute the rise of the misfit there."""
        unknowns = np.clip(last + self.along * (at - last[self.index]),
                           self.problem.low, self.problem.high)
        unknowns[self.index] = at
        point = self.problem.at(unknowns)
        self.evaluations += 1
        if not np.isfinite(point.squares):  # the model has no value there
            return last, np.inf
        others, exact = np.arange(len(self.best)) != self.index, EXACT * self.met / _MET
        basis = np.linalg.qr(point.jacobian[:, others])[0]
        gain = float(np.linalg.norm(basis.T @ point.residual)) ** 2
        if gain > _LITTLE * exact:
            minimum = minimise(self.problem, unknowns, ~others, precision=0.0, exact=exact)
            self.evaluations += minimum.evaluations
            unknowns, point, gain = minimum.unknowns, minimum.point, 0.0
        return unknowns, max(point.squares - gain - self.least, 0.0) ** 0.5


def _next(quantile: float, centre: float, inside: Place, outside: Place | None,
          halve: bool) -> float:
    """Extrapolate a straight line through the last places, at most to three times the distance.

    If that moves only one end of the bracket, or the model has no value there, go half way; in
    logarithms if the ends differ by a factor of more than ten.
    """
    at, rise = inside
    if outside is None:
        grown = min(quantile / rise, 3.0) if rise > 0 else 3.0
        return centre + (at - centre) * max(grown, 1.02)
    if halve or not np.isfinite(outside[1]):
        ends = np.sort([at, outside[0]])
        wide = ends[0] > 0 and ends[1] > 10 * ends[0]
        return float(np.sqrt(ends[0] * ends[1]) if wide else ends.mean())
    share = (quantile - rise) / (outside[1] - rise)
    return at + min(max(share, 0.1), 0.95) * (outside[0] - at)
