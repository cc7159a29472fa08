"""Loops of a film whose voltage rises and falls at a rate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.creeping import film
from tympan.cli import main
from tympan.fem.transient.integrate import StepSettings
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.studies.case import Case, Settings, solve
from tympan.studies.reduced_film.sampling import extremes
from tympan.studies.signals import Sine
from tympan.studies.transient import TransientCase, loop, respond

MASS, TURN, TIME = 17.9e-3, 5e3, 10.0


CREEPS = film(ViscousBranch(200e3, TIME))


def width(specimen: Specimen, duration: float) -> float:
    """Of the loop at half the voltage, over the stroke; ``duration`` [s] of one way."""
    result = loop(Case(specimen, mass=MASS), TURN / duration, TURN, Settings())
    samples = result.responses[0].samples
    voltage, deflection = samples["voltage"].to_numpy(), samples["displacement"].to_numpy()
    top = int(np.argmax(voltage))
    up = np.interp(TURN / 2, voltage[: top + 1], deflection[: top + 1])
    down = np.interp(TURN / 2, voltage[top:][::-1], deflection[top:][::-1])
    return float((down - up) / np.ptp(deflection))


def test_a_loop_is_wide_where_its_rate_meets_the_branch() -> None:
    slow, near, fast = (width(CREEPS, share * TIME) for share in (300.0, 1.0, 3e-3))
    assert near > 0.01
    assert 0 < slow < 0.05 * near
    assert 0 < fast < 0.02 * near


def test_a_film_without_branches_comes_back_the_way_it_went() -> None:
    assert abs(width(film(), TIME)) < 2e-5


def test_a_slow_loop_turns_at_the_equilibrium() -> None:
    case = Case(CREEPS, mass=MASS)
    response, = loop(case, TURN / (3e3 * TIME), TURN, Settings()).responses
    rest = solve(replace(case, voltage=TURN), Settings()).deflection_m
    assert response.samples["displacement"].max() == pytest.approx(rest, rel=1e-4)


@pytest.mark.parametrize("words", [["--to", "3 kV"], ["--rate", "0 V/s"],
                                   ["--rate", "1 V/s", "--voltage", "4 kV", "--to", "3 kV"]])
def test_a_loop_that_cannot_be_is_refused(words: list[str], tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    from tympan.fem.toml_writer import specimen_to_toml

    file = tmp_path / "film.toml"
    file.write_text(specimen_to_toml(CREEPS), encoding="utf-8")
    assert main(["path", str(file), "--mass", "17.9 g", *words]) == 2
    assert "--to" in capsys.readouterr().err


def test_the_highest_deflection_is_the_motions_not_that_of_a_step() -> None:
    """By usual steps and by far finer ones; of the states that were solved for none is as near."""
    peaks, solved = [], []
    for error in (1e-5, 1e-7):
        case = TransientCase(CREEPS, Sine(2e3, 2e3, TIME, 1.0), mass=MASS,
                             steps=StepSettings(error=error))
        response, done = respond(case, Settings(), 0.1)
        numbers = response.numbers
        peaks.append((numbers["highest_s"], numbers["highest_m"]))
        solved.append(done.deflection.max())
        assert numbers["range_m"] == numbers["highest_m"] - numbers["lowest_m"]
        assert numbers["lowest_m"] <= done.deflection.min()
    usual, fine = np.array(peaks)
    assert usual[0] == pytest.approx(fine[0], abs=2e-3)
    assert usual[1] == pytest.approx(fine[1], rel=1e-5)
    assert solved[0] < fine[1] * (1 - 3e-5)


def test_extremes_between_times_and_at_jumps() -> None:
    time = np.array([0.0, 0.8, 1.7, 3.0, 3.0, 4.0, 4.0, 5.0])
    values = np.array([(moment - 1.2) * (moment - 3.1) for moment in time[:4]] + [0, -7, 2, 2])
    (low_s, low), (high_s, high) = extremes(time, values)
    assert (low_s, low) == (4.0, -7.0)
    assert (high_s, high) == pytest.approx((0.0, 3.72))
    assert extremes(time[:4], values[:4])[0] == pytest.approx((2.15, -(0.95**2)))
    assert extremes(time, 0 * time) == ((0.0, 0.0), (0.0, 0.0))


def test_the_turn_must_be_known() -> None:
    with pytest.raises(InputError, match="above where it begins"):
        loop(Case(CREEPS, mass=MASS, voltage=TURN), 10.0, TURN / 2, Settings())
