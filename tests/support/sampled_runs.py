"""Samples of plates after a jump of the voltage, by formulas, with noise of several kinds."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from tympan.studies.data.sampled_run import SampledRun


def noise_of(kind: int, count: int, rate: float, random: np.random.Generator) -> np.ndarray:
    """White, of first order, with a slow part as strong, or with the tails of Student's t."""
    white = random.standard_normal(count)
    if kind == 1:
        kept = np.exp(-1 / rate / 0.05)
        return np.asarray(lfilter([(1 - kept**2) ** 0.5], [1, -kept], white))
    if kind == 2:
        slow = lfilter([0.2], [1, -0.98], random.standard_normal(count))
        return np.asarray((white + slow) / 2**0.5)
    return white if not kind else random.standard_t(3, count) / 3**0.5


def run(random: np.random.Generator, rate: float, fades: float | None = None,
        quiet: tuple[int, ...] = (20, 100, 200, 400)) -> SampledRun:
    """A plate that swings, bent, after a jump of the voltage, on a film that creeps."""
    before, length = int(random.choice(quiet)), float(random.choice((3.0, 10.0, 30.0)))
    count = before + int(rate * length)
    time = np.arange(count) / rate
    since = np.maximum(time - time[before] + random.uniform(0, 1) / rate, 0.0)
    after = np.arange(count) >= before
    swings, step = random.uniform(5, 15), random.uniform(1e-4, 6e-4)
    fades = random.uniform(0.2, 5) if fades is None else fades
    swing = np.exp(-fades * since) * (np.cos(2 * np.pi * swings * since) + 0.05 * np.exp(
        -fades * since) * np.cos(4 * np.pi * swings * since))
    creep = random.uniform(0, 0.6) * (1 - np.exp(-since / random.uniform(0.05, 10)))
    noise = noise_of(int(random.integers(4)), count, rate, random)
    read = 2e-3 + after * step * (1 - swing + creep) + random.uniform(3e-6, 15e-6) * noise
    return SampledRun(time, 6e3 * after, read, np.inf, np.arange(count) + 2)
