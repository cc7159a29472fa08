"""The profile of one unknown: how the least misfit grows as it is held away from its best value."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tympan.base.arrays import Array
from tympan.studies.estimation.least_squares import LeastSquares, minimise

#: A value of the unknown, and the rise of the misfit there [standard deviations].
Place = tuple[float, float]

#: How exactly a profile meets a limit, as a share of the quantile.
_MET = 0.01
_MOST = 20
#: A fit that rises by so many quantiles may be in another valley: the next does not begin there.
_FAR = 2.0
#: For limits so exact, how much half of χ² may still fall where a profile's fit stops: 0.1 % of the
#: 3.84 that make a 95 % limit.
EXACT = 2e-3
#: What the other unknowns could still take from χ², by their derivatives, that is taken without
#: fitting them again; as many times that.
_LITTLE = 20.0


@dataclass(frozen=True, eq=False)
class Profile:
    """Growth of the least misfit as one unknown is held away from its best value.

    ``values`` ascend; ``rise`` is ±√(χ² − χ²min) there, in standard deviations: a straight line
    where the problem is linear. ``low`` and ``high`` are where it reaches the quantile, None where
    it does not within the bounds.
    """

    values: Array
    rise: Array
    low: float | None
    high: float | None
    evaluations: int


def profile(problem: LeastSquares, best: Array, index: int, quantile: float,
            met: float = _MET, most: float = np.inf) -> Profile:
    """The profile of one unknown about a minimum, out to where χ² has grown by quantile².

    At each value of it all others are fitted again, those the readings do not determine included
    (Bates and Watts, *Nonlinear Regression Analysis*, 1988, §6.1). Limits are exact to the share
    ``met`` of the quantile. After more than ``most`` evaluations it goes no further.
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
    """Motion of all unknowns with the one, to first order; those at a bound stay."""
    moving = (np.arange(len(best)) != index) & (problem.low < best) & (best < problem.high)
    along = np.zeros(len(best))
    along[moving] = -np.linalg.lstsq(jacobian[:, moving], jacobian[:, index], rcond=1e-12)[0]
    along[index] = 1.0
    return along


@dataclass
class _Search:
    """A search for both limits; ``places`` are those met, ``evaluations`` what they took."""

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
        """Limit where the quantile is met on the side of ``step``, the first guess of how far."""
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
        """All others fitted again at a value of the unknown, and the rise of the misfit there."""
        unknowns = np.clip(last + self.along * (at - last[self.index]),
                           self.problem.low, self.problem.high)
        unknowns[self.index] = at
        point = self.problem.at(unknowns)
        self.evaluations += 1
        if not np.isfinite(point.squares):  # the model does not reach so far
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
    """A straight line through the last places, outward at most three times as far.

    Where that moves but one end of the bracket, or the model does not reach, half way; by factors,
    if the bracket spans more than one of ten.
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
