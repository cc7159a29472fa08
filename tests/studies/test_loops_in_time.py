"""Loops of a film whose voltage rises and falls at a rate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.creeping import film
from tympan.cli import main
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.studies.case import Case, Settings, solve
from tympan.studies.transient import loop

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


def test_the_turn_must_be_known() -> None:
    with pytest.raises(InputError, match="above where it begins"):
        loop(Case(CREEPS, mass=MASS, voltage=TURN), 10.0, TURN / 2, Settings())
