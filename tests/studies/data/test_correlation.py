"""Correlated residuals: against dense matrices, and limits that hold as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from tympan.studies.estimation.correlation import CorrelatedNoise

SERIES = [np.arange(25), np.arange(25, 55), np.array([55])]
COUNT = 60  # the last four readings are in no series
JACOBIAN = np.column_stack([np.linspace(0, 1, COUNT) ** power for power in range(3)])


def correlations(correlation: float) -> np.ndarray:
    matrix = np.eye(COUNT)
    for run in SERIES:
        matrix[np.ix_(run, run)] = correlation ** np.abs(run[:, None] - run)
    return matrix


def residual_of(errors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    values = np.linalg.lstsq(JACOBIAN, errors, rcond=None)[0]
    return values, errors - JACOBIAN @ values


@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_covariance_and_freedom_are_those_of_dense_matrices(scale: float) -> None:
    rng = np.random.default_rng(5)
    errors = np.linalg.cholesky(correlations(0.6)) @ rng.standard_normal(COUNT)
    _, residual = residual_of(errors)
    jacobian = JACOBIAN * [1.0, scale, 1.0]
    noise = CorrelatedNoise.of(jacobian, residual, SERIES)
    assert 0.2 < noise.correlation < 0.8
    matrix, back = correlations(noise.correlation), np.linalg.pinv(jacobian)
    rest = np.eye(COUNT) - jacobian @ back
    likeness = sum(residual[run[:-1]] @ residual[run[1:]] for run in SERIES) / (residual @ residual)
    shift = np.zeros((COUNT, COUNT))
    for run in SERIES:
        shift[run[:-1], run[1:]] = shift[run[1:], run[:-1]] = 0.5
    assert (np.trace(rest @ shift @ rest @ matrix) / np.trace(rest @ matrix)
            == pytest.approx(likeness, abs=1e-3))
    assert noise.sigma**2 == pytest.approx(residual @ residual / np.trace(rest @ matrix))
    assert noise.covariance == pytest.approx(noise.sigma**2 * back @ matrix @ back.T, rel=1e-6)
    assert noise.freedom == pytest.approx(np.trace(rest @ matrix) ** 2
                                          / np.trace(rest @ matrix @ rest @ matrix))
    independent = noise.sigma**2 * np.diag(np.linalg.inv(jacobian.T @ jacobian))
    assert noise.widening**2 * independent == pytest.approx(np.diag(noise.covariance), rel=1e-6)


@pytest.mark.parametrize("correlation", [0.0, 0.5])
def test_limits_hold_as_often_as_they_say(correlation: float) -> None:
    """Nearly so with 60 readings: the correlation itself is estimated."""
    rng, root = np.random.default_rng(1), np.linalg.cholesky(correlations(correlation))
    trials, hits = 300, 0
    for _ in range(trials):
        values, residual = residual_of(root @ rng.standard_normal(COUNT))
        noise = CorrelatedNoise.of(JACOBIAN, residual, SERIES)
        hits += abs(values[0]) < noise.quantile * noise.covariance[0, 0] ** 0.5
    assert binom.ppf(0.001, trials, 0.93) <= hits <= binom.ppf(0.999, trials, 0.96)


def test_residuals_less_alike_than_independent_ones_count_as_independent() -> None:
    _, residual = residual_of((-1.0) ** np.arange(COUNT))
    noise = CorrelatedNoise.of(JACOBIAN, residual, SERIES)
    assert noise.correlation == 0.0
    assert noise.freedom == pytest.approx(COUNT - 3)
    assert noise.widening == pytest.approx(np.ones(3))


def test_a_given_noise_stays_and_what_nothing_sees_is_open() -> None:
    _, residual = residual_of(np.sin(np.arange(COUNT) ** 2))
    blind = np.column_stack([JACOBIAN, np.zeros(COUNT)])
    noise = CorrelatedNoise.of(blind, residual, SERIES, given=2.5)
    assert noise.sigma == 2.5
    assert noise.quantile == pytest.approx(1.959964, rel=1e-6)
    assert np.isinf(noise.covariance[3, 3])
    assert np.isfinite(np.diag(noise.covariance)[:3]).all()
