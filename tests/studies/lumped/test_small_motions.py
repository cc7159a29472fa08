"""The lumped model of a specimen as commands take it: at rest as the field model, linearised, with
its constants' origin."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.checks.json_schema import printed_record
from tests.support.lumped import MODELS
from tests.support.specimens import specimen_toml
from tympan.cli import main
from tympan.paper.table1 import paper_actuators
from tympan.studies.lumped.actuator import Actuator, Viscous
from tympan.studies.lumped.equilibria import pull_in, rest, roots
from tympan.studies.lumped.linear import linearise
from tympan.studies.lumped.simulate import simulate
from tympan.studies.signals import step

COARSE = ("--mass", "17.9 g", "--refine", "0.5")
MEMBRANE = MODELS["membrane circles"]


@pytest.fixture
def oval(tmp_path: Path) -> str:
    file = tmp_path / "oval.toml"
    file.write_text(specimen_toml())
    return str(file)


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, Any]:
    capsys.readouterr()
    assert main([*arguments, "--json"]) == 0
    return printed_record(capsys.readouterr().out)


def test_simulate_begins_where_solve_is_at_rest(oval: str, capsys) -> None:
    """Without a voltage and at 3 kV; the second time from what was kept, to the last bit."""
    for volts in ("0 kV", "3 kV"):
        field = printed(capsys, "solve", oval, "--voltage", volts, *COARSE)["deflection_m"]
        first, again = (printed(capsys, "lumped", "simulate", oval, "--low", volts, "--high",
                                "3 kV", "--duration", "0.1 s", *COARSE)["responses"][0]
                        for _ in range(2))
        assert first["first_m"] == pytest.approx(field, rel=2e-4)
        assert first == again
        cone = printed(capsys, "lumped", "simulate", oval, "--low", volts, "--high", "3 kV",
                       "--duration", "0.1 s", "--paper", "--mass", "17.9 g")["responses"][0]
        assert cone["first_m"] > 1.5 * field


def test_the_range_of_a_sine_is_that_of_its_whole_run(oval: str, tmp_path: Path, capsys) -> None:
    run = printed(capsys, "lumped", "simulate", oval, "--paper", "--signal", "sine", "--duration",
                  "1 s", "--interval", "1 ms", "-o", str(tmp_path / "out"))["responses"][0]
    y = 1e-3 * np.genfromtxt(tmp_path / "out" / "transient.csv", delimiter=",", names=True,
                             usecols=5, encoding="utf-8")["displacement_mm"]
    assert run["lowest_m"] == pytest.approx(y.min(), rel=1e-6)
    assert run["highest_m"] == pytest.approx(y.max(), rel=1e-6)
    assert run["range_m"] == run["highest_m"] - run["lowest_m"] > 10 * abs(y[-1] - y[0])
    coarse = printed(capsys, "lumped", "simulate", oval, "--paper", "--signal", "sine",
                     "--duration", "1 s", "--interval", "0.3 s")["responses"][0]
    assert coarse["range_m"] == pytest.approx(run["range_m"], rel=1e-9)


@pytest.mark.parametrize("name", ["paper", "tape", "membrane circles"])
def test_gain_is_the_slope_of_the_rests(name: str) -> None:
    """By voltage and by its square, whose gain is there at 0 kV too."""
    actuator, wide = MODELS[name], 5.0
    by_voltage = (rest(actuator, 3e3 + wide) - rest(actuator, 3e3 - wide)) / (2 * wide)
    assert linearise(actuator, 3e3).gain == pytest.approx(by_voltage, rel=1e-5)
    for volts in (0.0, 3e3):
        square = (rest(actuator, np.sqrt(volts**2 + 2e4)) - rest(actuator, volts)) / 2e4
        assert linearise(actuator, volts, by="U2").gain == pytest.approx(square, rel=5e-3)
    assert linearise(actuator, 0.0).gain == 0
    assert not linearise(actuator, 0.0).b.any()


def test_poles_are_named_by_what_moves() -> None:
    linear = linearise(MEMBRANE, 3e3)
    names = [pole.name for pole in linear.named_poles]
    assert names == ["creep", "creep between circles", "oscillation"]
    creep, between, oscillation = linear.named_poles
    viscous = MEMBRANE.viscous
    assert between.value == pytest.approx(-viscous.k1 / viscous.eta1, rel=1e-9)
    assert between.share == pytest.approx(0.0, abs=1e-12)
    assert (creep.share or 0) + (oscillation.share or 0) == pytest.approx(1.0, rel=1e-9)
    assert oscillation.frequency > linear.film_frequency
    thick = replace(MEMBRANE, viscous=Viscous(viscous.k1, viscous.eta1, 1e7))
    assert [pole.name for pole in linearise(thick, 3e3).named_poles].count("overdamped plate") == 2
    soft = Actuator.of(paper_actuators(8.5)[0], 17.9e-3)
    volts = 0.995 * (pull_in(soft) or (np.nan,))[0]
    unstable = float(roots(soft, volts)[0][1])
    assert "pull-in" in [pole.name for pole in linearise(soft, volts, unstable).named_poles]
    elastic = replace(MEMBRANE, viscous=Viscous(0.0, 1.0, 0.0))
    idle = linearise(elastic, 3e3)
    assert idle.named_poles[-1].frequency == pytest.approx(idle.film_frequency, rel=1e-9)
    assert idle.named_poles[0].time is None


def test_shares_of_the_gain_are_what_a_small_step_does() -> None:
    """Creep's share is what is left to go when the oscillation is over, by the motion itself."""
    linear, volts = linearise(MEMBRANE, 3e3), 1.0
    creep, _, oscillation = linear.named_poles
    late = 12 / abs(oscillation.value.real)
    moved = simulate(MEMBRANE, step(3e3, 3e3 + volts, 0.0, late), precision=1e-13)
    end = float(moved.deflection(np.array([late]))[0]) - linear.deflection
    to_go = (creep.share or 0) * np.exp(creep.value.real * late)
    assert end / (linear.gain * volts) == pytest.approx(1 - to_go, abs=1e-3)


