"""Steps of the search by themselves: a vertex and its multipliers that are known."""

from __future__ import annotations

import numpy as np
import pytest

from tympan.studies.design.sqp import DescentSettings, Linearisation, maximise


class Disc:
    """x + 2 y under x² + y² ≤ 1/2 and y ≤ 0.6, where nothing is known beyond x = 0.45."""

    def at(self, x: np.ndarray) -> Linearisation | None:
        if x[0] > 0.45:
            return None
        return Linearisation(x[0] + 2 * x[1], np.array([1.0, 2.0]),
                             np.array([x @ x - 0.5, x[1] - 0.6]),
                             np.array([2 * x, [0.0, 1.0]]))


def test_the_maximiser_finds_a_known_vertex_and_its_multipliers() -> None:
    maximum = maximise(Disc(), np.array([0.1, 0.1]), DescentSettings(radius=0.3, widest=1.0))
    root = np.sqrt(0.5 - 0.36)
    assert maximum.status == "optimum"
    np.testing.assert_allclose(maximum.x, [root, 0.6], atol=3e-5)
    assert maximum.multipliers is not None
    np.testing.assert_allclose(maximum.multipliers.limits, [1 / (2 * root), 2 - 1.2 / (2 * root)],
                               rtol=1e-3)


def test_a_start_without_a_value_is_no_start() -> None:
    ended = maximise(Disc(), np.array([0.5, 0.1]))
    assert (ended.status, ended.here) == ("no_start", None)


class Slope:
    """x − y without limits: best where x is largest and y least."""

    def at(self, x: np.ndarray) -> Linearisation:
        return Linearisation(x[0] - x[1], np.array([1.0, -1.0]), np.zeros(0), np.zeros((0, 2)))


def test_a_corner_of_the_ranges_has_the_price_of_each() -> None:
    ended = maximise(Slope(), np.array([0.4, 0.3]))
    assert ended.status == "optimum"
    assert ended.x == pytest.approx([1, 0], abs=1e-12)
    assert ended.multipliers is not None
    assert ended.multipliers.bounds == pytest.approx([1, -1])
