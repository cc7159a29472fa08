"""Loops of a film whose voltage rises and falls at a rate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tests.support.creeping import film
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.transient.integrate import StepSettings
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Specimen, ViscousBranch
from tympan.studies.case import Case, Settings, solve
from tympan.studies.limits.voltages import first_limit
from tympan.studies.motion import Trace
from tympan.studies.signals import Pieces, Sine, ramp
from tympan.studies.transient import TransientCase, history, loop, respond

MASS, TURN, TIME = 17.9e-3, 5e3, 10.0


CREEPS = film(ViscousBranch(200e3, TIME))
COARSE = Settings(MeshSettings(order=2).refined(0.5))


def width(specimen: Specimen, duration: float) -> float:
    """Of the loop at half the voltage, over the stroke; ``duration`` [s] of one way."""
    result = loop(Case(specimen, mass=MASS), TURN / duration, TURN, COARSE)
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


@pytest.mark.parametrize(("duration", "most"), [(20.0, 1e-3), (6e-2, 1e-2)])
def test_a_loop_s_area_is_that_of_far_shorter_steps_within_its_error(duration: float, most: float
                                                                      ) -> None:
    """Of a wide loop and of one that is a twentieth of a thousandth of its box."""
    case = Case(CREEPS, mass=MASS)
    looped, = loop(case, 2 * TURN / duration, TURN, Settings()).responses
    area, error = looped.hysteresis_area_V_m, looped.hysteresis_area_error_V_m
    done = history(TransientCase(CREEPS, ramp(0.0, TURN, duration), mass=MASS,
                                 steps=StepSettings(error=1e-8)), Settings())
    rising = np.flatnonzero(np.diff(done.time) == 0).item()
    up, down = (CubicSpline(done.time[part], done.deflection[part])
                for part in (slice(0, rising + 1), slice(rising + 1, None)))
    rate = 2 * TURN / duration
    exact = rate * (down.integrate(duration / 2, duration) - up.integrate(0.0, duration / 2))
    assert 0 < error < most * area
    assert area == pytest.approx(exact, abs=error)


def test_a_film_without_branches_encloses_nothing_within_the_error() -> None:
    looped, = loop(Case(film(), mass=MASS), TURN, TURN, Settings()).responses
    box = TURN * looped.range_m
    assert abs(looped.hysteresis_area_V_m) < 1e-6 * box
    assert looped.hysteresis_area_error_V_m < 1e-6 * box


def test_the_area_counts_jumps_and_sines_exactly() -> None:
    """∮ y du of a square and of an ellipse, y = sin(t − φ) on u = sin t: π sin φ."""
    corners = np.array([0.0, 1.0, 1.0, 2.0])
    square = Pieces(corners, np.array([0.0, 0.0, 3.0, 3.0]))
    time = np.array([0.0, 0.3, 1.0, 1.0, 1.5, 2.0])
    _, area = Trace(time).last_loop(square, 2.0, np.array([1.0, 2.0, 2.0, 4.0, 4.0, 1.0]))
    # At the jump of u from 0 to 3 the mean of y is 3: −∮ y du without the way back, at y = 1.
    assert area == pytest.approx(-9.0)
    period, lag = 2 * np.pi, 0.3
    time = np.linspace(0, period, 400)
    _, area = Trace(time).last_loop(Sine(0.0, 1.0, period, 1.0), period, np.sin(time - lag))
    assert area == pytest.approx(np.pi * np.sin(lag), rel=1e-7)


def test_a_slow_loop_turns_at_the_equilibrium() -> None:
    case = Case(CREEPS, mass=MASS)
    response, = loop(case, TURN / (3e3 * TIME), TURN, COARSE).responses
    rest = solve(replace(case, voltage=TURN), COARSE).deflection_m
    assert response.samples["displacement"].max() == pytest.approx(rest, rel=1e-4)


@pytest.mark.parametrize(("wrong", "words"), [
    ("--turn", ["--turn", "3 kV"]), ("--rate", ["--rate", "0 V/s"]),
    ("--turn", ["--rate", "1 V/s", "--voltage", "4 kV", "--turn", "3 kV"])])
def test_a_loop_that_cannot_be_is_refused(wrong: str, words: list[str], tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    from tympan.fem.toml_writer import specimen_to_toml

    file = tmp_path / "film.toml"
    file.write_text(specimen_to_toml(CREEPS), encoding="utf-8")
    assert main(["path", str(file), "--mass", "17.9 g", *words]) == 2
    assert capsys.readouterr().err.startswith(f"tympan: {wrong}: ")


def test_the_highest_deflection_is_the_motions_not_that_of_a_step() -> None:
    """By usual steps and by far finer ones; of the states that were solved for none is as near."""
    peaks, solved = [], []
    for error in (1e-5, 1e-7):
        case = TransientCase(CREEPS, Sine(2e3, 2e3, TIME, 1.0), mass=MASS,
                             steps=StepSettings(error=error))
        response, done = respond(case, Settings(), 0.1)
        peaks.append((response.highest_s, response.highest_m))
        solved.append(done.deflection.max())
        assert response.range_m == response.highest_m - response.lowest_m
        assert response.lowest_m <= done.deflection.min()
    usual, fine = np.array(peaks)
    assert usual[0] == pytest.approx(fine[0], abs=2e-3)
    assert usual[1] == pytest.approx(fine[1], rel=1e-5)
    assert solved[0] < fine[1] * (1 - 3e-5)


def test_extremes_between_times_and_at_jumps() -> None:
    time = np.array([0.0, 0.8, 1.7, 3.0, 3.0, 4.0, 4.0, 5.0])
    values = np.array([(moment - 1.2) * (moment - 3.1) for moment in time[:4]] + [0, -7, 2, 2])
    (low_s, low), (high_s, high) = Trace(time).extremes(values)
    assert (low_s, low) == (4.0, -7.0)
    assert (high_s, high) == pytest.approx((0.0, 3.72))
    assert Trace(time[:4]).extremes(values[:4])[0] == pytest.approx((2.15, -(0.95**2)))
    assert Trace(time).extremes(0 * time) == ((0.0, 0.0), (0.0, 0.0))


def test_the_turn_must_be_known() -> None:
    with pytest.raises(InputError, match="above the voltage where the loop begins, 5 kV"):
        loop(Case(CREEPS, mass=MASS, voltage=TURN), 10.0, TURN / 2, Settings())


def test_a_loop_that_begins_beyond_where_it_would_turn_is_refused_by_what_is_missing() -> None:
    first = first_limit(Case(CREEPS, mass=MASS), Settings())
    assert first is not None
    begin = 0.96 * first.voltage_V
    with pytest.raises(InputError, match="must be given: a loop turns at 95 % of the film's first "
                                         "limit, loss of tension at") as caught:
        loop(Case(CREEPS, mass=MASS, voltage=begin), 10.0, None, Settings())
    assert caught.value.key == "turn"
