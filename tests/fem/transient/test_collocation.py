"""Rules of collocation against their order conditions and an equation whose solution is known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from tympan.fem.transient.collocation import gauss, newton_matrix, radau


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


@pytest.mark.parametrize("stages", [1, 2, 3, 5])
def test_gauss_integrates_polynomials_of_its_order(stages: int) -> None:
    """Of degree s - 1 at every stage, of degree 2 s - 1 at the end, and of no higher one."""
    rule = gauss(stages)
    for power in range(2 * stages + 1):
        sums = rule.matrix @ rule.nodes**power
        if power < stages:
            assert sums == pytest.approx(rule.nodes ** (power + 1) / (power + 1), abs=1e-13)
        missed = abs(rule.end @ sums - 1 / (power + 1))
        assert (missed < 1e-13) == (power < 2 * stages)


def test_gauss_of_three_stages_is_the_textbooks() -> None:
    """Hairer and Wanner, table IV.5.2."""
    rule, root = gauss(3), 15**0.5
    assert rule.nodes == pytest.approx([0.5 - root / 10, 0.5, 0.5 + root / 10], rel=1e-15)
    assert rule.matrix == pytest.approx(np.array([
        [5 / 36, 2 / 9 - root / 15, 5 / 36 - root / 30],
        [5 / 36 + root / 24, 2 / 9, 5 / 36 - root / 24],
        [5 / 36 + root / 30, 2 / 9 + root / 15, 5 / 36]]), rel=1e-13)


def test_radau_ends_at_its_last_stage() -> None:
    assert radau(3).end == pytest.approx([0.0, 0.0, 1.0], abs=1e-14)


def test_newtons_matrix_solves_a_linear_step_at_once() -> None:
    """ẏ = J y of two bodies at once: stages, and the end, are those of the exponential."""
    rule, step = radau(6), 0.3
    slopes = np.array([[[0.0, 1.0], [-4.0, -0.3]], [[-1.0, 0.5], [0.0, -2.0]]])
    start = np.array([[1.0, 0.2], [0.3, -0.4]])
    matrix = newton_matrix(step * rule.matrix, np.repeat(slopes[:, None], 6, 1))
    stages = np.linalg.solve(matrix, np.tile(start, 6)[..., None]).reshape(2, 6, 2)
    for node, stage in zip(rule.nodes, stages.swapaxes(0, 1), strict=True):
        exact = expm(step * node * slopes) @ start[..., None]
        assert stage == pytest.approx(exact[..., 0], rel=1e-7)


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
