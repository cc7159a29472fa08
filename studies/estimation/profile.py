"""How the least misfit grows as one unknown is held off its best value; its 95 % limits."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tympan.studies.estimation.least_squares import LeastSquares, minimise

Array = NDArray[np.float64]

#: How exactly a limit is met, as a share of the quantile.
_MET = 0.01
_MOST = 20
#: A fit that rises by so many quantiles may be in another valley: the next does not begin there.
_FAR = 2.0
#: For limits so exact, how much half of χ² may still fall where a profile's fit stops: 0.1 % of the
#: 3.84 that make a 95 % limit.
_EXACT = 2e-3
#: What the other unknowns could still take from χ², by their derivatives, that is taken without
#: fitting them again; as many times that.
_LITTLE = 20.0


@dataclass(frozen=True, eq=False)
class Profile:
    """How the least misfit grows as one unknown is held away from its best value.

    ``values`` ascend; ``rise`` is ±√(χ² − χ²min) there, in standard deviations: a straight line
    where the problem is linear. ``low`` and ``high`` are where it reaches the quantile, None where
    it does not within the bounds.
    """

    values: Array
    rise: Array
    low: float | None
    high: float | None
    evaluations: int


def settled_minimum(problem: LeastSquares, best: Array) -> Array:
    """The minimum with everything free, from one where some directions were held.

    What readings do not determine follows the noise there, and χ² is smaller by about one for each
    such direction.
    """
    return minimise(problem, best, precision=0.0, exact=_EXACT).unknowns


def profile(problem: LeastSquares, best: Array, index: int, quantile: float,
            met: float = _MET) -> Profile:
    """The profile of one unknown about a minimum, out to where χ² has grown by quantile².

    At each value of it all others are fitted again, those the readings do not determine included
    (Bates and Watts, *Nonlinear Regression Analysis*, 1988, §6.1). ``met`` is how exactly the
    limits are, as a share of the quantile.
    """
    point = problem.at(best)
    others = np.arange(len(best)) != index
    # How the others move with it, to first order: the start of every fit.
    along = np.zeros(len(best))
    along[others] = -np.linalg.lstsq(point.jacobian[:, others], point.jacobian[:, index],
                                     rcond=1e-12)[0]
    along[index] = 1.0
    sharp = float(np.linalg.norm(point.jacobian @ along))
    walk = _Walk(problem, best, index, along, point.squares, quantile, met)
    first = quantile / sharp if sharp > 0 else np.inf
    low, high = walk.side(-first), walk.side(first)
    values, rise = np.array(sorted(walk.seen, key=lambda place: place.at)).T
    return Profile(values, rise, low, high, walk.evaluations)


class _Place(NamedTuple):
    """A value of the unknown, and the rise of the misfit there [standard deviations]."""

    at: float
    rise: float


@dataclass(eq=False)
class _Walk:
    """The way out from the minimum, one side after the other."""

    problem: LeastSquares
    best: Array
    index: int
    along: Array
    least: float
    quantile: float
    met: float
    evaluations: int = 0
    seen: list[_Place] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.exact = _EXACT * self.met / _MET
        self.centre = _Place(float(self.best[self.index]), 0.0)
        self.seen.append(self.centre)

    def side(self, step: float) -> float | None:
        """Where the quantile is met on the side of ``step``, the first guess of how far."""
        sign = np.sign(step)
        end = float((self.problem.low if sign < 0 else self.problem.high)[self.index])
        inside, outside = self.centre, None
        last, at = self.best, self.centre.at + step
        same_side = 0
        for _ in range(_MOST):
            at = float(sign * min(sign * at, sign * end))
            refitted, rise = self._rise(last, at)
            if rise < _FAR * self.quantile:
                last = refitted
            if np.isfinite(rise):
                self.seen.append(_Place(at, float(sign * rise)))
            if abs(rise - self.quantile) < self.met * self.quantile:
                return at
            if rise > self.quantile:
                outside, same_side = _Place(at, rise), min(same_side, 0) - 1
            elif at == end:
                return None
            else:
                inside, same_side = _Place(at, rise), max(same_side, 0) + 1
            at = self._next(inside, outside, halve=abs(same_side) > 1)
        return None if outside is None or not np.isfinite(outside.rise) else outside.at

    def _next(self, inside: _Place, outside: _Place | None, halve: bool) -> float:
        """A straight line through the last places, outward at most three times as far.

        Where that moves but one end of the bracket, or the model does not reach, half way; by
        factors, if the bracket spans more than one of ten.
        """
        if outside is not None and (halve or not np.isfinite(outside.rise)):
            ends = np.sort([inside.at, outside.at])
            wide = ends[0] > 0 and ends[1] > 10 * ends[0]
            return float(np.sqrt(ends[0] * ends[1]) if wide else ends.mean())
        if outside is not None:
            share = (self.quantile - inside.rise) / (outside.rise - inside.rise)
            return inside.at + min(max(share, 0.1), 0.95) * (outside.at - inside.at)
        grown = min(self.quantile / inside.rise, 3.0) if inside.rise > 0 else 3.0
        return self.centre.at + (inside.at - self.centre.at) * max(grown, 1.02)

    def _rise(self, last: Array, at: float) -> tuple[Array, float]:
        """The unknowns refitted with this one at a value, and the rise of the misfit."""
        start = last + self.along * (at - last[self.index])
        unknowns = np.clip(start, self.problem.low, self.problem.high)
        unknowns[self.index] = at
        point = self.problem.at(unknowns)
        self.evaluations += 1
        if not np.isfinite(point.squares):  # the model does not reach so far
            return last, np.inf
        held = np.arange(len(unknowns)) == self.index
        gain = float(np.linalg.norm(np.linalg.qr(point.jacobian[:, ~held])[0].T
                                    @ point.residual)) ** 2
        if gain > _LITTLE * self.exact:
            minimum = minimise(self.problem, unknowns, held, precision=0.0,
                               exact=self.exact)
            self.evaluations += minimum.evaluations
            unknowns, point, gain = minimum.unknowns, minimum.point, 0.0
        return unknowns, max(point.squares - gain - self.least, 0.0) ** 0.5
