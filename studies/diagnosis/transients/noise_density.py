"""Spectral density of samples' noise: a white part and a part of first order.

The spectrum is S_w + S_c/|1 − φ e^(−iω)|² (1 − φ)². It is fitted by Whittle's likelihood to the
periodogram of the residuals about slow curves, without the frequencies at which the plate
oscillates. The mean over a time T that is long against the correlation time has the variance
(S_w + S_c)/T.
"""

from __future__ import annotations

from math import nan

import numpy as np
from scipy.optimize import minimize

from tympan.base.arrays import Array

#: Fewest samples for a spectrum.
_FEWEST = 64
#: Number of lowest frequencies that are left out: slow curves disturb them.
_SPOILT = 4
#: Half width of the excluded range about an oscillation's frequency and its multiples, as a share
#: of the frequency.
_ABOUT = 0.25
#: Number of multiples that are left out: higher ones are below the noise.
_MULTIPLES = 4

#: Correlation times at which fits start, in samples.
_STARTS = (2.0, 8.0, 40.0)

#: Log-likelihood that a coloured part must gain to be accepted.
_CLEAR = 4.0


def noise_density(time: Array, value: Array, frequency: float = 0.0) -> tuple[float, float]:
    """Fit the spectral density at frequency 0 [m² s] and the correlation time [s], 0 if white.

    The samples are evenly spaced, after a jump; nan if there are too few. ``frequency``: that of an
    oscillation [Hz].
    """
    if len(time) < _FEWEST:
        return nan, 0.0
    step, since = float(np.median(np.diff(time))), time - time[0]
    # A window keeps an oscillation's power near its frequency.
    window = np.hanning(len(time))
    logs = np.log1p(since / step)
    columns = np.stack([np.ones(len(time)), since / since[-1], *(logs**k for k in (1, 2, 3, 4))], 1)
    rest = value - columns @ np.linalg.lstsq(columns, value, rcond=None)[0]
    power = np.abs(np.fft.rfft(rest * window)) ** 2 * step / float(window @ window)
    at = np.fft.rfftfreq(len(time), step)
    used = np.arange(len(at)) >= _SPOILT
    for multiple in range(1, _MULTIPLES + 1) if frequency else ():
        used &= np.abs(at - multiple * frequency) > _ABOUT * frequency
    power, turn = power[used], 2 * np.pi * at[used] * step
    white = float(power.mean())

    def spectrum(x: Array) -> Array:
        kept = np.exp(-1 / np.exp(np.clip(x[2], -3, np.log(len(time)))))
        shape = (1 - kept) ** 2 / (1 - 2 * kept * np.cos(turn) + kept**2)
        return np.asarray(np.exp(np.clip(x[0], -100, 5)) + np.exp(np.clip(x[1], -100, 5)) * shape)

    def cost(x: Array) -> float:
        model = spectrum(x)
        return float(np.sum(np.log(model) + power / white / model))

    fits = [minimize(cost, [np.log(0.3), 0.0, np.log(length)], method="Nelder-Mead",
                     options={"xatol": 1e-2, "fatol": 1e-2, "maxiter": 400})
            for length in _STARTS]
    best = min(fits, key=lambda fit: float(fit.fun))
    if len(power) - best.fun < _CLEAR:
        return white, 0.0
    parts = np.exp(best.x[:2])
    share = parts[1] / parts.sum()
    return (white * float(parts.sum()),
            step * float(np.exp(min(best.x[2], np.log(len(time)))) * share))
