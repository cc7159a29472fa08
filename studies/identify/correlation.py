"""Number of readings in time that count as one: neighbours with like residuals add less."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tympan.base.arrays import Array

#: Significance of an inflation, in standard deviations: a smaller difference from 1 is chance.
_CHANCE = 3.0


def variance_inflation(parts: Sequence[tuple[Array, Array]], count: int, sigma: float) -> float:
    """Find the factor by which correlated residuals widen a constant's variance; else 1.

    ``parts`` holds the residuals of every run, shape (n,), evenly sampled, and their derivatives,
    (n, p), of which the first ``count`` are by the constants. Independent residuals have the
    standard deviation ``sigma``. The variance of a combination of constants is that of its pattern
    in the readings times the residuals: the sum of the residuals' smoothed spectrum times the
    pattern's spectrum. The worst combination counts, because a wrong model has its errors where its
    constants have effect (the sandwich of H. White, Econometrica 50, 1, 1982, with a spectral
    middle).
    """
    slopes = np.concatenate([slopes for _, slopes in parts])
    others = np.linalg.qr(slopes[:, count:])[0]
    constants = slopes[:, :count] - others @ (others.T @ slopes[:, :count])
    length = np.linalg.norm(constants, axis=0)
    patterns, singular, _ = np.linalg.svd(constants / np.where(length > 0, length, 1.0),
                                          full_matrices=False)
    patterns = patterns[:, singular > 1e-6]
    variance, bins, begin = np.zeros(patterns.shape[1]), np.inf, 0
    for residual, _ in parts:
        size = len(residual)
        half = int(np.sqrt(size) / 2)
        power = np.abs(np.fft.fft(residual)) ** 2 / size
        smooth = _circular_mean(power, half)
        inside = np.abs(np.fft.fft(patterns[begin:begin + size], axis=0)) ** 2 / size
        variance += smooth @ inside
        bins, begin = min(bins, 2 * half + 1), begin + size
    inflation = float(variance.max(initial=0.0) / sigma**2)
    return inflation if inflation > 1 + _CHANCE / np.sqrt(bins) else 1.0


def _circular_mean(values: Array, half: int) -> Array:
    """Average each value and ``half`` values on either side, the ends joined."""
    summed = np.cumsum(np.concatenate([[0.0], values[len(values) - half:], values, values[:half]]))
    width = 2 * half + 1
    return np.asarray((summed[width:] - summed[:-width]) / width)
