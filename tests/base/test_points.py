"""Points that fill a cube, by every method."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from tympan.base.points import Drawing, drawn_points


@pytest.mark.parametrize("method", get_args(Drawing))
def test_samples_are_seeded_and_fill_their_ranges(method: str) -> None:
    points = drawn_points(3, 60, 1, method)
    assert points.shape == (60, 3)
    assert np.array_equal(points, drawn_points(3, 60, 1, method))
    assert not np.array_equal(points, drawn_points(3, 60, 2, method))
    assert points.min() >= 0
    assert points.max() < 1
    assert np.abs(points.mean(axis=0) - 0.5).max() < 0.15
