"""Equilibria at many voltages: those found between two others are what each is by itself."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.support.models import model
from tests.support.specimens import circular, elliptical
from tympan.fem.equilibrium import tangent
from tympan.fem.equilibrium.path_following import PathSettings
from tympan.fem.equilibrium.ramp import LoadRamp
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.equilibrium.span import GivenLoad, Span
from tympan.fem.equilibrium.voltage_path import leapt, voltage_path
from tympan.fem.film.laws import NeoHooke, Ogden
from tympan.fem.membrane.model import Model
from tympan.fem.rig import Rig
from tympan.studies.case import solve_grid

FORCE = 0.1755

FILMS = {"taut": circular(NeoHooke(20e3)), "ellipse": elliptical(75e-3),
         "pulls in": circular(Ogden((15e3,), (2.0,))),
         "wrinkles": circular(NeoHooke(20e3), prestretch=(1.2, 2.5)),
         "slack when mounted": circular(NeoHooke(20e3), prestretch=(0.9, 0.9))}


@cache
def meshed(name: str) -> Model:
    """A film; from a slack one each equilibrium takes long, so its elements are of low order."""
    return model(FILMS[name], refine=0.7, order=2 if name == "slack when mounted" else 4)


@cache
def alone(name: str, voltage: float) -> float | None:
    """Deflection at a voltage, found by itself; None where there is no equilibrium."""
    film = meshed(name)
    outcome = equilibrium(film, FORCE, voltage)
    return film.deflection(outcome.state) if outcome.status == "equilibrium" else None


@pytest.mark.parametrize("name", FILMS)
@pytest.mark.parametrize("count", [4, 13])
def test_each_is_what_it_is_by_itself(name: str, count: int) -> None:
    film = meshed(name)
    voltages = np.linspace(0, 7.5e3, count).tolist()
    ended = False
    for voltage, outcome in zip(voltages, voltage_path(film, FORCE, voltages), strict=True):
        expected = None if ended else alone(name, voltage)
        if expected is None:
            ended = True
            assert outcome.status != "equilibrium"
        else:
            assert outcome.status == "equilibrium"
            assert film.deflection(outcome.state) == pytest.approx(expected, rel=3e-7)
            assert film.unbalanced(outcome.state) < 1e-7


def test_most_voltages_need_no_tangent_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    film = model(FILMS["taut"], refine=0.7)
    first = equilibrium(film, FORCE, 0.0).solution
    made = []
    factorise = tangent._factorise
    monkeypatch.setattr(tangent, "_factorise",
                        lambda *parts: made.append(None) or factorise(*parts))
    outcomes = list(voltage_path(film, FORCE, np.linspace(0, 4e3, 25).tolist(), start=first))
    assert [outcome.status for outcome in outcomes] == ["equilibrium"] * 25
    assert len(made) <= 12


def test_nothing_is_found_between_where_a_step_is_too_long() -> None:
    film = model(FILMS["pulls in"], refine=0.7)
    start = equilibrium(film, FORCE, 0.0).solution
    assert leapt(film, start, [5e3, 9e3]) == []
    end = LoadRamp(film, "voltage", 3e3**2).natural(start)
    assert end is not None
    span = Span(film, start, end, GivenLoad("voltage"))
    assert span.at(2e3**2) is not None
    assert span.at(3.1e3**2) is None
    assert span.at(0.0) is None


def test_voltages_may_be_repeated_and_fall() -> None:
    film = model(FILMS["pulls in"], refine=0.7)
    voltages = [0.0, 2e3, 2e3, 4e3, 3e3, 1e3, 0.0, 9e3, 9.5e3, 1e3, 2e3]
    outcomes = list(voltage_path(film, FORCE, voltages))
    deflection = {voltage: film.deflection(equilibrium(film, FORCE, voltage).state)
                  for voltage in set(voltages) if voltage < 9e3}
    for voltage, outcome in zip(voltages, outcomes, strict=True):
        assert outcome.status == ("equilibrium" if voltage < 9e3 else "no_equilibrium")
        if voltage < 9e3:
            assert film.deflection(outcome.state) == pytest.approx(deflection[voltage], rel=3e-7)


@pytest.mark.parametrize("name", ["taut", "slack when mounted"])
def test_a_grid_does_not_depend_on_which_mass_is_first(name: str) -> None:
    """Another mass is put on at no voltage, and the film charged after that."""
    film, masses, voltages = model(FILMS[name], refine=0.7), (10e-3, 30e-3), (0.0, 2e3, 4e3)
    deflections = {}
    for order in (masses, masses[::-1]):
        for result, _ in solve_grid(film, order, voltages, Rig(), PathSettings()):
            key = result.mass_kg, result.voltage_V
            expected = deflections.setdefault(key, result.deflection_m)
            assert result.deflection_m == pytest.approx(expected, rel=3e-7)
    assert len(deflections) == len(masses) * len(voltages)
