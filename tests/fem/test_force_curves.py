"""Mechanisms on arrays of deflections, against each at one deflection after the other."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.biases import SAMPLES
from tympan.fem.membrane.biases import ForceTable, Magnet
from tympan.fem.membrane.quintics import QuinticCurve

#: A film is solved for a minute as far as others are there; studies/test_joined_films.py has it.
CLOSED = {name: bias for name, bias in SAMPLES.items() if name != "film"}


@pytest.mark.parametrize("name", CLOSED)
def test_a_curve_is_the_mechanism_with_its_derivatives(name: str) -> None:
    bias = CLOSED[name]
    curve = QuinticCurve.of(bias.derivatives, -40e-3, 40e-3, getattr(bias, "kinks", ()))
    assert curve is not None
    places = np.linspace(-4.9e-3, 11.9e-3, 301)
    exact = np.array([np.ones(3) * bias.derivatives(place) for place in places.tolist()]).T
    found = np.array(curve.derivatives(places))
    for value, known, near in zip(found, exact, (1e-9, 1e-9, 1e-4), strict=True):
        assert value == pytest.approx(known, abs=near * max(np.abs(known).max(), 1e-3))
    step = 1e-30j  # off the real axis: of the curve's own energy and force
    for value, slope in zip(curve.derivatives(places + step), found[1:], strict=False):
        assert np.imag(value) / 1e-30 == pytest.approx(slope, rel=1e-9, abs=1e-9)


def test_a_curve_ends_where_the_mechanism_does() -> None:
    table = ForceTable((-5e-3, 0.0, 4e-3), (-0.1, 0.0, 0.2))
    curve = QuinticCurve.of(table.derivatives, -1.0, 1.0, table.kinks)
    assert curve is not None
    assert curve.breaks[[0, -1]] == pytest.approx([-5e-3, 4e-3])
    assert np.isnan(curve.derivatives(np.array([-6e-3, 4.1e-3]))).all()
    near = Magnet(0.3, 10e-3, 3e-3)
    met = QuinticCurve.of(near.derivatives, -50e-3, 50e-3)
    assert met is not None
    assert 12e-3 < met.breaks[-1] < 13e-3
    assert QuinticCurve.of(table.derivatives, -1.0, 1.0, table.kinks, through=6e-3) is None
