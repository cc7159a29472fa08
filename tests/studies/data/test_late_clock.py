"""A run whose clock is off is told by when its plate begins to move; no effect is called so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.readings.round_actuators import GRAVITY, Hidden
from tests.oracles.readings.runs_in_time import plate_of
from tests.support.sampled_runs import run
from tympan.studies.data.late_clock import onset, with_clocks
from tympan.studies.data.sampled_run import SampledRun


def shifted(record: SampledRun, count: int) -> SampledRun:
    """With voltages so many samples early."""
    places = np.clip(np.arange(len(record.time)) + count, 0, len(record.time) - 1)
    return replace(record, voltage=record.voltage[places])


def test_clocks_that_are_right_are_found_right() -> None:
    """In 300 runs of plates that swing and films that creep, whatever the noise."""
    random, clear = np.random.default_rng(1), 0
    for _ in range(300):
        found = onset(run(random, float(random.choice((40.0, 100.0, 200.0, 1000.0)))))
        clear += found is not None
        assert found is None or found.low <= 0 <= found.high
    assert clear > 150


@pytest.mark.parametrize("late", [0.1, 0.5, 1.5, -0.1, -0.3])
def test_a_late_run_among_others_is_told_with_its_delay(late: float) -> None:
    random, told = np.random.default_rng(2), 0
    for _ in range(20):
        runs = [run(random, 200.0, quiet=(400,)) for _ in range(3)]
        count = round(late * 200)
        if abs(count) > 0.9 * len(runs[1].time):
            continue
        (_, first), (moved, second), (_, third) = with_clocks(
            [runs[0], shifted(runs[1], count), runs[2]])
        assert first is third is None
        if second is not None:
            told += 1
            assert second.low <= count / 200 <= second.high
            assert abs(int(moved.jumps[0]) - 400) <= 4
    assert told >= 12


def test_a_run_alone_has_wider_limits() -> None:
    random = np.random.default_rng(3)
    record = shifted(run(random, 200.0, fades=2.0, quiet=(400,)), 60)
    ((_, alone),) = with_clocks([record])
    assert alone is not None
    assert alone.low < 0.3 < alone.high


@pytest.mark.parametrize("hidden", [
    Hidden(damping=0.1), Hidden(damping=0.3), Hidden(damping=0.1, resistance=40e6),
    Hidden(damping=0.1, lag=30e-3), Hidden(damping=0.3, resistance=40e6, lag=15e-3)])
def test_no_effect_is_a_late_clock(hidden: Hidden) -> None:
    """Of a plate that swings, a film that charges and a sensor that is late, by their equations."""
    random, when = np.random.default_rng(4), (np.arange(3000) + 0.02) / 1000
    path = plate_of("middle", 2e-2, hidden).stepped(2e-2 * GRAVITY, 3.5e3, when)
    read = np.r_[np.full(400, path[0]), path]
    for noise in (1e-8, 1e-6, 10e-6):
        noisy = read + noise * random.standard_normal(len(read))
        record = SampledRun(np.arange(len(read)) / 1000, 3.5e3 * (np.arange(len(read)) >= 400),
                            noisy, np.inf, np.arange(len(read)))
        found = onset(record)
        assert found is not None
        assert found.low <= 0 <= found.high
