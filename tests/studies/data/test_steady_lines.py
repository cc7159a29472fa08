"""Hum in runs in time: found with its size, and never what a film does by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.sampled_runs import run
from tympan.studies.data.sampled_run import SampledRun
from tympan.studies.data.steady_lines import SteadyLine, steady_lines

RATES = (40.0, 100.0, 200.0, 333.0, 500.0, 1000.0)


def with_sine(record: SampledRun, size: float, frequency: float, phase: float = 1.0) -> SampledRun:
    wave = size * np.sin(2 * np.pi * frequency * record.time + phase)
    return replace(record, displacement=record.displacement + wave)


def lines_of(record: SampledRun) -> tuple[SteadyLine, ...]:
    return steady_lines(record)[0]


@pytest.mark.parametrize("rate", RATES)
def test_without_hum_none_is_found(rate: float) -> None:
    """In 50 runs each; in 1200 with other seeds none was."""
    random = np.random.default_rng(int(rate))
    assert not [lines for _ in range(50) if (lines := lines_of(run(random, rate)))]


@pytest.mark.parametrize("rate", RATES[2:])
@pytest.mark.parametrize("mains", [50.0, 60.0])
def test_hum_is_found_with_its_size(rate: float, mains: float) -> None:
    """Of 5 to 50 um, where samples tell it; 95 % limits hold as often, and what is left of the wave
    is no more than such limits leave."""
    random, held, left = np.random.default_rng(int(rate + mains)), [], []
    for _ in range(25):
        plain, size = run(random, rate), random.uniform(5e-6, 50e-6)
        loud = with_sine(plain, size, mains * (1 + 5e-4 * random.standard_normal()),
                         random.uniform(0, 6))
        lines, wave = steady_lines(loud)
        first = lines[0]
        assert first.mains
        assert first.frequency == mains
        held.append(abs(first.amplitude - size) < 1.96 * first.sigma)
        left.append(np.std(loud.displacement - plain.displacement - wave) / first.sigma)
    assert np.mean(held) > 0.8
    assert np.median(left) < 2


@pytest.mark.parametrize(("rate", "mains", "seen"), [
    (40.0, 50.0, 10.0), (80.0, 60.0, 20.0), (130.0, 100.0, 30.0), (333.0, 240.0, 93.0)])
def test_hum_is_known_where_samples_fold_it(rate: float, mains: float, seen: float) -> None:
    random = np.random.default_rng(3)
    lines = lines_of(with_sine(run(random, rate, quiet=(200,)), 30e-6, mains + 0.02))
    assert [line.frequency for line in lines] == [mains]
    assert lines[0].seen == pytest.approx(seen, abs=0.05)
    assert abs(lines[0].amplitude - 30e-6) < 3 * lines[0].sigma


def test_at_half_the_rate_only_a_part_is_seen() -> None:
    random = np.random.default_rng(4)
    (line,) = lines_of(with_sine(run(random, 100.0, quiet=(200,)), 30e-6, 50.0))
    assert line.sigma == np.inf
    assert line.amplitude < 1.5 * 30e-6


def test_hum_that_wanders_is_one_line_and_goes_whole() -> None:
    """By half a turn in phase and a tenth in size, as grids do in half a minute."""
    random = np.random.default_rng(5)
    plain = run(random, 200.0, quiet=(200,))
    share = plain.time / plain.time[-1]
    wave = 20e-6 * (1 + 0.1 * np.sin(3 * share)) * np.sin(
        2 * np.pi * 50 * plain.time + np.pi * share**2)
    lines, found = steady_lines(replace(plain, displacement=plain.displacement + wave))
    assert len(lines) == 1
    assert np.std(found - wave) < 2e-6


@pytest.mark.parametrize("swing", [9.0, 20.0, 50.0])
def test_what_swings_after_a_jump_is_no_hum(swing: float) -> None:
    """Fading within the run or not, at the mains' frequency or not: it is not there before."""
    random = np.random.default_rng(6)
    for fades in (0.0, 0.05, 1.0):
        plain = run(random, 200.0, quiet=(100, 200))
        jump = int(plain.jumps[0])
        since = np.maximum(plain.time - plain.time[jump], 0.0)
        ring = 2e-4 * np.exp(-fades * since) * np.sin(2 * np.pi * swing * since)
        assert not lines_of(replace(plain, displacement=plain.displacement + ring))


def test_a_film_that_is_driven_hums_not() -> None:
    """By a sine of the voltage, whose multiples are the mains'."""
    random = np.random.default_rng(7)
    time = np.arange(6000) / 200.0
    voltage = 3e3 + 1e3 * np.sin(2 * np.pi * 5.0 * time)
    read = 2e-3 + 3e-4 * (voltage / 6e3) ** 2 + 1e-5 * np.sin(2 * np.pi * 50.0 * time)
    noisy = read + 5e-6 * random.standard_normal(len(time))
    assert not lines_of(SampledRun(time, voltage, noisy, np.inf, np.arange(6000)))


def test_any_line_that_is_always_there_is_told() -> None:
    """Such as a pump's; one that ends is not."""
    random = np.random.default_rng(8)
    plain = run(random, 200.0, quiet=(400,))
    (line,) = lines_of(with_sine(plain, 20e-6, 33.3))
    assert not line.mains
    assert line.frequency == pytest.approx(33.3, abs=0.01)
    assert abs(line.amplitude - 20e-6) < 3 * line.sigma
    on = np.sin(2 * np.pi * 33.3 * plain.time) * (plain.time < 0.4 * plain.time[-1])
    assert not lines_of(replace(plain, displacement=plain.displacement + 20e-6 * on))
