"""Smooth misfits, patterns and ratios of a bench whose readings are straight in all unknowns."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.straight_bench import MASSES, StraightBench, design, readings
from tympan.studies.diagnosis.inference.ratios import ratios
from tympan.studies.diagnosis.inference.residual_tests import ResidualTests
from tympan.studies.diagnosis.inference.smooth_misfit import (
    MOST_ROWS,
    GaussianProcess,
    smooth_columns,
)

NAMES = [specimen.name for specimen in StraightBench().setup.specimens]


def test_columns_of_smooth_misfits_have_the_covariance_of_the_process() -> None:
    table = design()
    every = list(smooth_columns(table))
    # Of four lengths in voltage, three in mass and three likenesses.
    assert len(every) == 36
    for columns, lengths, like in ((every[0], (0.2, 0.1), 0.5), (every[-1], (3.0, 2.0), 0.99)):
        process = GaussianProcess(table, np.zeros(len(table)), lengths, like, 1.0)
        assert columns @ columns.T == pytest.approx(process.covariance(table, table), abs=1e-3)


def test_there_are_none_without_lengths_or_of_very_many() -> None:
    table = design(voltages=70)
    assert len(table) > MOST_ROWS
    assert not list(smooth_columns(table))
    assert not list(smooth_columns(table[table.mass < 0]))


def test_ratios_are_to_the_first_specimen_and_to_the_smallest_mass() -> None:
    table = readings({})
    names = [ratio.what for ratio in ratios(table, table.value, NAMES)]
    light, heavy = (f"{1e3 * mass:.4g} g" for mass in MASSES)
    assert names == [
        *(f"{name} over {NAMES[0]} at {mass}" for mass in (light, heavy) for name in NAMES[1:]),
        *(f"{heavy} over {light}, {name}" for name in NAMES)]


def test_what_jumps_is_tested_column_by_column_and_what_is_smooth_as_a_whole() -> None:
    place = np.linspace(-1.0, 1.0, 30)
    smooth = np.stack([place, place**2], 1)
    steps = (place[:, None] > np.array([-0.5, 0.0, 0.5])).astype(float)
    tests = ResidualTests.of(np.ones((30, 1)), {"voltage": smooth, "step": steps})
    assert {name: basis.shape[1] for name, basis in tests.bases.items()} == {"voltage": 2}
    assert {name: columns.shape[1] for name, columns in tests.jumps.items()} == {"step": 3}
