"""Commands about films in time: what they answer, and what they refuse."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import calibrated
from tympan.studies.diagnosis.readings import prepared_readings
from tympan.studies.signals import step
from tympan.studies.transient import TransientCase

FILM = """
name = "round"
[frame]
shape = "circle"
radius = "45 mm"
[plate]
shape = "circle"
radius = "10 mm"
[membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
[membrane.material]
law = "neo_hooke"
mu = "20 kPa"
[[membrane.branch]]
modulus = "1 MPa"
time = "30 s"
"""


@pytest.fixture
def film(tmp_path: Path) -> Path:
    file = tmp_path / "round.toml"
    file.write_text(FILM, encoding="utf-8")
    return file


def answer(capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_film_moves_on_its_way_to_rest(film: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By 1.63 mm in 30 s, as an independent solver has it for this film."""
    loads = "solve", str(film), "--mass", "17.9 g"
    weighed, rested = (answer(capsys, *loads, "--voltage", volts)["deflection_m"]
                       for volts in ("0 V", "7 kV"))
    crept = answer(capsys, *loads, "--voltage", "7 kV", "--after", "30 s")["deflection_m"]
    assert crept - weighed == pytest.approx(1.63e-3, abs=5e-6)
    assert crept < rested


def test_a_film_that_follows_at_once_says_so(film: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    creeping, step = film.read_text(encoding="utf-8"), ("transient", str(film), "--mass", "17.9 g",
                                                        "--duration", "0.1 s")
    words, elastic = "voltage at once; --swing", creeping.partition("[[membrane.branch]]")[0]
    for content, more, said in ((creeping, (), False), (elastic, (), True),
                                (elastic, ("--swing",), False)):
        film.write_text(content, encoding="utf-8")
        response, = answer(capsys, *step, *more)["responses"]
        assert any(words in warning for warning in response["warnings"]) == said


def test_a_plate_that_swings_through_a_breakdown_is_warned_of(
        film: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Swinging it deflects, and thins, further than in equilibrium, where it just holds."""
    elastic = FILM.partition("[[membrane.branch]]")[0]
    weak = elastic.replace("[membrane.material]", "breakdown = {law = \"constant\", strength = "
                           "\"STRENGTH\"}\n[membrane.material]")
    loads = str(film), "--mass", "17.9 g"
    film.write_text(weak.replace("STRENGTH", "1000 MV/m"), encoding="utf-8")
    rested = answer(capsys, "solve", *loads, "--voltage", "5 kV")["max_field_V_per_m"]
    step = "transient", *loads, "--high", "5 kV", "--duration", "0.2 s", "--swing"
    for strength, broken in ((1000.0, False), (1e-6 * rested, True)):
        film.write_text(weak.replace("STRENGTH", f"{strength:.6g} MV/m"), encoding="utf-8")
        response, = answer(capsys, *step)["responses"]
        assert any("where it deflects most, breakdown" in words
                   for words in response["warnings"]) == broken


def test_pull_in_is_a_result_with_its_time(film: Path, tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    record = answer(capsys, "transient", str(film), "--signal", "ramp", "--high", "16 kV",
                    "--duration", "60 s", "--interval", "0.1 s", "-o", str(tmp_path / "out"))
    response, = record["responses"]
    assert response["status"] in ("pull_in", "thinning")
    assert 0 < response["stopped_s"] < 30
    assert (tmp_path / "out" / "response.png").exists()


@pytest.mark.parametrize(("mounted", "options", "begin"), [
    ("", ["--high", "4 kV"], [0.0, 4e3]),
    ("", ["--low", "2 kV", "--high", "4 kV"], [2e3, 4e3]),
    ("", ["--signal", "ramp", "--high", "4 kV"], [0.0]),
    ('mounted = "1 hour"\n', ["--high", "4 kV", "--rest", "20 s"], [0.0, 4e3]),
    ('mounted = "1 hour"\n', ["--high", "4 kV"], [4e3]),
])
def test_a_motion_that_is_written_is_read_as_what_it_was(
        mounted: str, options: list[str], begin: list[float], film: Path, tmp_path: Path,
        capsys: pytest.CaptureFixture[str]) -> None:
    """The film predicts the rows: by other elements and steps, to half a hundredth of its way."""
    film.write_text(FILM.replace("thickness", f"{mounted}thickness"), encoding="utf-8")
    answer(capsys, "transient", str(film), "--mass", "17.9 g", "--duration", "30 s",
           "--interval", "0.6 s", *options, "-o", str(tmp_path / "out"))
    dataset = replace(read_dataset(tmp_path / "out"), noise=1e-6)
    assert dataset.transients is not None
    assert dataset.transients.voltage[: len(begin)].tolist() == begin
    readings = prepared_readings(dataset)
    simulation = calibrated(readings.setup, readings.table).simulation
    values = readings.table.value
    predicted = simulation.predict((), np.zeros(2), readings.table)
    assert np.abs(predicted - values).max() < 5e-3 * np.ptp(values)


def test_what_a_rig_has_at_rest_alone_is_said_to_be_left_out(
        film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text('friction = "1 mN"\nlag_voltage = "50 V"\n', encoding="utf-8")
    loads = str(film), "--mass", "17.9 g", "--rig", str(rig)
    moved, = answer(capsys, "transient", *loads, "--signal", "step", "--duration", "1 s",
                    "--interval", "0.1 s")["responses"]
    crept = answer(capsys, "solve", *loads, "--voltage", "3 kV", "--after", "1 s")
    for warnings in (moved["warnings"], crept["warnings"]):
        assert ["friction" in line for line in warnings] == [True, False]
        assert ["lag_voltage" in line for line in warnings] == [False, True]
    rig.write_text('plate_damping = "1 N s/m"\n', encoding="utf-8")
    assert not answer(capsys, "solve", *loads, "--voltage", "3 kV", "--after", "1 s")["warnings"]


@pytest.mark.parametrize("key", ["unaccounted_mass", "added_mass"])
def test_a_plate_swings_with_whatever_mass_it_has(film: Path, key: str) -> None:
    """The nominal mass may be 0 if the rig brings one."""
    specimen, signal = load_specimen(film), step(0.0, 1e3, 0.0, 1.0)
    assert TransientCase(specimen, signal, mass=0.0, rig=Rig(**{key: 1e-3}), inertia=True).mass == 0
    with pytest.raises(InputError, match="positive where the plate swings"):
        TransientCase(specimen, signal, mass=0.0, inertia=True)


def test_a_mass_that_is_not_given_is_the_one_that_other_commands_take(
        film: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ten times as heavy on a film ten times as stiff."""
    masses = []
    for modulus in ("20 kPa", "200 kPa"):
        film.write_text(FILM.replace("20 kPa", modulus).partition("[[")[0], encoding="utf-8")
        brief = ["--signal", "step", "--duration", "1 s", "--interval", "0.1 s"]
        moved, = answer(capsys, "transient", str(film), *brief)["responses"]
        simulated, = answer(capsys, "lumped", "simulate", str(film), *brief)["responses"]
        assert moved["mass_kg"] == simulated["mass_kg"]
        masses.append(moved["mass_kg"])
    assert masses[1] == pytest.approx(10 * masses[0], rel=0.05)


@pytest.mark.parametrize(("words", "key"), [
    (["solve", "--voltage", "1 kV", "--after", "-1 s"], "--after"),
    (["transient", "--interval", "0 s"], "--interval"),
    (["transient", "--duration", "-1 s"], "--duration"),
    (["transient", "--duration", "1e9 s"], "--duration: given '1e9 s': must be positive, below"),
    (["transient", "--rest", "-1 s"], "rest"),
    (["response"], "--voltage"),
    (["response", "--voltage", "1 kV", "--frequency", "0 Hz"], "--frequency"),
])
def test_what_cannot_be_is_refused(words: list[str], key: str, film: Path,
                                   capsys: pytest.CaptureFixture[str]) -> None:
    command, *options = words
    assert main([command, str(film), "--mass", "17.9 g", *options]) == 2
    message, = capsys.readouterr().err.strip().splitlines()
    assert key in message


@pytest.mark.parametrize(("old", "new", "key"), [
    ('time = "30 s"', 'time = "0 s"', "time"),
    ('modulus = "1 MPa"', 'modulus = "-1 MPa"', "modulus"),
    ("thickness", 'mounted = "-1 s"\nthickness', "mounted")])
def test_a_branch_that_cannot_be_is_refused(old: str, new: str, key: str, film: Path,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    film.write_text(FILM.replace(old, new), encoding="utf-8")
    assert main(["solve", str(film), "--mass", "17.9 g"]) == 2
    message, = capsys.readouterr().err.strip().splitlines()
    assert str(film) in message
    assert key in message


def test_transient_csv_has_the_film_s_voltage_and_current(
        film: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Through a resistance by Ohm's law; without one what the charge at rest makes of a ramp."""
    rig = tmp_path / "rig.toml"
    rig.write_text('series_resistance = "100 MOhm"\n', encoding="utf-8")
    begin = ("transient", str(film), "--mass", "17.9 g", "-o", str(tmp_path / "out"))
    record = answer(capsys, *begin, "--signal", "step", "--high", "3 kV", "--duration", "3 s",
                    "--interval", "10 ms", "--rig", str(rig))["responses"][0]
    rows = np.genfromtxt(tmp_path / "out" / "transient.csv", delimiter=",", names=True,
                         encoding="utf-8", dtype=None)
    assert (rows["film_voltage_kV"][0], rows["current_uA"][0]) == (0, 0)  # at rest before the step
    after = rows[1:]
    ohm = (3.0 - after["film_voltage_kV"]) / 100e6 * 1e9
    assert after["current_uA"] == pytest.approx(ohm, abs=1e-3 * ohm.max())
    assert record["highest_current_A"] == pytest.approx(3e3 / 100e6, rel=1e-9)
    assert record["highest_film_voltage_V"] == pytest.approx(3e3, rel=1e-4)
    again = read_dataset(tmp_path / "out").transients
    assert again is not None
    assert again["current"] == pytest.approx(rows["current_uA"] * 1e-6, rel=1e-9)
    answer(capsys, *begin, "--signal", "ramp", "--high", "3 kV", "--duration", "2000 s",
           "--interval", "1 s")
    rows = np.genfromtxt(tmp_path / "out" / "transient.csv", delimiter=",", names=True,
                         encoding="utf-8", dtype=None)
    rising = rows[rows["t_s"] < 1000]
    charge = np.trapezoid(np.append(rising["current_uA"], rising["current_uA"][-1]),
                          np.append(rising["t_s"], 1000.0))
    at_top = answer(capsys, "solve", str(film), "--mass", "17.9 g", "--voltage", "3 kV")
    assert charge == pytest.approx(3e3 * at_top["capacitance_F"] * 1e6, rel=2e-3)
    assert rows["current_uA"][-1] < 0
    assert rows["film_voltage_kV"] == pytest.approx(rows["voltage_kV"], abs=1e-9)
