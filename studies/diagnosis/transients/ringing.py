"""Swings of a plate after a jump of the voltage: frequency and rate at which they fade."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from tympan.base.arrays import Array

#: Samples that a period must have, to be told from noise.
_SAMPLES = 5
#: Most periods that are looked at: by then a swing has faded or its frequency is known.
_LONG = 40
#: Periods that are needed. Fewer are a bend of a slow curve.
_SHORT = 4
#: Share of the scatter that a swing must be.
_CLEAR = 0.6
#: How well its frequency must be told, as a share.
_TOLD = 0.03
#: Most trials of a fit. A bound of the cost.
_EVALUATIONS = 60

#: The probability that noise alone makes a swing of a record's samples.
_CHANCE = 1e-4

#: How far swings of an amplitude over the whole deflection change the frequency, over the square of
#: that.
_BENDS = 0.5
#: How exactly frequencies are known at best, as a share: that of clocks and of the model.
_BEST = 1e-3
#: How exactly rates are known at best, over the frequency.
_RATE = 1e-3


@dataclass(frozen=True)
class Ringing:
    """Frequency [Hz] and rate at which the swing's amplitude fades [1/s], with deviations."""

    frequency: float
    frequency_sigma: float
    decay: float
    decay_sigma: float


def ringing(time: Array, value: Array) -> Ringing | None:
    """The swing of samples after a jump, None where none is to be seen.

    A film bends the swing: its frequency is that of small swings only when these have faded, so
    what a large swing may be off is counted as noise.
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
    """The frequency of the largest peak of the spectrum, of the part in which it is most [Hz]."""
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
    """Rate and angular frequency, their deviations, and the amplitude [m]."""
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
    # Of n frequencies noise makes the largest gain in χ² more than 2 ln(n/p) with probability p.
    if float(still @ still - rest @ rest) < 2 * np.log(len(time) / _CHANCE) * variance:
        return None
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * variance / scale**2
    deviations = np.sqrt(np.diag(covariance))
    return ((rate, omega), (float(deviations[0]) * frequency,
                            float(deviations[1]) * 2 * np.pi * frequency),
            float(np.hypot(*parts[3:])))


def _inflation(rest: Array) -> float:
    """Factor by which correlation widens a variance: 1 + 2 Σ of the residuals' autocorrelation."""
    size = float(rest @ rest)
    total, lag = 1.0, 1
    while lag < len(rest) // 4 and size > 0:
        share = float(rest[:-lag] @ rest[lag:]) / size
        if share < 0.05:
            break
        total += 2 * share
        lag += 1
    return total
