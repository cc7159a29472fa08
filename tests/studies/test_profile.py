"""Profiles: limits against closed forms, also where the best value lies far off, on a bound."""

from __future__ import annotations

import numpy as np
import pytest

from tympan.studies.estimation.least_squares import LeastSquares
from tympan.studies.estimation.profile import profile


@pytest.mark.parametrize("bound", [1e2, 1e4, 1e7])
def test_limit_far_below_a_bound(bound: float) -> None:
    """χ rises as 1/x down from the bound, so that a straight line through it hardly moves."""
    weight = 100.0

    def both(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x = z[0]
        return np.array([weight / x]), np.array([[-weight / x**2]])

    problem = LeastSquares.of(both, np.array([1e-3]), np.array([bound]))
    quantile = 1.96
    # The rise of χ² counts from the bound: (w/x)² − (w/bound)² = quantile².
    exact = weight / np.sqrt(quantile**2 + (weight / bound) ** 2)
    result = profile(problem, np.array([bound]), 0, quantile)
    assert result.low == pytest.approx(exact, rel=0.02)
    assert result.high is None


@pytest.mark.parametrize("edge", [0.81, 0.9, 1.9])
def test_limit_beside_what_the_model_cannot_reach(edge: float) -> None:
    def both(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return (z if abs(z[0]) < edge else np.full(1, np.nan)), np.eye(1)

    result = profile(LeastSquares.of(both, np.array([-1e6]), np.array([1e6])), np.zeros(1), 0, 0.8)
    assert result.high == pytest.approx(0.8, abs=0.01)
    assert result.low == pytest.approx(-0.8, abs=0.01)
