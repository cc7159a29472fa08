"""Correlated residuals: against dense matrices, and limits that hold as often as they say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import binom, t

from tympan.studies.estimation.correlation import CorrelatedSpread

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
    noise = CorrelatedSpread.of(jacobian, residual, SERIES)
    assert 0.2 < noise.correlation < 0.8
    matrix, back = correlations(noise.correlation), np.linalg.pinv(jacobian)
    rest = np.eye(COUNT) - jacobian @ back
    likeness = sum(residual[run[:-1]] @ residual[run[1:]] for run in SERIES) / (residual @ residual)
    assert (np.trace(rest @ shifts() @ rest @ matrix) / np.trace(rest @ matrix)
            == pytest.approx(likeness, abs=1e-3))
    assert noise.noise.size**2 == pytest.approx(residual @ residual / np.trace(rest @ matrix))
    assert noise.covariance == pytest.approx(noise.noise.size**2 * back @ matrix @ back.T, rel=1e-6)
    assert noise.noise.freedom == pytest.approx(np.trace(rest @ matrix) ** 2
                                          / np.trace(rest @ matrix @ rest @ matrix))
    independent = noise.noise.size**2 * np.diag(np.linalg.inv(jacobian.T @ jacobian))
    assert noise.widening**2 * independent == pytest.approx(np.diag(noise.covariance), rel=1e-6)


def shifts() -> np.ndarray:
    matrix = np.zeros((COUNT, COUNT))
    for run in SERIES:
        matrix[run[:-1], run[1:]] = matrix[run[1:], run[:-1]] = 0.5
    return matrix


@pytest.mark.parametrize("given", [None, 1.3])
def test_quantiles_are_of_how_a_variance_scatters(given: float | None) -> None:
    """By the fluctuation of its logarithm in residuals a little changed, with dense matrices."""
    rng = np.random.default_rng(6)
    _, residual = residual_of(np.linalg.cholesky(correlations(0.7)) @ rng.standard_normal(COUNT))
    noise = CorrelatedSpread.of(JACOBIAN, residual, SERIES, given)
    rest = np.eye(COUNT) - JACOBIAN @ np.linalg.pinv(JACOBIAN)
    near, spread = shifts(), correlations(noise.correlation)
    remaining = rest @ spread @ rest
    likeness = np.trace(near @ remaining) / np.trace(remaining)

    def logs(squares: float, products: float) -> np.ndarray:
        """Of the variances, of residuals with such sums."""
        again = brentq(lambda trial: np.trace(near @ rest @ correlations(trial) @ rest)
                       / np.trace(rest @ correlations(trial)) - products / squares, 0.0, 0.99)
        matrix, back = correlations(again), np.linalg.pinv(JACOBIAN)
        sigma = 1.0 if given else squares / np.trace(rest @ matrix)
        return np.log(np.diag(back @ matrix @ back.T) * sigma)

    by_squares, by_products = (
        (logs(1 + 1e-5 * first, likeness + 1e-5 * second)
         - logs(1 - 1e-5 * first, likeness - 1e-5 * second)) / 2e-5
        for first, second in ((1, 0), (0, 1)))
    for number in range(3):
        form = (by_squares[number] * np.eye(COUNT) + by_products[number] * near) @ remaining
        variance = 2 * np.trace(form @ form) / np.trace(remaining) ** 2
        assert noise.quantiles[number] == pytest.approx(t.ppf(0.975, 2 / variance), rel=1e-3)
    assert (noise.quantiles > t.ppf(0.975, noise.noise.freedom)).all()


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.8])
def test_limits_hold_as_often_as_they_say(correlation: float) -> None:
    """With 60 readings, of which the correlation is estimated too."""
    rng, root = np.random.default_rng(1), np.linalg.cholesky(correlations(correlation))
    trials, hits = 400, np.zeros(len(JACOBIAN.T))
    for _ in range(trials):
        values, residual = residual_of(root @ rng.standard_normal(COUNT))
        noise = CorrelatedSpread.of(JACOBIAN, residual, SERIES)
        hits += np.abs(values) < noise.quantiles * np.diag(noise.covariance) ** 0.5
    assert (hits >= binom.ppf(0.001, trials, 0.95)).all()
    assert (hits <= binom.ppf(0.999, trials, 0.97)).all()


def test_residuals_less_alike_than_independent_ones_count_as_independent() -> None:
    _, residual = residual_of((-1.0) ** np.arange(COUNT))
    noise = CorrelatedSpread.of(JACOBIAN, residual, SERIES)
    assert noise.correlation == 0.0
    assert noise.noise.freedom == pytest.approx(COUNT - 3)
    assert noise.widening == pytest.approx(np.ones(3))
    assert noise.quantiles == pytest.approx(np.full(3, t.ppf(0.975, COUNT - 3)))


def test_a_given_noise_stays_and_what_nothing_sees_is_open() -> None:
    _, residual = residual_of(np.sin(np.arange(COUNT) ** 2))
    blind = np.column_stack([JACOBIAN, np.zeros(COUNT)])
    noise = CorrelatedSpread.of(blind, residual, SERIES, given=2.5)
    assert noise.noise.size == 2.5
    assert noise.quantiles == pytest.approx(np.full(4, 1.959964), rel=1e-6)
    assert np.isinf(noise.covariance[3, 3])
    assert np.isfinite(np.diag(noise.covariance)[:3]).all()
