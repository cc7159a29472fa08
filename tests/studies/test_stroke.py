"""Stroke in every output: deflection under voltage less that without, under the same mass."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import tympan
from tests.support.specimens import circular
from tympan.cli import main
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.mesher import MeshSettings

COARSE = tympan.Settings(MeshSettings(order=2).refined(0.6))
FILM = circular()
MASS = 17.9e-3


@pytest.fixture(scope="module")
def rest() -> float:
    """Deflection without voltage [m]."""
    return float(tympan.solve(FILM, settings=COARSE, mass=MASS).deflection_m)


def test_limits_have_the_stroke_of_the_curve_and_of_a_film_solved_there(rest: float) -> None:
    found = tympan.limits(FILM, settings=COARSE, mass=MASS)
    followed, = tympan.curve(FILM, mass=MASS, settings=COARSE).curves
    assert found.stroke_m == found.json()["stroke_m"]
    assert followed.stroke_m == pytest.approx(found.stroke_m, rel=1e-7)  # by shorter steps
    first = tympan.solve(FILM, settings=COARSE, mass=MASS,
                         voltage=found.limits.limit.voltage_V * (1 - 1e-9))
    assert found.stroke_m == pytest.approx(first.deflection_m - rest, rel=1e-3)


@pytest.mark.parametrize("begins", [0.0, 2e3])
def test_a_path_has_it_at_every_station(rest: float, begins: float) -> None:
    found = tympan.path(FILM, settings=COARSE, mass=MASS, voltage=begins)
    assert len(found.stations) > 5
    for station in (*found.stations, *(event.station for event in found.events)):
        assert station.stroke_m == pytest.approx(station.deflection_m - rest, abs=1e-9)
    assert (found.stations[0].stroke_m == 0) == (begins == 0)
    assert found.to_pandas()["stroke_m"].iloc[-1] == found.stations[-1].stroke_m


@pytest.mark.parametrize("along", ["mass", "pressure"])
def test_where_the_mass_or_pressure_grows_there_is_none(along: str) -> None:
    found = tympan.path(FILM, settings=COARSE, mass=MASS, along=along)
    assert {station.stroke_m for station in found.stations} == {None}


def test_in_time_it_is_that_of_the_largest_deflection(rest: float) -> None:
    def ran(**given: object) -> float | None:
        [response] = tympan.transient(FILM, mass=MASS, settings=COARSE, **given).responses
        stroke: float | None = response.stroke_m
        return stroke

    solved = tympan.solve(FILM, settings=COARSE, mass=MASS, voltage=3e3)
    for given in ({"signal": "step"}, {"signal": "ramp", "low": 1e3, "duration": 2.0}):
        assert ran(high=3e3, **given) == pytest.approx(solved.deflection_m - rest, rel=1e-5)
    assert ran(signal="step", high=0.0) is None
    assert ran(signal="step", high=3e3, rest=0.0) is None


def test_commands_say_it_in_the_same_words(tmp_path: Path, capsys: pytest.CaptureFixture[str]
                                           ) -> None:
    file = tmp_path / "film.toml"
    file.write_text(specimen_to_toml(FILM), encoding="utf-8")
    given = [str(file), "--mass", "17.9 g", "--refine", "0.5"]

    def said(*words: str) -> str:
        assert main([*words]) == 0
        return capsys.readouterr().out

    curve, limits = said("curve", *given), said("limits", *given)
    line, = (line for line in curve.splitlines() if line.startswith("stroke"))
    assert line in limits.splitlines()
    assert line.endswith("mm from 0 kV to the first limit")
    stroke = json.loads(said("limits", *given, "--json"))["stroke_m"]
    assert float(line.split()[1]) == pytest.approx(1e3 * stroke, rel=1e-3)
    assert f"stroke {1e3 * stroke:.4f} mm" in said("path", *given).splitlines()[0]
    moved = said("transient", *given, "--signal", "step", "--high", "3 kV")
    stroke = json.loads(said("transient", *given, "--signal", "step", "--high", "3 kV",
                             "--json"))["responses"][0]["stroke_m"]
    assert f"stroke {1e3 * stroke:.4f} mm from 0 kV to the largest deflection" in moved
