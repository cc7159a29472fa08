"""The paper's figures and tables computed again: lost parameters, settling times, the command and
its page."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.checks.json_schema import faults, printed_record, schema_of
from tests.support.checks.policy import unlawful
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.paper import missing_parameters as lost
from tympan.paper import page, published
from tympan.paper.figures import Choices, Decay, period_of, thinned
from tympan.paper.output import loop_gap
from tympan.paper.table1 import paper_actuators
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import pull_in, rest
from tympan.studies.lumped.simulate import simulate, slow_ends
from tympan.studies.signals import random_steps, step
from tympan.studies.trace import settling_time

FIGURES = ("fig7", "fig8", "fig9", "fig10", "fig11", "fig12", "fig13", "fig14", "misfit")


@pytest.fixture(scope="module")
def fitted() -> lost.MissingParameters:
    return lost.fit_rests()


def test_ranges_are_those_of_the_models_own_rests() -> None:
    """Newton from flat against roots on a grid, at loads up to near pull-in; beyond it nothing."""
    for column, mass, voltage, alpha in ((0, 17.9e-3, 9.2e3, 1.0), (1, 22.45e-3, 7e3, 0.3),
                                         (2, 17.9e-3, 3e3, 0.9)):
        actuator = Actuator.of(paper_actuators(8.5)[column], mass, (alpha, 1 - alpha))
        deflection = lost.deflections(8.5, (alpha, alpha), voltage, (mass,))[0, column]
        assert deflection == pytest.approx(rest(actuator, voltage), rel=1e-9)
    limit = (pull_in(Actuator.of(paper_actuators(8.5)[0], 17.9e-3)) or (0.0, 0.0))[0]
    assert limit == pytest.approx(9.21e3, abs=10)
    below, above = (lost.deflections(8.5, (1.0, 1.0), share * limit)[0, 0]
                    for share in (1 - 1e-5, 1 + 1e-5))
    assert np.isfinite(below)
    assert np.isnan(above)


def test_slopes_of_ranges_by_differences() -> None:
    at, step_ = np.array([8.2, 0.4, 0.7]), 1e-5
    slopes = lost.ranges_with_slopes(at)[1]
    for number in range(3):
        move = step_ * np.eye(3)[number]
        ends = [lost.ranges_with_slopes(at + sign * move)[0] for sign in (1, -1)]
        difference = (ends[0] - ends[1]) / (2 * step_)
        assert slopes[:, :, number] == pytest.approx(difference, rel=1e-6, abs=1e-12)


def test_lost_parameters_against_a_grid(fitted: lost.MissingParameters) -> None:
    """No point of a grid does better, in squares or in the worst; the ends of what is within twice
    are on its edge."""
    read = published.ranges()
    permittivity, alpha = np.linspace(7.6, 9.2, 33), np.linspace(0.1, 0.95, 18)
    squares = [np.sum((lost.rest_ranges(e, (a, a)) - read) ** 2) for e in permittivity[::4]
               for a in alpha[::3]]
    assert min(squares) > np.sum(fitted.misfit**2)
    assert np.sum(fitted.misfit**2) > 0.95 * min(squares[0],
                                                 np.sum(lost.fit_rests(shared=False).misfit ** 2))
    best, worst = lost.smallest_worst(), lost.worst_misfit(permittivity, alpha)
    assert best.worst <= np.nanmin(worst) < 1.1 * best.worst
    limits, within = lost.allowed(), worst <= 2 * best.worst
    for name, axis, values in (("relative_permittivity", 1, permittivity), ("alpha_1", 0, alpha)):
        inside, spacing = values[within.any(axis=axis)], values[1] - values[0]
        assert limits[name] == pytest.approx((inside[0], inside[-1]), abs=spacing)
        assert limits[name][0] <= inside[0]
        assert limits[name][1] >= inside[-1]


def test_parameters_come_back_from_ranges_they_made(monkeypatch: pytest.MonkeyPatch) -> None:
    truth = np.array([8.9, 0.3, 0.8])
    made = lost.rest_ranges(truth[0], truth[1:])
    monkeypatch.setattr(lost, "ranges", lambda: made)
    fit = lost.fit_rests(shared=False)
    assert [fit.permittivity, *fit.alpha] == pytest.approx(truth, rel=1e-7)
    assert fit.worst < 1e-12


def test_an_array_is_its_actuators(fitted: lost.MissingParameters) -> None:
    """Forces, rates and derivatives of six at once, those of one by one."""
    array = lost.paper_array(fitted.permittivity, fitted.alpha)
    rng = np.random.default_rng(4)
    state = rng.uniform([1e-3, -0.1, 0, 0], [8e-3, 0.1, 0.02, 0.02], (2, 3, 4))
    rates, slopes = array.linear(state, 3e3)
    for row, mass in enumerate(published.MASSES):
        for column, actuator in enumerate(fitted.actuators(mass)):
            size = 2 + actuator.count
            alone = actuator.linear(state[row, column, :size], 3e3)
            assert rates[row, column, :size] == pytest.approx(alone[0], rel=1e-12)
            assert slopes[row, column, :size, :size] == pytest.approx(alone[1], rel=1e-12)


def test_ends_of_levels_without_inertia_are_those_with_it(fitted: lost.MissingParameters) -> None:
    """Branches alone, by another integrator, against the whole model; while it creeps η₂ holds it
    back by a little."""
    signal = random_steps(0.0, 7e3, 6.0, 3, 4)
    levels = slow_ends(lost.paper_array(fitted.permittivity, fitted.alpha), signal)[:, 1]
    ends = np.array([simulate(actuator, signal).deflection(signal.breaks)
                     for actuator in fitted.actuators(22.45e-3)]).T
    assert levels == pytest.approx(ends, abs=3e-7)
    assert np.ptp(ends, axis=0).min() > 1e-4


def test_parameters_come_back_from_levels_they_made(monkeypatch: pytest.MonkeyPatch) -> None:
    signal, truth = random_steps(0.0, 7e3, 10.0, 3, 6), np.array([[8.7, 0.35]])
    made = lost.level_ranges(signal, truth)[0]
    monkeypatch.setattr(lost, "ranges", lambda: made)
    fit = lost.fit_levels(signal)
    assert [fit.permittivity, fit.alpha[0]] == pytest.approx(truth[0], rel=1e-4)
    assert fit.worst < 1e-7


@pytest.mark.study
def test_table_2_at_the_ends_of_levels() -> None:
    """The ellipses' four ranges within 0.03 mm, the circle's not, and better than at rest, for
    three seeds."""
    for seed in (6, 17, 25):
        fit = lost.fit_levels(random_steps(0.0, 7e3, 30.0, 20, seed))
        assert np.abs(fit.misfit[:, 1:]).max() < 0.03e-3
        assert np.abs(fit.misfit[:, 0]).min() > 0.05e-3
        assert fit.rms < 0.4 * lost.fit_rests().rms


def test_settling_of_a_known_oscillation() -> None:
    """Decay of exp(−t) cos(60 t) on a slow slope fall below a share after its logarithm, whatever
    the sampling."""
    t = np.linspace(0, 8, 8001)
    swings = Decay.of(t, 1e-4 * (0.05 * t + np.exp(-t) * np.cos(60 * t)))
    assert swings.settled(1e-5) - swings.settled(5e-5) == pytest.approx(np.log(5), abs=0.02)
    assert swings.settled(0.05 * swings.height.max()) == pytest.approx(
        settling_time(t, 0.05 * t + np.exp(-t) * np.cos(60 * t)), abs=np.pi / 60)
    assert np.isnan(swings.settled(1.0))


def test_damping_and_settling_agree(fitted: lost.MissingParameters) -> None:
    """Between two thresholds the time is the logarithm of their ratio over the linear model's rate.
    """
    from tympan.studies.lumped.linear import linearise

    actuator = fitted.actuators(22.45e-3)[2]
    time = np.linspace(0.0, 4.0, 4001)
    moved = simulate(actuator, step(0.0, 3.5e3, 0.0, 4.0)).deflection(time)
    swings = Decay.of(time, moved)
    # About where it swings, for the film creeps on for long after.
    rate = -linearise(actuator, 3.5e3, float(moved[1500])).poles[-1].real
    assert swings.settled(3e-6) - swings.settled(3e-5) == pytest.approx(np.log(10) / rate, rel=0.05)


def test_the_period_that_lags_most(fitted: lost.MissingParameters) -> None:
    """Against the phase of the linear model on a grid of slow periods."""
    from tympan.studies.lumped.linear import linearise

    actuator = fitted.actuators(17.9e-3)[0]
    linear, periods = linearise(actuator, 3.5e3), np.geomspace(5, 500, 401)
    phase = [np.angle((linear.c @ np.linalg.solve(2j * np.pi / period * np.eye(3) - linear.a,
                                                  linear.b))[0, 0])
             for period in periods]
    assert period_of(actuator) == pytest.approx(periods[int(np.argmin(phase))], rel=0.02)


def test_gap_of_a_known_loop() -> None:
    phase = 2 * np.pi * np.arange(400) / 400
    assert loop_gap(np.sin(phase)) == pytest.approx(0, abs=1e-12)
    assert loop_gap(np.sin(phase - 0.1)) == pytest.approx(np.sin(0.1), rel=1e-3)


def test_thinning_keeps_the_extremes() -> None:
    rng = np.random.default_rng(5)
    time, values = np.arange(50_000) * 1e-3, rng.normal(size=50_000)
    times, kept = thinned(time, values, 0.1)
    assert kept.min() == values.min()
    assert kept.max() == values.max()
    assert len(times) < 7000
    assert np.array_equal(times[:101], time[:101])
    assert np.array_equal(kept, values[np.searchsorted(time, times)])


def test_the_seed_is_the_first_that_reaches_both_ends() -> None:
    signal, seed = Choices().steps()
    reached = [float(max(steps.voltage.min(), 7e3 - steps.voltage.max())) <= 100
               for steps in (random_steps(0.0, 7e3, 30.0, 20, number)
                             for number in range(seed + 1))]
    assert reached.index(True) == seed
    assert np.diff(signal.breaks) == pytest.approx(np.full(20, 30.0))
    with pytest.raises(InputError, match="none of"):
        replace(Choices(), levels=2, near=0.01).steps()


def test_a_negative_voltage_does_what_the_positive_does(fitted: lost.MissingParameters) -> None:
    actuator = fitted.actuators(17.9e-3)[1]
    state = actuator.rest(2e-3, 0.0)
    assert np.array_equal(actuator.linear(state, -3e3)[0], actuator.linear(state, 3e3)[0])
    assert actuator.by_voltage(state, -3e3) == pytest.approx(-actuator.by_voltage(state, 3e3),
                                                             rel=1e-12)


def test_paper_command(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                       monkeypatch: pytest.MonkeyPatch) -> None:
    """With two levels; JSON, tables, figures and page agree, and the report is built again from the
    folder."""
    out = tmp_path / "out"
    options = ["--levels", "2", "--seed", "3", "--period", "20 s", "--reading", "rest", "-o",
               str(out), "--json"]
    assert main(["lumped", "paper", *options]) == 0
    printed = printed_record(capsys.readouterr().out)
    assert printed == json.loads((out / "paper.json").read_text(encoding="utf-8"))
    assert list(faults(printed, schema_of("lumped_paper"))) == []
    for name in FIGURES:
        assert (out / f"{name}.png").stat().st_size > 20_000
        assert "<svg" in (out / f"{name}.svg").read_text(encoding="utf-8")
    rows = printed["table_2"]["rows"]
    assert [row["paper_mm"] for row in rows] == pytest.approx([1.64, 1.86, 2.06, 1.75, 2.16, 2.37])
    with (out / "static.csv").open(encoding="utf-8") as stream:
        static = [float(row["distance_mm"]) for row in csv.DictReader(stream)]
    ends = np.array(static).reshape(6, -1)[:, [0, -1]]
    assert (ends[:, 1] - ends[:, 0]).tolist() == pytest.approx([row["at_rest_mm"] for row in rows],
                                                               rel=1e-9)
    with (out / "random.csv").open(encoding="utf-8") as stream:
        moved = [(row["mass_g"], row["specimen"], float(row["distance_mm"]))
                 for row in csv.DictReader(stream)]
    for row in rows:
        distances = [y for mass, name, y in moved if (mass, name) == (f"{row['mass_g']:g}",
                                                                      row["specimen"])]
        assert max(distances) - min(distances) == pytest.approx(row["all_samples_mm"], rel=1e-9)
        assert row["at_levels_mm"] < row["all_samples_mm"]
    assert printed["settling"]["rows"][-1]["rms_s"] > 0
    assert len(printed["findings"]) == 7
    text = (out / "paper.html").read_text(encoding="utf-8")
    assert unlawful(text) == []
    assert all(words in text.replace("&#39;", "'") for finding in printed["findings"]
               for words in finding["words"])
    assert text.count("data:image/svg+xml") == len(FIGURES)
    (out / "paper.html").unlink()
    monkeypatch.setattr(page, "draw_paper", lambda result, folder: [])  # they are there
    assert main(["report", str(out)]) == 0
    assert (out / "paper.html").read_text(encoding="utf-8") == text
    monkeypatch.undo()
    (out / "step.csv").write_text("mass_g\n1\n")
    assert main(["report", str(out)]) == 2
    assert "step.csv" in capsys.readouterr().err


@pytest.mark.parametrize(("options", "words"), [
    (["--levels", "1"], "--levels: given 1: must be from 2"),
    (["--seed", "-1"], "must be from 0 to"),
    (["--period", "1 kV"], "--period"), (["--period", "1 ms"], "10 ms"),
])
def test_bad_options_are_one_message(options: list[str], words: str, tmp_path: Path,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lumped", "paper", "-o", str(tmp_path), *options]) == 2
    message = capsys.readouterr().err
    assert words in message
    assert message.count("\n") == 1
