"""Noise of parts that few readings tell: no test takes it to be better known than it is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.stats import binom

from tympan.base.arrays import Array
from tympan.studies.diagnosis.inference.projection import without
from tympan.studies.diagnosis.inference.residual_tests import ResidualTests
from tympan.studies.diagnosis.inference.verdict import ALARM
from tympan.studies.estimation.noise import Noise

#: Readings of two parts, of which the first hardly tells its noise, and sets of them.
COUNTS, SETS = (14, 48), 100
PART = np.repeat([0, 1], COUNTS)


def found(freedom: Sequence[float]) -> Noise:
    """Noise whose parts are known so well."""
    return Noise(np.ones(len(PART)), freedom=np.array(freedom), part=PART, found=True)


def model() -> tuple[Array, dict[str, Array]]:
    """Of a model's unknowns and of patterns: four of each part, and one of both."""
    random = np.random.default_rng(1)
    columns = {f"channel {number} of {part}": random.standard_normal((len(PART), 2))
               * (part == PART)[:, None] for number in range(4) for part in range(2)}
    columns["level"] = random.standard_normal((len(PART), 1))
    return random.standard_normal((len(PART), 2)), columns


@pytest.fixture(scope="module")
def p_values() -> Array:
    """Of noise alone, with each part's noise as its own scatter tells: known with the degrees of
    freedom of that, and taken for one noise of all readings, shape (2, sets)."""
    jacobian, columns = model()
    parts = [PART == 0, PART == 1]
    alone = [ResidualTests.of(jacobian[rows], {name: values[rows] for name, values
                                               in columns.items() if values[rows].any()}, 0.0)
             for rows in parts]
    part_noise = found([tests.freedom for tests in alone])
    assert part_noise.freedom.tolist() == [14 - 11, 48 - 11]
    random, values = np.random.default_rng(2), []
    for seed in range(SETS):
        errors = random.standard_normal(len(PART))
        noise = np.array([tests.noise(without(tests.taken, errors[rows]))
                          for tests, rows in zip(alone, parts, strict=True)])[PART]
        tests = ResidualTests.of(jacobian / noise[:, None], {
            name: values / noise[:, None] for name, values in columns.items()}, 0.0)
        residual = without(tests.taken, errors / noise)
        values.append([tests(residual, np.random.default_rng(seed), by).p_value
                       for by in (part_noise, None)])
    return np.array(values).T


def test_noise_alone_alarms_as_often_as_it_should(p_values: Array) -> None:
    """As one noise of all readings it does far more often: three degrees of freedom tell the first
    part's."""
    apart, pooled = np.sum(p_values < ALARM, axis=1)
    most = binom.ppf(0.999, SETS, ALARM)
    assert apart <= most < pooled
    assert np.median(p_values[0]) == pytest.approx(0.5, abs=0.15)


@pytest.mark.parametrize("shares", [(1.0, 0.0), (0.5, 0.5), (0.2, 0.8)])
def test_a_sum_of_variances_scatters_as_its_degrees_of_freedom_say(shares: tuple[float, float]
                                                                   ) -> None:
    """A variance known with ν of them has the variance 2/ν."""
    part_noise = found([5.0, 37.0])
    drawn = np.array(shares) @ part_noise.variances(np.random.default_rng(3), 200_000)
    assert drawn.mean() == pytest.approx(1.0, abs=0.01)
    assert drawn.var() == pytest.approx(2 / part_noise.freedom_of(np.array(shares)), rel=0.03)


def test_a_pattern_has_the_noise_of_the_parts_it_is_in() -> None:
    _, columns = model()
    part_noise = found([5.0, 37.0])
    assert part_noise.shares(columns["channel 0 of 0"]).tolist() == [1.0, 0.0]
    assert part_noise.shares(columns["channel 3 of 1"]).tolist() == [0.0, 1.0]
    squares = columns["level"][:, 0] ** 2
    assert part_noise.shares(columns["level"]) == pytest.approx(
        [squares[:14].sum() / squares.sum(), squares[14:].sum() / squares.sum()])