def test_linearise_command_says_what_it_is_about(oval: str, capsys) -> None:
    (linear,) = printed(capsys, "lumped", "linearise", oval, "--voltage", "3 kV", *COARSE)["linear"]
    assert linear["input"] == "U"
    assert linear["gain_m_per_V"] > 0
    assert any("Table 1" in words for words in linear["warnings"])
    assert main(["lumped", "linearise", oval, "--voltage", "0 kV", *COARSE]) == 0
    words = capsys.readouterr().out
    assert "--input U2" in words
    assert "oscillation" in words
    (squared,) = printed(capsys, "lumped", "linearise", oval, "--voltage", "0 kV", "--input", "U2",
                         *COARSE)["linear"]
    assert squared["gain_m_per_V2"] > 0
    assert not any("--input" in words for words in squared["warnings"])


def test_constants_of_ones_own_are_not_called_borrowed(oval: str, tmp_path: Path, capsys) -> None:
    said = {}
    for name, viscous in (("paper", []), ("own", ["--viscous", "20 MPa,100 MPa s,50 kPa s"])):
        out = tmp_path / name
        assert main(["lumped", "build", oval, "--mass", "17.9 g", "--voltage", "0 kV..3 kV",
                     "--count", "3", "--refine", "0.5", *viscous, "-o", str(out)]) == 0
        run = printed(capsys, "lumped", "simulate", "--model", str(out / "oval.lumped.toml"),
                      "--mass", "17.9 g", "--high", "2 kV", "--duration", "0.1 s")
        said[name] = " ".join(run["responses"][0]["warnings"])
    assert "Table 1" in said["paper"]
    assert said["own"] == ""


@pytest.mark.parametrize("options", [["--alpha", "0.5,0.5"], ["--table-1", "9"]])
def test_what_the_cones_alone_need_is_refused_without_them(options: list[str], oval: str,
                                                           capsys) -> None:
    assert main(["lumped", "simulate", oval, *options, *COARSE]) == 2
    assert "--paper" in capsys.readouterr().err


def test_a_damper_and_an_added_mass_at_the_plate_count() -> None:
    """The damper takes c ẏ; the added mass moves and weighs nothing; none of them at rest."""
    state = MEMBRANE.rest(2e-3, 2e3)
    state[1] = 0.02
    rig = MEMBRANE.rig
    heavier = replace(MEMBRANE, rig=replace(rig, plate_damping=3.0, added_mass=5e-3))
    before = float(MEMBRANE.linear(state, 2e3)[0][1]) * MEMBRANE.moved
    after = float(heavier.linear(state, 2e3)[0][1]) * (MEMBRANE.moved + 5e-3)
    assert before - after == pytest.approx(3.0 * 0.02, rel=1e-9)
    assert rest(heavier, 2e3) == rest(MEMBRANE, 2e3)
