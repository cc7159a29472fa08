"""Oscillations of a plate after a jump of the voltage: frequency and decay rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from tympan.base.arrays import Array

#: Fewest samples in a period that can be separated from noise.
_SAMPLES = 5
#: Most periods that are used: then the oscillation has decayed or its frequency is known.
_LONG = 40
#: Fewest periods. Fewer are the bend of a slow curve.
_SHORT = 4
#: Least share of the scatter that an oscillation must explain.
_CLEAR = 0.6
#: Largest relative uncertainty of an oscillation's frequency.
_TOLD = 0.03
#: Most evaluations of a fit. It limits the cost.
_EVALUATIONS = 60

#: Probability that noise alone makes an oscillation in a record's samples.
_CHANCE = 1e-4

#: Change of the frequency by an oscillation's amplitude, over the square of the amplitude over the
#: whole deflection.
_BENDS = 0.5
#: Least relative uncertainty of a frequency: that of clocks and of the model.
_BEST = 1e-3
#: Least uncertainty of a decay rate, over the frequency.
_RATE = 1e-3


@dataclass(frozen=True)
class Ringing:
    """Frequency [Hz] and decay rate of an oscillation's amplitude [1/s], with deviations."""

    frequency: float
    frequency_sigma: float
    decay: float
    decay_sigma: float


def ringing(time: Array, value: Array) -> Ringing | None:
    """Find the oscillation of samples after a jump; None where there is none.

    A film's stiffness changes with its deflection, so the frequency is that of small oscillations
    only when these have decayed. The possible shift by a large amplitude is counted as noise.
    """
    step = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    frequency = _strongest(time, value, step)
    if frequency is None:
        return None
    count = min(len(time), int(_LONG / frequency / step))
    if count * step * frequency < _SHORT:
        return None
    fit = _fitted(time[:count] - time[0], value[:count], frequency)
    if fit is None:
        return None
    (rate, omega), (rate_sigma, omega_sigma), amplitude = fit
    size = max(abs(float(value[:count].mean())), 1e-9)
    natural = omega / (2 * np.pi)
    bent = _BENDS * (amplitude / size) ** 2
    if not 0.5 < natural / frequency < 2 or omega_sigma > _TOLD * omega or rate < -omega / 50:
        return None
    return Ringing(natural, float(np.hypot(omega_sigma / (2 * np.pi), (bent + _BEST) * natural)),
                   rate, float(np.hypot(rate_sigma, _RATE * omega + bent * abs(rate))))


def _strongest(time: Array, value: Array, step: float) -> float | None:
    """Find the frequency [Hz] of the largest spectral peak, in the part where it is largest."""
    for count in (len(time) // 64, len(time) // 16, len(time) // 4, len(time)):
        if count < 4 * _SAMPLES:
            continue
        here, when = value[:count], time[:count] - time[0]
        columns = np.stack([np.ones(count), when, np.log1p(when / (4 * step))], 1)
        rest = here - columns @ np.linalg.lstsq(columns, here, rcond=None)[0]
        spectrum = np.abs(np.fft.rfft(rest * np.hanning(count))) ** 2
        frequency = np.fft.rfftfreq(count, step)
        usable = (frequency * count * step >= _SHORT) & (frequency * step * _SAMPLES <= 1)
        if not usable.any():
            continue
        peak = int(np.argmax(np.where(usable, spectrum, 0.0)))
        near = slice(max(peak - 2, 0), peak + 3)
        if spectrum[near].sum() > _CLEAR * spectrum.sum():
            return float(frequency[near] @ spectrum[near] / spectrum[near].sum())
    return None


def _fitted(time: Array, value: Array, frequency: float
            ) -> tuple[tuple[float, float], tuple[float, float], float] | None:
    """Fit decay rate and angular frequency, with deviations, and the amplitude [m]."""
    late = np.log1p(time * frequency)

    def columns(rate: float, omega: float) -> Array:
        fading = np.exp(-np.clip(rate * time, -50, 50))
        return np.stack([np.ones(len(time)), late, late**2, fading * np.cos(omega * time),
                         fading * np.sin(omega * time)], 1)

    def residual(x: Array) -> Array:
        basis = columns(x[0] * frequency, x[1] * 2 * np.pi * frequency)
        return np.asarray(value - basis @ np.linalg.lstsq(basis, value, rcond=None)[0])

    scale = max(float(np.abs(value - value.mean()).max()), 1e-12)
    fits = [least_squares(lambda x: residual(x) / scale, [rate, 1.0], method="lm",
                          max_nfev=_EVALUATIONS) for rate in (0.05, 0.5)]
    best = min(fits, key=lambda fit: fit.cost)
    if best.status <= 0:
        return None
    rate, omega = best.x[0] * frequency, best.x[1] * 2 * np.pi * frequency
    basis = columns(rate, omega)
    parts = np.linalg.lstsq(basis, value, rcond=None)[0]
    rest = residual(best.x)
    slow = basis[:, :3]
    still = value - slow @ np.linalg.lstsq(slow, value, rcond=None)[0]
    variance = float(np.mean(rest**2)) * _inflation(rest)
    # For n frequencies, noise gains more than 2 ln(n/p) in χ² with probability p.
    if float(still @ still - rest @ rest) < 2 * np.log(len(time) / _CHANCE) * variance:
        return None
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * variance / scale**2
    deviations = np.sqrt(np.diag(covariance))
    return ((rate, omega), (float(deviations[0]) * frequency,
                            float(deviations[1]) * 2 * np.pi * frequency),
            float(np.hypot(*parts[3:])))


def _inflation(rest: Array) -> float:
    """Compute the factor of a variance by correlation: 1 + 2 Σ of residuals' autocorrelation."""
    size = float(rest @ rest)
    total, lag = 1.0, 1
    while lag < len(rest) // 4 and size > 0:
        share = float(rest[:-lag] @ rest[lag:]) / size
        if share < 0.05:
            break
        total += 2 * share
        lag += 1
    return total
