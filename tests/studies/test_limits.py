"""The limits of a film, against the axisymmetric equations and other meshes."""

from __future__ import annotations

import pytest

from tests.oracles import axisymmetric
from tests.oracles.unstable import slack_voltage
from tests.support.specimens import ROOT5, circular
from tympan.fem.film.laws import NeoHooke
from tympan.fem.rig import Rig
from tympan.studies.case import Case, Settings
from tympan.studies.limits import Limits, limits

SOFT = circular(NeoHooke(15e3))
ORACLE = axisymmetric.Film(10e-3, 45e-3, 1e-3, ROOT5, axisymmetric.neo_hooke(15e3), 4.7)
FORCE = 17.9e-3 * 9.80665


@pytest.fixture(scope="module")
def soft() -> Limits:
    return limits(Case(SOFT, mass=17.9e-3), Settings())


def test_a_round_film_loses_tension_and_pulls_in_where_the_equations_have_it(soft: Limits) -> None:
    assert soft.pull_in is not None
    assert soft.tension is not None
    assert soft.pull_in.voltage_V == pytest.approx(axisymmetric.pull_in_voltage(ORACLE, FORCE),
                                                   rel=2e-5)
    # Stress at the rim is less exact than force: 2e-4 of it.
    assert soft.tension.voltage_V == pytest.approx(slack_voltage(ORACLE, FORCE, 6800.0), rel=5e-4)
    assert soft.ended == "the film pulls in"


def test_limits_are_nominal_voltages(soft: Limits) -> None:
    """What the supply shows: with twice the gain half of it will do."""
    doubled = limits(Case(SOFT, mass=17.9e-3, rig=Rig(amplifier_gain=1.0)), Settings())
    assert doubled.pull_in is not None
    assert soft.pull_in is not None
    assert doubled.pull_in.voltage_V == pytest.approx(soft.pull_in.voltage_V / 2, rel=1e-9)
