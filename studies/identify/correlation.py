"""Number of readings in time that count as one: neighbours with like residuals tell less."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tympan.base.arrays import Array

_CHANCE = 3.0  # deviations: an inflation within so many of 1 is none


def variance_inflation(parts: Sequence[tuple[Array, Array]], count: int, sigma: float) -> float:
    """Factor by which alike residuals widen a constant's variance; 1 where they are independent.

    ``parts`` are of every run the residuals, shape (n,), evenly sampled, and their derivatives,
    (n, p), of which the first ``count`` are by the constants; independent ones have the standard
    deviation ``sigma``. The variance of a combination of
    constants is that of its pattern in the readings times the residuals: the spectrum of the
    residuals, smoothed, over the pattern's. That of the worst combination counts, for a model that
    is wrong errs where its constants are heard (the sandwich of H. White, Econometrica 50, 1,
    1982, with a spectral middle).
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
    """Mean of each value and so many on either side, the ends joined."""
    summed = np.cumsum(np.concatenate([[0.0], values[len(values) - half:], values, values[:half]]))
    width = 2 * half + 1
    return np.asarray((summed[width:] - summed[:-width]) / width)
