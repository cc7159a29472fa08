"""The film follows a ramp of the voltage late."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.specimens import circular, elliptical
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.laws import NeoHooke
from tympan.fem.rig import DIRECTIONS, Rig
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Case, Settings, solve
from tympan.studies.effects import EFFECTS, Setup, Use, extended

COARSE = Settings(MeshSettings(order=2).refined(0.7))
NOMINAL = Setup((circular(NeoHooke(20e3)), elliptical(60e-3, NeoHooke(20e3))), Rig())
UP, DISCREPANCY, DOWN = 1.0, 0.0, -1.0


def deflection(lag: float, voltage: float, direction: float, specimen: str = "circle") -> float:
    """Of a specimen with 17.9 g behind the voltage by so much [m]."""
    setup = EFFECTS["hysteresis"].apply(NOMINAL, [lag])
    case = Case(setup.specimen(specimen), mass=17.9e-3, voltage=voltage, rig=setup.rig,
                direction=direction)
    result = solve(case, COARSE)
    assert result.deflection_m is not None
    return result.deflection_m


@pytest.mark.parametrize("specimen", ["circle", "ellipse 0.06"])
@pytest.mark.parametrize("voltage", [1e3, 4.5e3])
def test_a_film_is_behind_the_more_the_larger_its_lag(specimen: str, voltage: float) -> None:
    """Lower on the way up than on the way down, without a lag the same, without a direction in
    between."""
    lags = (0.0, 50.0, 200.0, 600.0)
    up, unknown, down = ([deflection(lag, voltage, way, specimen) for lag in lags]
                         for way in (UP, DISCREPANCY, DOWN))
    assert up[0] == unknown[0] == down[0]
    assert unknown == [unknown[0]] * len(lags)
    assert all(before - after > 1e-7 for before, after in pairwise(up))
    assert all(after - before > 1e-7 for before, after in pairwise(down))


def test_a_lag_is_another_voltage() -> None:
    """Without the lag, at a voltage lower or higher by it; below the lag, at none."""
    plain = {voltage: deflection(0.0, voltage, DISCREPANCY)
             for voltage in (0.0, 150.0, 3850.0, 4150.0)}
    assert deflection(150.0, 4e3, UP) == plain[3850.0]
    assert deflection(150.0, 4e3, DOWN) == plain[4150.0]
    assert deflection(150.0, 100.0, UP) == plain[0.0]
    assert deflection(150.0, 0.0, DOWN) == plain[150.0] > plain[0.0]


def test_the_lag_is_behind_what_the_supply_gives() -> None:
    """Other edits of the voltage change what the lag is taken from, not the lag; lags add up."""
    uses: list[Use] = [("hysteresis", (100.0,), None), ("amplifier_gain", (0.1,), None),
                       ("voltage_sag", (10e3,), None)]
    rig = extended(NOMINAL, uses).rig
    assert rig == extended(NOMINAL, uses[::-1]).rig
    assert rig.film_voltage(5e3, UP) == pytest.approx(1.1 * 5e3 / 1.25 - 100, rel=1e-14)
    assert rig.film_voltage(5e3, DOWN) == pytest.approx(1.1 * 5e3 / 1.25 + 100, rel=1e-14)
    assert EFFECTS["hysteresis"].apply(Setup((), rig), [50.0]).rig.lag_voltage == 150


@given(st.lists(st.tuples(st.floats(0, 1e4), st.sampled_from(sorted(DIRECTIONS.values()))),
                min_size=1),
       st.floats(0, 1e3))
def test_arrays_are_followed_as_numbers_are(readings: list[tuple[float, float]],
                                            lag: float) -> None:
    """And what is followed is a play of that half width about what is supplied."""
    rig = Rig(amplifier_gain=0.05, sag_voltage=9e3, lag_voltage=lag)
    voltages, directions = (np.array(column) for column in zip(*readings, strict=True))
    followed = rig.film_voltage(voltages, directions)
    assert np.array_equal(followed, [rig.film_voltage(*reading) for reading in readings])
    assert np.array_equal(rig.film_voltage(voltages),
                          [rig.film_voltage(voltage) for voltage, _ in readings])
    supplied = rig.film_voltage(voltages)
    assert np.array_equal(followed, np.where(directions > 0, np.maximum(supplied - lag, 0),
                                             np.where(directions < 0, supplied + lag, supplied)))


def test_a_direction_is_up_down_or_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for direction in (2.0, float("nan")):
        with pytest.raises(InputError, match=r"direction.*must be up \(1\), down \(-1\)"):
            Case(NOMINAL.specimens[0], mass=17.9e-3, voltage=3e3, direction=direction)
    films, rig = tmp_path / "film.toml", tmp_path / "rig.toml"
    films.write_text(specimen_to_toml(NOMINAL.specimens[0]), encoding="utf-8")
    rig.write_text('lag_voltage = "0.15 kV"\n', encoding="utf-8")
    command = ["solve", str(films), "--rig", str(rig), "--mass", "17.9 g", "--voltage", "4 kV",
               "--refine", "0.5",
               "--json"]
    deflections = []
    for further in (["--direction", "up"], [], ["--direction", "down"]):
        assert main([*command, *further]) == 0
        deflections.append(json.loads(capsys.readouterr().out)["deflection_m"])
    assert deflections == sorted(set(deflections))
    rig.write_text('lag_voltage = "-1 V"\n', encoding="utf-8")
    assert main(command) == 2
    assert "lag_voltage" in capsys.readouterr().err
