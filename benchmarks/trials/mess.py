"""What benches do to readings that are right: each kind of mess, made without tympan's own noise.

A kind answers errors of readings [m] in their order, and which of them are off by themselves. For
most tails, spectra and correlations the diagnosis has no class.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
#: Errors of so many readings of a standard deviation [m], and the numbers of those at fault.
Mess = Callable[[Generator, int, float], tuple[Array, list[int]]]

#: Sizes of slips of the pen [m].
SLIPS = (0.2e-3, 1.0e-3)
#: Most slips, as a share of the readings.
_MANY = 0.06


def slips(generator: Generator, count: int, sigma: float) -> tuple[Array, list[int]]:
    """One reading in a hundred to six are wrongly written, by 0.2 to 1 mm."""
    number = 1 + int(generator.integers(max(1, int(_MANY * count))))
    rows = generator.choice(count, number, replace=False)
    errors = generator.normal(0, sigma, count)
    sizes = np.exp(generator.uniform(*np.log(SLIPS), number))
    errors[rows] += sizes * generator.choice([-1.0, 1.0], number)
    return errors, sorted(rows.tolist())


def heavy_tails(generator: Generator, count: int, sigma: float) -> tuple[Array, list[int]]:
    """Student's t with three degrees of freedom: one in a hundred is 4.5 times the usual."""
    return sigma * generator.standard_t(3, count), []


def autoregressive(generator: Generator, count: int, sigma: float) -> tuple[Array, list[int]]:
    """Errors of which 50 to 90 % stay from reading to reading."""
    share = generator.uniform(0.5, 0.9)
    fresh = generator.normal(0, sigma * (1 - share**2) ** 0.5, count + 200)
    return lfilter([1.0], [1.0, -share], fresh)[200:], []


def pink(generator: Generator, count: int, sigma: float) -> tuple[Array, list[int]]:
    """Half of the noise's variance with a spectrum of 1/f, half of it white."""
    frequency = np.maximum(np.arange(2 * count + 1), 1)
    phases = generator.normal(size=len(frequency)) + 1j * generator.normal(size=len(frequency))
    slow = np.fft.irfft(phases / frequency**0.5, 4 * count)[:count]
    slow = (slow - slow.mean()) / slow.std()
    return sigma * (slow + generator.normal(size=count)) / 2**0.5, []


def moving_average(generator: Generator, count: int, sigma: float) -> tuple[Array, list[int]]:
    """A display that shows the mean of the last five errors, as large as stated."""
    fresh = generator.normal(0, sigma * 5**0.5, count + 4)
    return np.convolve(fresh, np.full(5, 0.2), "valid"), []


#: Every kind, by name.
MESSES: dict[str, Mess] = {
    "slips": slips,
    "heavy tails": heavy_tails,
    "autoregressive": autoregressive,
    "pink": pink,
    "moving average": moving_average,
}
