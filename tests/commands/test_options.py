"""Options that nobody means: one message that names the option, or the file and its key."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.support.specimens import ROUND, SOFT, specimen_toml
from tympan.cli import main
from tympan.fem.rig import GAS_SIGN
from tympan.studies.shipped import FILES as ACTUATORS

OVAL = str(next(iter(ACTUATORS.values())))
SIMULATE = ["lumped", "simulate", OVAL]


@pytest.mark.parametrize(("arguments", "words"), [
    (["solve", OVAL, "--mass", "1 g", "--elapsed", "inf s"], "--elapsed: given 'inf s': must be "),
    (["solve", OVAL, "--mass", "1 g", "--elapsed", "-1 s"],
     "elapsed: given '-1 s': must not be negative"),
    (["solve", OVAL, "--mass", "inf g"], "--mass: given 'inf g': must be finite"),
    (["solve", OVAL, "--mass", "1 g", "--refine", "nan"], "--refine: given nan: must be from 0.5 "),
    (["path", OVAL, "--mass", "1 g", "--along", "mass", "--rig", "fixed.toml"],
     "fixed.toml: guide: given 'fixed': must let the plate move"),
    (["diagnose", "nowhere", "-o", "x", "--seed", "-1"], "--seed: given -1: must be from 0 to "),
    ([*SIMULATE, "--signal", "random", "--seed", "-1"], "--seed: given -1: must be from 0 to "),
    (["lumped", "paper", "-o", "x", "--seed", "-1"], "--seed: given -1: must be from 0 to "),
    (["map", "-o", "x", "--workers", "999999"], "--workers: given 999999: must be from 1 to 1024"),
    (["diagnose", "nowhere", "--workers", "0"], "--workers: given 0: must be from 1 to 1024"),
    (["sweep", "nowhere", "-o", "x", "--workers", "-1"], "--workers: given -1: must be from 1 to "),
    (["material", "fit", "nowhere", "--noise", "1e-300 Pa"], "--noise: given '1e-300 Pa': must be"),
    (["material", "fit", "nowhere", "--noise", "1e300 Pa"], "--noise: given"),
    (["sweep", "nowhere", "-o", "x", "--wait", "-1 s"], "--wait: given '-1 s': must not be neg"),
    ([*SIMULATE, "--paper", "--mass", "1e-12 g"], "1e-12 g: must move at least 1 mg"),
    ([*SIMULATE, "--mass", "1e-12 g"], "too small to tell a force"),
    ([*SIMULATE, "--interval", "1e-300 s"], "--interval: given '1e-300 s': would give more than "),
    (["study", "high.toml"], "high.toml: voltage: given '1e20 V': must be from 0 to 1000 kV"),
])
def test_what_nobody_means_is_one_message(arguments: list[str], words: str, tmp_path, monkeypatch,
                                          capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("fixed.toml").write_text('guide = "fixed"\n')
    Path("oval.toml").write_text(specimen_toml())
    Path("high.toml").write_text('specimens = ["oval.toml"]\nvoltage = "1e20 V"\n')
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith("tympan: ")
    assert words in said
    assert said.count("\n") == 1
    assert {file.name for file in tmp_path.iterdir()} == {"fixed.toml", "oval.toml", "high.toml"}


def test_a_signal_that_takes_too_long_is_one_message(tmp_path, monkeypatch, capsys) -> None:
    """Before, where the samples are too many, or when so much has been computed."""
    (tmp_path / "soft.toml").write_text(specimen_toml("soft", ROUND, SOFT, 2.2360679775))
    volts = np.random.default_rng(1).uniform(0.0, 2.0, 3000)
    for step in (1.0, 1e3):
        rows = "".join(f"{step * row},{kV:.4f}\n" for row, kV in enumerate(volts))
        (tmp_path / "rough.csv").write_text(f"t_s,voltage_kV\n{rows}")
        monkeypatch.setattr("tympan.studies.lumped.simulate._WORK", 100_000)
        assert main(["lumped", "simulate", str(tmp_path / "soft.toml"), "--paper",
                     "--signal", str(tmp_path / "rough.csv"), "--interval", "4 ms"]) == 2
        said = capsys.readouterr().err
        assert ("signal: given '3000 bends in 2999 s': takes too many steps" if step == 1
                else "--interval: given '0.004 s': would give more than 1000000 samples") in said


#: A film without plate.
DRUM = specimen_toml("drum", ROUND, SOFT, 2.0).replace(
    '[plate]\nshape = "circle"\nradius = "1 cm"\n', "")


@pytest.mark.parametrize("arguments", [
    ["alpha", "drum.toml"], ["lumped", "build", "drum.toml", "-o", "out"],
    ["force", "drum.toml", "--to", "1 mm"], ["sense", "drum.toml"],
    ["path", "drum.toml", "--along", "mass"], ["study", "study.toml", "-o", "out"],
    ["export", "drum.toml", "--inp", "--mass", "1 g", "-o", "out"]])
def test_what_needs_a_plate_says_so(arguments: list[str], tmp_path: Path, monkeypatch,
                                    capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drum.toml").write_text(DRUM)
    Path("study.toml").write_text('name = "drums"\nspecimens = ["drum.toml"]\n')
    assert main(arguments) == 2
    message = capsys.readouterr().err
    assert "given 'none in drum': is needed here" in message


def test_a_film_without_plate_carries_gas_and_no_mass(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drum.toml").write_text(DRUM)
    assert main(["solve", "drum.toml", "--pressure", "0.02 kPa", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    # p a²/(4 σ t) of a flat film, which hardly moves; 1 mm of virgin film is stretched by 2.
    tension = 15e3 * (2.0**2 - 2.0**-4) * 1e-3 / 4
    assert record["deflection_m"] == pytest.approx(-20 * 45e-3**2 / (4 * tension), rel=5e-3)
    assert record["pressure_Pa"] == 20
    assert record["warnings"] == [GAS_SIGN]
    assert record["mass_kg"] == 0
    assert main(["solve", "drum.toml", "--mass", "1 g"]) == 2
    assert "--mass: given '0.001 kg': must be 0" in capsys.readouterr().err
    assert main(["solve", "drum.toml", "--pressure", "1 mm"]) == 2
    assert "--pressure: given '1 mm'" in capsys.readouterr().err
    assert main(["solve", "drum.toml", "--pressure", "1 TPa"]) == 2
    assert capsys.readouterr().err == (
        "tympan: --pressure: given '1 TPa': must be from -100 to 100 MPa\n")
    assert main(["solve", OVAL]) == 2
    assert '--mass: must be given, such as "17.9 g"' in capsys.readouterr().err
