"""A misfit with its exact derivative over constants within bounds, its minimum, and its profiles."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from tympan.geometry.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Misfit:
    """Residuals and their derivative as functions of constants z, each in the unit it is judged by, within bounds.

    Residuals are in units of a reading's standard deviation, so that their sum of squares is χ².
    """

    both: Callable[[Array], tuple[Array, Array]]
    low: Array
    high: Array

    def with_rows(self, rows: Array, centre: Array) -> Misfit:
        """The same with further residuals ``rows`` (z − ``centre``)."""
        def both(z: Array) -> tuple[Array, Array]:
            residual, slopes = self.both(z)
            return np.concatenate([residual, rows @ (z - centre)]), np.concatenate([slopes, rows])

        return replace(self, both=both)


def minimise(misfit: Misfit, start: Array, held: NDArray[np.bool_] | None = None,
             precision: float = 1e-9
             ) -> tuple[Array, int]:
    """The nearest minimum over the constants that are not held, and how many evaluations it took.

    scipy's trust-region reflective method (Branch, Coleman and Li, SIAM J. Sci. Comput. 21, 1999);
    ``precision`` is the relative one of χ².

    Raises
    ------
    InputError
        When the model cannot answer where the search begins.
    """
    free = np.ones(len(start), bool) if held is None else ~held
    low, high = misfit.low[free], misfit.high[free]
    margin = 1e-10 * np.minimum(high - low, 1.0)
    last: dict[str, Any] = {"at": None}

    def both(part: Array) -> tuple[Array, Array]:
        if last["at"] is None or not np.array_equal(last["at"], part):
            z = start.copy()
            z[free] = part
            residual, slopes = misfit.both(z)
            last.update(at=part.copy(), found=(residual, slopes[:, free]))
        found: tuple[Array, Array] = last["found"]
        return found

    inside = np.clip(start[free], low + margin, high - margin)
    if not np.isfinite(both(inside)[0]).all():
        raise InputError("the film does not hold with the constants the search begins at",
                         key="constants")
    done = least_squares(lambda part: both(part)[0], inside, lambda part: both(part)[1],
                         (low, high), "trf",
                         precision, 1e-8, 1e-12, max_nfev=100)
    result = start.copy()
    result[free] = done.x
    return result, int(done.nfev)


@dataclass(frozen=True, eq=False)
class Profile:
    """How the least misfit grows as one constant is held away from its best value.

    ``values`` ascend; ``rise`` is ±√(χ² − χ²min) there, in standard deviations: a straight line
    where the problem is linear. ``low`` and ``high`` are where it reaches the quantile, None where
    it does not within the bounds.
    """

    values: Array
    rise: Array
    low: float | None
    high: float | None
    evaluations: int


#: How exactly a limit is met, as a share of the quantile.
_MET = 0.01
_MOST = 12


#: How much χ² may still fall where a profile's fit stops: 0.1 % of the 3.84 that make a 95 % limit.
_EXACT = 4e-3
#: What the other constants could still take from χ², by their derivatives, that is taken without
#: fitting them again.
_LITTLE = 0.04


def settled(misfit: Misfit, best: Array) -> Array:
    """The minimum with everything free, from one where some directions were held; profiles begin there.

    What readings do not determine follows the noise there, and χ² is smaller by about one for each
    such direction.
    """
    residual, _ = misfit.both(best)
    return minimise(misfit, best, None, _EXACT / max(float(residual @ residual), 1.0))[0]


def profile(misfit: Misfit, best: Array, index: int, quantile: float) -> Profile:
    """The profile of one constant about a minimum, out to where χ² has grown by quantile² on both sides.

    At each value of it all others are fitted again, those the readings do not determine included
    (Bates and Watts, *Nonlinear Regression Analysis*, 1988, §6.1).
    """
    residual, slopes = misfit.both(best)
    least = float(residual @ residual)
    others = np.arange(len(best)) != index
    # How the others move with it, to first order: the start of every fit.
    along = np.zeros(len(best))
    along[others] = -np.linalg.lstsq(slopes[:, others], slopes[:, index], rcond=1e-12)[0]
    along[index] = 1.0
    sharp = float(np.linalg.norm(slopes @ along))
    walk = _Walk(misfit, best, index, along, least, quantile)
    first = quantile / sharp if sharp > 0 else np.inf
    low, high = walk.side(-first), walk.side(first)
    order = np.argsort([one[0] for one in walk.seen])
    values, rise = np.array(walk.seen)[order].T
    return Profile(values, rise, low, high, walk.evaluations)


@dataclass(eq=False)
class _Walk:
    """The way out from the minimum, one side after the other."""

    misfit: Misfit
    best: Array
    index: int
    along: Array
    least: float
    quantile: float
    evaluations: int = 0

    def __post_init__(self) -> None:
        self.seen = [(float(self.best[self.index]), 0.0)]

    def side(self, step: float) -> float | None:
        """Where the quantile is met on the side of ``step``, which is the first guess of how far."""
        sign, start = np.sign(step), float(self.best[self.index])
        end = float((self.misfit.low if sign < 0 else self.misfit.high)[self.index])
        inside, outside = (start, 0.0), None
        last, at = self.best, start + step
        for _ in range(_MOST):
            at = sign * min(sign * at, sign * end)
            last, rise = self._rise(last, at)
            if np.isfinite(rise):
                self.seen.append((at, float(sign * rise)))
            if abs(rise - self.quantile) < _MET * self.quantile:
                return at
            if rise > self.quantile:
                outside = (at, rise)
            elif at == end:
                return None
            else:
                inside = (at, rise)
            at = self._next(inside, outside, (start, 0.0), step)
        return None if outside is None or not np.isfinite(outside[1]) else outside[0]

    def _next(self, inside: tuple[float, float], outside: tuple[float, float] | None,
              start: tuple[float, float],
              step: float) -> float:
        """A straight line through what is known, outward at most three times as far."""
        if outside is not None:
            share = (self.quantile - inside[1]) / (outside[1]
                                                   - inside[1])  # 0 where the model does not reach
            return inside[0] + min(max(share, 0.1), 0.95) * (outside[0] - inside[0])
        far = inside[0] - start[0]
        grown = min(self.quantile / inside[1], 3.0) if inside[1] > 0 else 3.0
        return start[0] + far * max(grown, 1.02)

    def _rise(self, last: Array, at: float) -> tuple[Array, float]:
        z = np.clip(last + self.along * (at - last[self.index]), self.misfit.low, self.misfit.high)
        z[self.index] = at
        residual, slopes = self.misfit.both(z)
        self.evaluations += 1
        if not np.isfinite(residual).all():  # the model does not reach so far
            return last, np.inf
        held = np.arange(len(z)) == self.index
        gain = float(np.linalg.norm(np.linalg.qr(slopes[:, ~held])[0].T @ residual)) ** 2
        if gain > _LITTLE:
            z, calls = minimise(self.misfit, z, held, _EXACT / max(self.least, 1.0))
            self.evaluations += calls
            residual, gain = self.misfit.both(z)[0], 0.0
        return z, max(float(residual @ residual) - gain - self.least, 0.0) ** 0.5
