"""Gas below film and plate: which way it moves them, and what the plate then pulls at its film."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import equilibrium, held
from tympan.fem.film.laws import MooneyRivlin, NeoHooke
from tympan.fem.rig import GAS_SIGN, Rig
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.outlines import Circle
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.case import Case, Settings, build_model, solve
from tympan.studies.limits import limits
from tympan.studies.limits.curve import curve
from tympan.studies.modes import modes
from tympan.studies.path import path
from tympan.studies.response import response
from tympan.studies.sensitivity import sensitivity
from tympan.studies.signals import Pieces
from tympan.studies.transient import TransientCase, respond

MASS, GAS, PLATE, G = 3e-3, 37.0, pi * 7.3e-3**2, 9.80665

FILM = Specimen("film", Circle(31.7e-3), Plate(Circle(7.3e-3)),
                Film(0.41e-3, (1.51, 1.51), MooneyRivlin(11.3e3, 0.7e3), 3.1))
DRUM = Specimen("drum", Circle(31.7e-3), None,
                Film(0.83e-3, (2.03, 2.03), NeoHooke(21.3e3), 3.1, density=1130.0))


def deflection(pressure: float, voltage: float = 2.7e3) -> float:
    result = solve(Case(FILM, mass=MASS, voltage=voltage, rig=Rig(gas_pressure=pressure)),
                   Settings())
    assert result.deflection_m is not None
    return result.deflection_m


def test_gas_below_lifts_the_plate_and_gas_above_pushes_it_down() -> None:
    """By radial finite elements of high order, to the last digit."""
    assert deflection(GAS) == pytest.approx(-0.225e-3, abs=0.5e-6)
    assert deflection(-GAS) == pytest.approx(1.828e-3, abs=0.5e-6)
    assert deflection(GAS) < deflection(0.0) < deflection(-GAS)


def test_gas_takes_weight_off_a_film_without_plate() -> None:
    """To first order a sag is as the weight per area less the gas: none where they are equal."""
    weight = 1130 * G * 0.83e-3 / 2.03**2
    sags = {pressure: solve(Case(DRUM, rig=Rig(gas_pressure=pressure)), Settings()).deflection_m
            for pressure in (0.0, 1.0, 2 * weight, weight)}
    assert sags[1.0] == pytest.approx(sags[0.0] * (1 - 1.0 / weight), rel=1e-5)
    assert sags[2 * weight] == pytest.approx(-sags[0.0], rel=1e-5)
    assert abs(sags[weight]) < 1e-6 * sags[0.0]


@pytest.mark.parametrize("pressure", [GAS, -GAS])
def test_the_reaction_is_weight_less_gas_on_the_plate_on_any_mesh(pressure: float) -> None:
    for refine in (1.0, 2.0, 4.0):
        result = solve(Case(FILM, mass=MASS, voltage=2.7e3, rig=Rig(gas_pressure=pressure)),
                       Settings(MeshSettings().refined(refine)))
        assert result.reaction_N == pytest.approx(MASS * G - pressure * PLATE, rel=1e-9)


def test_the_reaction_of_a_heavy_film_off_centre_and_of_a_plate_that_is_held() -> None:
    """A tilted plate carries gas along its normal; the film's weight at the edge is the film's."""
    aside = replace(FILM, plate=Plate(Circle(7.3e-3), (6e-3, -3e-3)),
                    membrane=replace(FILM.membrane, density=1e4))
    rig = Rig(gas_pressure=60.0)
    model = build_model(aside, Settings(), rig.loading)
    state = equilibrium(model, 0.1, 1e3, 60.0).state
    assert state.plate.tilt > 1e-3
    along = 60.0 * model.plate_area * state.plate.rotation[2, 2]
    assert model.reaction(state) == pytest.approx(0.1 - along, rel=1e-8)
    fixed = held(model, 2e-3, start=None).state
    assert model.reaction(fixed) == pytest.approx(fixed.force, rel=1e-8)


def test_derivatives_of_the_reaction_are_those_of_the_balance() -> None:
    case = Case(FILM, mass=MASS, voltage=2.7e3, rig=Rig(gas_pressure=GAS))
    by = sensitivity(case, Settings(), ("reaction",)).quantities["reaction"].by
    assert by["rig.gas_pressure"].derivative == pytest.approx(-PLATE, rel=1e-7)
    assert by["mass"].derivative == pytest.approx(G, rel=1e-7)
    assert by["plate.outline.radius"].derivative == pytest.approx(-2 * pi * 7.3e-3 * GAS, rel=1e-6)
    assert abs(by["voltage"].derivative * 2.7e3) < 1e-8 * MASS * G
    assert abs(by["frame.radius"].derivative * 31.7e-3) < 1e-8 * MASS * G


def test_every_study_has_the_same_sign_and_says_so() -> None:
    rig, up = Rig(gas_pressure=GAS), pytest.approx(-0.22506e-3, abs=1e-8)
    case = Case(FILM, mass=MASS, voltage=2.7e3, rig=rig)
    for result in (solve(case, Settings()), modes(case, Settings(), 1),
                   response(case, Settings(), (1.0,))):
        assert result.deflection_m == up
        assert result.warnings[-1] == GAS_SIGN
    still = Pieces(np.array([0.0, 1.0]), np.full(2, 2.7e3))
    moved, _ = respond(TransientCase(FILM, still, mass=MASS, rig=rig), Settings(), 1.0)
    assert (moved.first_m, moved.warnings) == (up, (GAS_SIGN,))
    followed = curve(FILM, [MASS], Settings(), rig, [2.7e3])
    asked = followed.table["asked"] == 1
    assert followed.table["deflection"][asked] == up
    assert followed.warnings == (GAS_SIGN,)
    assert solve(replace(case, rig=Rig()), Settings()).warnings == ()


def test_a_path_begins_at_exactly_the_load_that_was_given() -> None:
    rig = Rig(gas_pressure=GAS)
    for gas in (rig, Rig()):
        assert curve(FILM, [MASS], Settings(), gas).table["voltage"][0] == 0


def test_along_a_pressure_the_gas_lifts_more_or_sucks_more() -> None:
    ends = []
    for pressure in (20.0, -20.0):
        result = path(Case(DRUM, rig=Rig(gravity=1e-9, gas_pressure=pressure)), Settings(),
                      "pressure")
        assert result.stations[0].pressure_Pa == pressure
        limit = next(event for event in result.events if event.what == "pull_in")
        ends.append((limit.value, limit.station.deflection_m))
    (lifted, up), (sucked, down) = ends
    assert lifted > 1e3
    assert up < -20e-3
    assert (sucked, down) == pytest.approx((-lifted, -up), rel=1e-6)


def test_a_balloon_has_the_limits_of_one_that_hangs() -> None:
    """A film without weight is the same upside down."""
    up, down = (limits(Case(DRUM, rig=Rig(gravity=1e-9, gas_pressure=sign * 300.0)), Settings())
                for sign in (1, -1))
    assert up.pull_in is not None
    assert down.pull_in is not None
    assert up.pull_in.voltage_V == pytest.approx(down.pull_in.voltage_V, rel=1e-8)


@pytest.mark.parametrize(("pressure", "words"), [
    *((pressure, "must be from -100 to 100 MPa") for pressure in (1e12, -1e12, float("inf"))),
    (float("nan"), "must be a number")])
def test_a_pressure_that_no_film_bears_is_refused(pressure: float, words: str) -> None:
    with pytest.raises(InputError, match=f"gas_pressure.*{words}"):
        Case(FILM, mass=MASS, rig=Rig(gas_pressure=pressure))
