"""The form of SoftPyIdentify: steps are those of transfer functions, errors those it states."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest

from tests.support.lumped import OVAL
from tests.support.specimens import circular
from tympan.base.errors import Failure
from tympan.cli import main
from tympan.fem.film.laws import Gent
from tympan.studies.lumped.actuator import BORROWED
from tympan.studies.lumped.export.slow_fast import SlowFast, slow_fast
from tympan.studies.lumped.model_file import LumpedModel, write_model
from tympan.studies.lumped.simulate import simulate
from tympan.studies.signals import random_steps, step

TWO = LumpedModel(OVAL, (45e-3, 75e-3), (0.6, 0.4), 2e-9, 5e3, 1.03, 0.8)
ONE = LumpedModel(circular(Gent(18e3, 110.0)), (45e-3,), (1.0,), 1.2e-9, 5e3)
MASS = 17.9e-3


def test_a_step_is_that_of_the_transfer_functions() -> None:
    form = SlowFast((0.0, 1.0), 0.2, 0.5, 3.0, 40.0, 0.4, 1.0)
    s = control.tf("s")
    square = form.alpha**2 + form.omega**2
    both = (s + form.z0) / (s + form.s0) * form.k * square / (s**2 + 2 * form.alpha * s + square)
    time = np.linspace(0, 20, 2001)
    assert form.to_unit_step(time)[1:] == pytest.approx(
        control.step_response(both, time).outputs[1:], abs=1e-6)
    assert float(both(0).real) == pytest.approx(1.0, rel=1e-12)


def test_small_steps_of_one_circle_have_exactly_this_form() -> None:
    """Its linear motion has one slow pole, one zero and a pair."""
    form = slow_fast(ONE.actuator(MASS), 300.0)
    assert form.step_error_largest < 2e-3
    assert form.rest_error < 1e-3


def test_the_errors_stated_are_those_on_steps_of_ones_own() -> None:
    actuator = TWO.actuator(MASS)
    form = slow_fast(actuator, 5e3)
    signal = random_steps(0.0, 5e3, 15.0, 6, seed=7)
    time = np.linspace(0.0, signal.end, 4001)[1:]
    missed = form.deflection(signal, time) - simulate(actuator, signal).deflection(time)
    share = np.sqrt(np.mean(missed**2)) / np.ptp(form.at_rest([0.0, 5e3]))
    assert share < 2 * form.step_error_rms
    assert 0.005 < form.step_error_rms < 0.05 < form.step_error_largest < 0.15


def test_a_plate_that_does_not_swing_has_no_such_form() -> None:
    with pytest.raises(Failure, match="no fast pair"):
        slow_fast(LumpedModel(circular(Gent(18e3, 110.0)), (45e-3,), (1.0,), 1.2e-9, 5e3,
                              viscous=replace(BORROWED, eta2=1e7)).actuator(MASS), 5e3)


def test_the_command_writes_the_form(tmp_path: Path,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "one.lumped.toml"
    write_model(file, ONE)
    assert main(["lumped", "export", str(file), "--slow-fast", "--mass", "17.9 g", "-o",
                 str(tmp_path)]) == 0
    written = Path(capsys.readouterr().out.strip())
    content = json.loads(written.read_text())
    form = SlowFast(**{name: content[name] for name in SlowFast.__dataclass_fields__})
    assert form.highest_voltage == 5e3
    end = 8 / form.s0
    response = simulate(ONE.actuator(MASS), step(0.0, 5e3, 0.0, end))
    assert form.deflection(step(0.0, 5e3, 0.0, end), np.array([end]))[0] == pytest.approx(
        response.deflection(np.array([end]))[0], rel=0.01)
    for words in (["--slow-fast"], ["--slow-fast", "--fmu", "--mass", "1 g"], ["--mass", "1 g"]):
        assert main(["lumped", "export", str(file), *words, "-o", str(tmp_path)]) == 2
