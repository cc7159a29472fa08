"""The noise of readings, stated or by the residuals of a fit."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.stats import norm, t

#: A misfit above so many times the stated noise is the law's, not the noise's.
MISFIT = 2.0


@dataclass(frozen=True)
class Noise:
    """Standard deviation of a reading in its unit, and the quantile for 95 % intervals.

    Given, the quantile is the normal one; estimated from the residuals, Student's with their
    degrees of freedom.
    """

    sigma: float
    quantile: float

    @classmethod
    def of(cls, squares: float, freedom: int, given: float | None) -> Noise:
        """Estimated from the sum of squares unless given."""
        if given is not None:
            return cls(given, float(norm.ppf(0.975)))
        return cls((squares / freedom) ** 0.5, float(t.ppf(0.975, freedom)))


def noise_of(squares: float, freedom: int, given: float | None) -> Noise:
    """The noise stated, or that of the residuals where none is or it cannot explain them."""
    estimated = Noise.of(squares, freedom, None)
    if given is None:
        return estimated
    stated = Noise.of(squares, freedom, given)
    # A misfit that noise cannot explain widens the limits, which it would make too narrow.
    return stated if estimated.sigma < MISFIT * given else Noise(estimated.sigma, stated.quantile)
