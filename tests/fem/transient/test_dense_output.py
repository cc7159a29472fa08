"""What is said of a motion between the moments that were computed."""

from __future__ import annotations

import numpy as np
import pytest

from tympan.fem.transient.dense_output import spline, weights

TIMES = np.array([0.0, 0.1, 0.4, 1.0, 1.1, 2.0])
WHEN = np.linspace(0.01, 1.99, 97)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_through_few_moments_it_is_their_polynomial(count: int) -> None:
    times, when = TIMES[:count], np.linspace(0.0, 0.4, 17)
    powers = range(count)
    values = sum((k + 1) * times**k for k in powers)
    exact = sum((k + 1) * when**k for k in powers)
    assert spline(times, values)(when) == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_weights_give_the_curves_values(count: int) -> None:
    times = TIMES[1:count + 1]
    values = np.sin(3 * times)
    for when in WHEN:
        shares = weights(times.tolist(), float(when))
        assert np.dot(shares, values) == pytest.approx(float(spline(times, values)(when)), rel=1e-9)


def test_the_error_goes_with_the_fourth_power_of_the_steps() -> None:
    misses = []
    for steps in (22, 44, 88):
        times = np.linspace(0.0, 2.0, steps + 1)
        values = np.exp(-times) * np.sin(5 * times)
        exact = np.exp(-WHEN) * np.sin(5 * WHEN)
        misses.append(np.abs(spline(times, values)(WHEN) - exact).max())
    assert -np.diff(np.log2(misses)) == pytest.approx([4.0, 4.0], abs=0.4)
