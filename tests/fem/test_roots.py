"""Searches for a zero: a function that has no value somewhere has no zero, and raises nothing."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.specimens import circular
from tympan.fem.film.laws import Gent, NeoHooke
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
