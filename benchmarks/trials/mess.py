"""What benches do to readings that are right: each kind of mess, made without tympan's own noise.

A kind answers errors of readings [m] in their order, and which of them are off by themselves. For
most tails, spectra and correlations the diagnosis has no class. Beside each stands what its errors
allow to be known: the covariance of normal errors that tell as much of what is shared by readings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from tympan.base.arrays import Array

#: Errors of so many readings of a standard deviation [m], and the numbers of those at fault.
Drawn = tuple[Array, list[int]]

#: Sizes of slips of the pen [m].
SLIPS = (0.2e-3, 1.0e-3)
#: Most slips, as a share of the readings.
_MANY = 0.06
#: Degrees of freedom of heavy tails: the fewest with a variance.
_FREEDOM = 3
#: Correlations of neighbours, the least and the largest.
_REMEMBERED = (0.5, 0.9)
#: Errors of which a display shows the mean.
_SHOWN = 5


@dataclass(frozen=True)
class Mess:
    """A kind of errors.

    ``draw``: errors of so many readings of a standard deviation [m], and the numbers of those that
    are off by themselves; ``covariance``: of so many readings that are not, over the square of that
    deviation, (n, n).
    """

    draw: Callable[[Generator, int, float], Drawn]
    covariance: Callable[[int], Array] = np.eye


def slips(generator: Generator, count: int, sigma: float) -> Drawn:
    """One reading in a hundred to six are wrongly written, by 0.2 to 1 mm."""
    number = 1 + int(generator.integers(max(1, int(_MANY * count))))
    rows = generator.choice(count, number, replace=False)
    errors = generator.normal(0, sigma, count)
    sizes = np.exp(generator.uniform(*np.log(SLIPS), number))
    errors[rows] += sizes * generator.choice([-1.0, 1.0], number)
    return errors, sorted(rows.tolist())


def heavy_tails(generator: Generator, count: int, sigma: float) -> Drawn:
    """Student's t with three degrees of freedom: one in a hundred is 4.5 times the usual."""
    return sigma * generator.standard_t(_FREEDOM, count), []


def of_heavy_tails(count: int) -> Array:
    """By Fisher's information about where a reading is: (ν + 1) / (ν + 3)."""
    return (_FREEDOM + 3) / (_FREEDOM + 1) * np.eye(count)


def autoregressive(generator: Generator, count: int, sigma: float) -> Drawn:
    """Errors of which 50 to 90 % stay from reading to reading."""
    share = generator.uniform(*_REMEMBERED)
    fresh = generator.normal(0, sigma * (1 - share**2) ** 0.5, count + 200)
    return lfilter([1.0], [1.0, -share], fresh)[200:], []


def of_autoregression(count: int) -> Array:
    """Of sets of all shares together."""
    (least, largest), power = _REMEMBERED, np.arange(1, count + 1)
    return toeplitz((largest**power - least**power) / (power * (largest - least)))


def pink(generator: Generator, count: int, sigma: float) -> Drawn:
    """Half of the noise's variance with a spectrum of 1/f, half of it white."""
    frequency = np.maximum(np.arange(2 * count + 1), 1)
    phases = generator.normal(size=len(frequency)) + 1j * generator.normal(size=len(frequency))
    slow = np.fft.irfft(phases / frequency**0.5, 4 * count)[:count]
    slow = (slow - slow.mean()) / slow.std()
    return sigma * (slow + generator.normal(size=count)) / 2**0.5, []


def of_pink(count: int) -> Array:
    """By the spectrum; what readings have in common is taken away, as it is there."""
    power = 1.0 / np.maximum(np.arange(2 * count + 1), 1)
    slow = toeplitz(np.fft.irfft(power, 4 * count)[:count])
    centred = slow - slow.mean(axis=0)
    centred -= centred.mean(axis=1, keepdims=True)
    return 0.5 * (centred / np.diag(centred).mean() + np.eye(count))


def moving_average(generator: Generator, count: int, sigma: float) -> Drawn:
    """A display that shows the mean of the last five errors, as large as stated."""
    fresh = generator.normal(0, sigma * _SHOWN**0.5, count + _SHOWN - 1)
    return np.convolve(fresh, np.full(_SHOWN, 1 / _SHOWN), "valid"), []


def of_moving_average(count: int) -> Array:
    """By how many errors two readings share."""
    return toeplitz(np.maximum(1 - np.arange(count) / _SHOWN, 0.0))


#: Every kind, by name.
MESSES: dict[str, Mess] = {
    "slips": Mess(slips),
    "heavy tails": Mess(heavy_tails, of_heavy_tails),
    "autoregressive": Mess(autoregressive, of_autoregression),
    "pink": Mess(pink, of_pink),
    "moving average": Mess(moving_average, of_moving_average),
}
