"""Explanations are weighed by one formula: an integral over a factor on the noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import logsumexp

from tympan.studies.diagnosis.inference.weighing import most_of_noise, unlikely

COUNT = 20


def integrated(chi_squared: float, known: float) -> float:
    """Minus twice the log probability: noise f times as large, f with a scaled inverse χ² prior."""
    log_f = np.linspace(-5, 8, 20_001)
    logs = -(COUNT + known) * log_f - 0.5 * (chi_squared + known) * np.exp(-2 * log_f)
    return float(-2 * logsumexp(logs))


@pytest.mark.parametrize("known", [0.0, 8.0])
def test_the_noise_is_integrated_over(known: float) -> None:
    squares = [5.0, 20.0, 200.0]
    exact = [integrated(value, known) for value in squares]
    ours = [unlikely(value, COUNT, known) for value in squares]
    assert np.diff(ours) == pytest.approx(np.diff(exact), rel=1e-8)


def test_of_a_known_noise_it_is_chi_squared() -> None:
    assert unlikely(90.0, COUNT) - unlikely(30.0, COUNT) == 60.0
    assert unlikely(90.0, COUNT, 1e12) == pytest.approx(unlikely(90.0, COUNT), rel=1e-3)


def test_each_unknown_costs_the_log_of_the_count() -> None:
    for known in (0.0, 8.0, np.inf):
        more = unlikely(30.0, COUNT, known, 3) - unlikely(30.0, COUNT, known, 1)
        assert more == pytest.approx(2 * np.log(COUNT))


def test_noise_alone_hardly_leaves_more_than_what_counts_as_noise() -> None:
    draws = np.random.default_rng(1).chisquare(COUNT, 20_000)
    assert np.mean(draws > most_of_noise(COUNT)) < 0.05
