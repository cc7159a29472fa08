"""Radau's rule against its order conditions and an equation whose solution is known."""

from __future__ import annotations

import numpy as np
import pytest

from tympan.fem.transient.collocation import radau


@pytest.mark.parametrize("stages", [1, 2, 3, 4, 6])
def test_it_integrates_polynomials_of_its_order(stages: int) -> None:
    """Of degree s - 1 at every stage, of degree 2 s - 2 at the end, and of no higher one."""
    rule = radau(stages)
    for power in range(2 * stages):
        sums = rule.matrix @ rule.nodes**power
        exact = rule.nodes ** (power + 1) / (power + 1)
        if power < stages:
            assert sums == pytest.approx(exact, abs=1e-13)
        assert (abs(sums[-1] - exact[-1]) < 1e-13) == (power < 2 * stages - 1)


@pytest.mark.parametrize("stages", [2, 3, 4])
def test_a_decay_has_its_order_and_a_fast_one_is_forgotten(stages: int) -> None:
    """ẏ = -k (y - cos t) - sin t, so that y = cos t + (y₀ - 1) exp(-k t)."""
    rule, errors = radau(stages), []

    def ended(steps: int, k: float) -> float:
        value, h = 2.0, 1.0 / steps
        for number in range(steps):
            times = h * (number + rule.nodes)
            given = k * np.cos(times) - np.sin(times)
            matrix = np.eye(stages) + h * k * rule.matrix
            value = np.linalg.solve(matrix, value + h * rule.matrix @ given)[-1]
        return float(value)

    for steps in (2, 4, 8):
        errors.append(abs(ended(steps, 1.0) - np.cos(1.0) - np.exp(-1.0)))
    assert -np.diff(np.log2(errors)) == pytest.approx(2 * [2 * stages - 1], abs=0.3)
    assert ended(2, 1e9) == pytest.approx(np.cos(1.0), abs=1e-8)


def test_what_is_beyond_a_step_and_its_highest_coefficients() -> None:
    rule = radau(4)
    at = np.append(0.0, rule.nodes)
    assert rule.beyond(1.5) @ at**4 == pytest.approx((1 + 1.5 * rule.nodes) ** 4, rel=1e-12)
    # On (0, 1) x^4 = P_0/5 + 2 P_1/5 + 2 P_2/7 + P_3/10 + P_4/70.
    assert rule.tail @ at**4 == pytest.approx([1 / 70, 1 / 10], rel=1e-12)
    assert rule.tail @ at**2 == pytest.approx([0.0, 0.0], abs=1e-14)
