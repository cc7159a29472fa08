"""What samples of transients become: means of blocks whose noise is right whatever its colour."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, f, kstest

from tests.support.costs import dear
from tests.support.noise import autoregressive
from tympan.studies.data.sampled_run import SampledRun, faults
from tympan.studies.diagnosis.history import VoltageHistory
from tympan.studies.diagnosis.transients.block_means import block_means
from tympan.studies.diagnosis.transients.ringing import ringing
from tympan.studies.estimation.noise import STATED

RATE, LENGTH, NOISE = 100.0, 30.0, 10e-6


def record(noise: np.ndarray, swing: float = 0.0, before: int = 100
           ) -> tuple[SampledRun, np.ndarray]:
    """A step that creeps, of which half fades in 5 s; and what it is without noise."""
    time = np.arange(len(noise)) / RATE
    since = time - (before - 0.5) / RATE
    after = since > 0
    late = np.where(after, since, 0.0)
    truth = 2e-3 + after * (3e-4 + 6e-5 * (1 - np.exp(-late / 5)))
    ring = swing * after * np.exp(-late / 2) * np.cos(2 * np.pi * 8.13 * late)
    return SampledRun(time, 3e3 * after, truth + ring + noise, np.inf,
                  np.arange(len(time)) + 2), truth


def coloured(count: int, correlation: float, random: np.random.Generator) -> np.ndarray:
    """White, or of first order with a correlation time [s]."""
    white = random.standard_normal(count)
    if not correlation:
        return NOISE * white
    return NOISE * autoregressive(white, np.exp(-1 / RATE / correlation))


@pytest.mark.parametrize(("swing", "correlation"), [
    (0.0, 0.0), (1e-4, 0.05), dear(0.0, 0.05, seconds=4), dear(0.0, 0.2, seconds=5),
    dear(1e-4, 0.0, seconds=3), dear(1e-4, 0.2, seconds=4)])
def test_limits_hold_and_p_values_are_even(correlation: float, swing: float) -> None:
    """By forty records: 95 % limits hold 95 %, χ² of a record is χ², neighbours hardly know of each
    other. Samples taken as independent would be off by a factor of 4 at 0.05 s."""
    random = np.random.default_rng(7)
    scores, p_values, alarms, neighbours = [], [], [], []
    for _ in range(40):
        data, truth = record(coloured(round(LENGTH * RATE), correlation, random), swing)
        few = block_means(data)
        true = [truth[first:last].mean() for first, last in zip(few.first, few.last, strict=True)]
        score = (few.mean - true) / few.sigma
        scores += score.tolist()
        p_values.append(chi2.sf(score @ score, len(score)))
        alarms.append(f.sf(score @ score / len(score), len(score), STATED))
        neighbours.append(float(score[1:] @ score[:-1]) / (len(score) - 1))
    covered = np.mean(np.abs(scores) < 1.96)
    assert 0.9 < covered < 0.985
    assert abs(np.mean(neighbours)) < 0.15
    assert kstest(p_values, "uniform").pvalue > 1e-3
    # As verdicts take them, with a noise that is known within a quarter.
    assert np.mean(np.array(alarms) < 0.03) < 0.06


def test_a_film_that_rings_tells_frequency_and_rate() -> None:
    random, off = np.random.default_rng(3), []
    for _ in range(20):
        data, _ = record(coloured(round(LENGTH * RATE), 0.0, random), swing=1e-4)
        rung = ringing(data.time[100:], data.displacement[100:])
        assert rung is not None
        off.append([(rung.frequency - 8.13) / rung.frequency_sigma,
                    (rung.decay - 0.5) / rung.decay_sigma])
    assert np.abs(np.mean(off, axis=0)).max() < 1
    assert np.sqrt(np.mean(np.square(off))) < 1.5


def test_noise_alone_rings_not() -> None:
    random = np.random.default_rng(5)
    for correlation in (0.0, 0.05):
        for _ in range(20):
            data, _ = record(coloured(3000, correlation, random))
            assert ringing(data.time[100:], data.displacement[100:]) is None


def test_faults_are_told_before_any_physics() -> None:
    random = np.random.default_rng(1)
    good, _ = record(coloured(3000, 0.0, random))
    assert faults(good).words == ""

    back = np.r_[good.time[:1000], good.time[900:2900]]
    jump = good.time + 2.0 * (np.arange(3000) > 1500)
    high = np.minimum(good.displacement, np.quantile(good.displacement, 0.8))
    for time, displacement, words in ((back, good.displacement, "runs back or stands still at line "
                                       "1002"),
                                      (jump, good.displacement, "clock jumps or samples are "
                                       "missing: 2"),
                                      (good.time, high, "sensor is at its end: the same value")):
        wrong = faults(SampledRun(time, good.voltage, displacement, np.inf, good.line))
        assert wrong.fatal
        assert words in wrong.words
    few = np.delete(np.arange(3000), [700, 1500, 1501])
    harmless = faults(SampledRun(good.time[few], good.voltage[few], good.displacement[few], np.inf,
                          good.line[few]))
    assert not harmless.fatal
    assert harmless.words.startswith("3 samples are missing")


def test_a_rounding_sensor_is_at_no_end() -> None:
    random = np.random.default_rng(1)
    data, _ = record(0.1 * coloured(3000, 0.0, random))
    rounded = np.round(data.displacement, 5)
    assert not faults(SampledRun(data.time, data.voltage, rounded, np.inf, data.line)).fatal


def test_voltages_with_noise_are_a_few_lines() -> None:
    random = np.random.default_rng(2)
    data, _ = record(coloured(3000, 0.0, random))
    noisy = data.voltage + 2.0 * random.standard_normal(3000)
    signal = VoltageHistory.of(SampledRun(data.time, noisy, data.displacement, np.inf, data.line)
                               ).signal
    assert len(signal.time) < 8
    assert np.abs(signal.breaks - 99.5 / RATE).min() < 1e-9


@pytest.mark.parametrize(("count", "rate", "correlation"), [
    (100, 20.0, 0.0), (100, 20.0, 0.05), (600, 20.0, 0.05), (3000, 100.0, 0.05)])
def test_noise_does_not_swing(count: int, rate: float, correlation: float) -> None:
    """Of forty records of what creeps none; by peaks of short spectra a quarter of some did."""
    random = np.random.default_rng(3)
    kept = np.exp(-1 / rate / correlation) if correlation else 0.0
    time = (np.arange(count) + 0.5) / rate
    for _ in range(40):
        noise = random.standard_normal(count)
        for number in range(1, count):
            noise[number] = kept * noise[number - 1] + (1 - kept**2) ** 0.5 * noise[number]
        slow = 3e-3 + 3e-4 * (1 - np.exp(-time / 5))
        assert ringing(time, slow + NOISE * noise) is None
