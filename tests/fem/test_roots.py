"""Searches for a zero: a function that has no value somewhere has no zero, and raises nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from tests.support.specimens import circular
from tympan.fem.film.laws import Gent, NeoHooke
from tympan.fem.membrane.state import PlateMotion, turned
from tympan.fem.rig import Rig
from tympan.fem.roots import NoValueHere, root_between
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Case, Settings
from tympan.studies.limits import solve_within

COARSE = Settings(MeshSettings(order=2).refined(0.7))


def test_a_zero_is_found_to_the_accuracy_that_is_asked_for() -> None:
    assert root_between(np.cos, 1.0, 2.0) == pytest.approx(np.pi / 2, rel=1e-12)
    coarse = root_between(np.cos, 1.0, 2.0, xtol=1e-2)
    assert coarse is not None
    assert abs(coarse - np.pi / 2) < 1e-2
    assert root_between(lambda x: x, 0.0, 1.0) == 0.0


@pytest.mark.parametrize("without", [
    lambda x: 1.0,
    lambda x: np.nan,
    lambda x: np.inf if x > 1.5 else -1.0,
    lambda x: x - 1.5 if x in (1.0, 2.0) else np.nan])
def test_none_where_there_is_no_value_or_no_change_of_sign(without) -> None:
    assert root_between(without, 1.0, 2.0) is None


def test_a_function_says_that_it_has_no_value() -> None:
    def lost(x: float) -> float:
        if x not in (0.0, 1.0):
            raise NoValueHere
        return x - 0.5

    assert root_between(lost, 0.0, 1.0) is None


@pytest.mark.parametrize(("law", "stretch", "mass", "gas"), [
    (NeoHooke(23e3), 1.09, 1e-3, 1e8), (NeoHooke(23e3), 1.09, 0.0, -1e8),
    (Gent(20e3, 30.0), 3.9, 1.0, 0.0), (Gent(20e3, 30.0), 3.9, 10.0, 1e8)])
def test_loads_beyond_all_a_film_bears_are_answered(law, stretch, mass, gas) -> None:
    case = Case(circular(law, prestretch=(stretch, stretch)), mass=mass, voltage=1000.0,
                rig=Rig(gas_pressure=gas))
    result = solve_within(case, COARSE)
    assert result.status in ("equilibrium", "no_equilibrium", "not_converged")
    assert result.status == "equilibrium" or result.warnings


@given(st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=5), st.floats(0.1, 40.0))
def test_roots_are_those_that_scipy_finds(factors: list[float], steep: float) -> None:
    """Of polynomials with a steep step: Brent's method is another one."""
    def function(x: float) -> float:
        return float(np.polyval(factors, x) + np.tanh(steep * (x - 0.3)))

    assume(function(0.0) * function(1.0) < 0)
    there = root_between(function, 0.0, 1.0)
    assert there is not None
    # Where it is flat, any place is one whose value is as near to 0.
    assert abs(function(there)) <= 1e-10 or there == pytest.approx(
        brentq(function, 0.0, 1.0, xtol=1e-13), abs=1e-10)


def test_turns_of_plates_are_the_rotation_vectors_that_scipy_has() -> None:
    drawn = np.random.default_rng(3)
    for size in (1e-12, 1e-6, 1e-2, 3.0):
        first, second = (PlateMotion(np.zeros(3), Rotation.from_rotvec(
            size * (vector := drawn.normal(size=3)) / np.linalg.norm(vector) * share).as_matrix())
            for share in (0.0, 1.0))
        known = Rotation.from_matrix(second.rotation @ first.rotation.T).as_rotvec()
        np.testing.assert_allclose(turned(second, first), known, rtol=1e-6, atol=1e-15)
    assert not turned(first, first).any()
