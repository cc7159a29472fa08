"""Identification of the lumped model's viscous constants: motions, derivatives, coverage, and what
stays open."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.support.checks.json_schema import printed_record
from tests.support.lumped import MASSES, NOISE, TRUTH, noisy
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.laws import Separable
from tympan.paper.table1 import paper_actuators
from tympan.studies.identify.dynamic import (
    DynamicFit,
    DynamicProblem,
    Exact,
    Statics,
    identify_dynamic,
    nelder_mead_dynamic,
)
from tympan.studies.identify.responses import ResponseRecord, drive_of
from tympan.studies.identify.static import identify_static
from tympan.studies.lumped.actuator import Actuator, Viscous, paper_cones
from tympan.studies.lumped.collocation import CollocationSolver
from tympan.studies.lumped.equilibria import rest
from tympan.studies.signals import Pieces, Sine, random_steps, step

VISCOUS = Viscous(15e6, 100e6, 100e3)  # away from Table 1, where the search begins
LOGS = np.log([VISCOUS.k1, VISCOUS.eta1, VISCOUS.eta2])
LAW = Separable(tuple(TRUTH[:3]), tuple(TRUTH[3:6]), (2.0, 4.0, 6.0), 5**0.5)
SPECIMENS = tuple(replace(specimen, membrane=replace(specimen.membrane, material=LAW))
                  for specimen in paper_actuators(8.5))
ACTUATORS = Path(__file__).parents[3] / "studies" / "shipped"
EXACT = Exact(paper_cones(SPECIMENS, (0.45, 0.55)))


def actuator(number: int = 2, mass: float = MASSES[0]) -> Actuator:
    return Actuator.of(SPECIMENS[number], mass, (0.45, 0.55), VISCOUS)


def explicit(model: Actuator, signal: Sine | Pieces, time: np.ndarray) -> np.ndarray:
    """States at times, shape (size, times), by DOP853 from rest at the signal's first voltage,
    piece by piece."""
    state, parts = model.rest(rest(model, signal.first), signal.first), []
    for piece, (begin, end) in enumerate(pairwise(signal.breaks)):
        inside = time[(time >= begin) & ((time < end) | (end == signal.end))]
        done = solve_ivp(lambda t, x, piece=piece: model.linear(x, signal.within(piece, t))[0],
                         (begin, end), state,
                         "DOP853",
                         [*inside[inside > begin], *([end] if end not in inside else [])],
                         rtol=1e-11, atol=1e-14)
        parts += [np.array([state]).T] if begin in inside else []
        parts.append(done.y[:, :int((inside > begin).sum())])
        state = done.y[:, -1]
    return np.concatenate(parts, axis=1)


@cache
def response(number: int, mass: float, end: float, interval: float) -> tuple[np.ndarray,
                                                                             np.ndarray]:
    """A step of 3.5 kV at samples from 0; the voltage came a third of a sample before the one that
    shows it first."""
    time = np.arange(0.0, end + interval / 2, interval)
    at = time[np.searchsorted(time, 0.1)] - interval / 3
    return time, explicit(actuator(number, mass), step(0.0, 3.5e3, at, time[-1]), time)[0]


def record(number: int, mass: float, seed: int, end: float = 6.0, interval: float = 0.01,
           noise: float = NOISE
           ) -> ResponseRecord:
    time, clean = response(number, mass, end, interval)
    read = clean + noise * np.random.default_rng([seed, number,
                                                  round(1e6 * mass)]).standard_normal(len(time))
    voltage = np.where(time >= time[np.searchsorted(time, 0.1)], 3.5e3, 0.0)
    return ResponseRecord(number, mass, "1", time, read, drive_of(time, voltage), interval,
                          float(read[0]))


def problem(seed: int, statics: Statics = EXACT, noise: float | None = NOISE,
            which: tuple[int, ...] = (0, 2),
            **how: float) -> DynamicProblem:
    return DynamicProblem(statics,
                          tuple(record(number, MASSES[0], seed, **how) for number in which), noise)


def drive(signal: Sine | Pieces, points: int = 51) -> Pieces:
    if isinstance(signal, Pieces):
        return signal
    time = np.linspace(0.0, signal.end, points)
    return Pieces(time, np.array([signal.within(0, t) for t in time]))


@pytest.mark.parametrize("signal", [step(0.0, 3.5e3, 0.3, 5.0), step(1e3, 7e3, 0.0, 1.5),
                                    Sine(2e3, 2e3, 0.5, 1.0),
                                    random_steps(0.0, 6e3, 0.25, 4, 7)],
                         ids=["step", "to 7 kV", "sine", "random"])
def test_motion_is_that_of_another_integrator(signal: Sine | Pieces) -> None:
    """To 1 nm, a thousandth of the sensor's noise; the voltage is given as straight lines to both.
    """
    given = drive(signal)
    model = actuator()
    start = model.rest(rest(model, given.first), given.first)
    motion = CollocationSolver(given).solve(model, start[:, None])
    time = np.linspace(0.0, given.end, 3001)
    other = explicit(model, given, time)
    y, speed, _ = motion.deflection(time)
    assert np.abs(y - other[0]).max() < 1e-9
    assert np.abs(speed - other[1]).max() < 1e-5 * np.abs(other[1]).max()


def test_derivatives_have_taylor_order_two() -> None:
    """Of a response by viscous constants, turns of the statics and delays: what is left falls with
    the square."""
    made = problem(0, identify_static(noisy(0), profiles=False), end=1.0)
    z = made.start.copy()
    z[:3], z[3:] = LOGS, 0.1
    rng = np.random.default_rng(5)
    for direction in (np.eye(len(z))[0], np.eye(len(z))[2], rng.uniform(-1, 1, len(z))):
        base, remainders = made.parts(z), []
        for size in (0.04, 0.02):
            moved = made.parts(z + size * direction)
            remainders.append(max(float(np.abs(new - old - size * slopes @ direction).max())
                                  for (new, _), (old, slopes) in zip(moved, base, strict=True)))
        assert np.log2(remainders[0] / remainders[1]) == pytest.approx(2.0, abs=0.15)


def test_viscous_derivatives_by_complex_step() -> None:
    state = np.array([3e-3, 0.05, 0.001, 0.0005])
    for number in range(3):
        logs = LOGS + 1e-30j * np.eye(3)[number]
        turned = replace(actuator(), viscous=Viscous(*np.exp(logs)))
        exact = np.imag(turned.linear(state, 2e3)[0]) / 1e-30
        assert actuator().by_viscous(state)[:, number] == pytest.approx(exact, rel=1e-12)


@pytest.mark.study(seconds=4)
def test_truth_is_found_from_far_and_its_delay_too() -> None:
    """From constants three times as large and as small; no noise but the data's own 1e-12 m."""
    made = replace(problem(0), noise=1e-8,
                   records=tuple(record(number, MASSES[0], 0, noise=0.0) for number in (0, 2)))
    for factor in (3.0, 1 / 3):
        far = replace(made)
        far.__dict__["start"] = np.append(LOGS + np.log(factor) * np.array([1, -1, 1]), np.zeros(2))
        fit = identify_dynamic(far, profiles=False)
        assert fit.z[:3] == pytest.approx(LOGS, abs=1e-5)
        assert fit.z[3:] == pytest.approx(np.full(2, 1 / 3), abs=1e-4)
        assert fit.rmse < 2e-9


def covered(fits: list[DynamicFit]) -> np.ndarray:
    """Whether each determined combination's interval holds the truth."""
    return np.array([
        abs(np.array(combination.coefficients) @ LOGS - combination.value) <= combination.half
        for fit in fits for combination in fit.judgement.combinations
        if combination.half is not None])


def within(fits: list[DynamicFit]) -> np.ndarray:
    """Whether each determined constant's interval, by profile, holds the truth."""
    return np.array([constant.low <= truth <= constant.high for fit in fits
                     for constant, truth in zip(fit.judgement.constants, np.exp(LOGS), strict=True)
                     if constant.low is not None])


def with_statics(seed: int, profiles: bool, **how: float) -> DynamicFit:
    """A run with everything drawn anew: readings at rest, which are fitted first, and two
    responses."""
    return identify_dynamic(problem(seed, identify_static(noisy(seed), profiles=False),
                                    **how), profiles)


def told(inside: np.ndarray) -> str:
    """How many intervals hold the truth, and what chance alone does to that."""
    return (f"{inside.sum()} of {len(inside)} = {inside.mean():.4f}; 95 % of a binomial is within "
            f"{1.96 * np.sqrt(0.95 * 0.05 / len(inside)):.4f} of 0.95")


@pytest.mark.study(seconds=5)
def test_intervals_cover_the_truth() -> None:
    """Six runs with exact statics, two without the noise known, and two with fitted ones; to 2 % of
    each constant."""
    fits = [identify_dynamic(problem(seed, noise=NOISE if seed < 4 else None, end=3.0),
                             profiles=seed == 0)
            for seed in range(6)] + [with_statics(seed, profiles=False, end=3.0)
                                     for seed in range(2)]
    inside = covered(fits)
    assert len(inside) == 3 * len(fits)
    assert inside.mean() > 0.95 - 3.3 * np.sqrt(0.95 * 0.05 / len(inside))
    for fit in fits:
        for constant, truth in zip(fit.judgement.constants, np.exp(LOGS), strict=True):
            assert constant.value == pytest.approx(truth, rel=0.02)
            if constant.low is not None:
                assert 0.001 * truth < constant.high - constant.low < 0.04 * truth
        assert fit.rmse == pytest.approx(NOISE, rel=0.2)


@pytest.mark.study(seconds=4)
def test_responses_that_do_not_see_a_constant_leave_it_open() -> None:
    """The first 60 ms see no relaxation, so not η₁; a reading every 0.2 s does not follow what η₂
    damps."""
    short = identify_dynamic(problem(1, end=0.16, interval=0.002))
    assert short.judgement.undetermined == ["eta_1"]
    assert len(short.warnings) == 2
    assert "eta_1 stays where the search began" in short.warnings[1]
    coarse = identify_dynamic(problem(1, end=15.0, interval=0.2, which=(0,)))
    assert coarse.judgement.undetermined == ["eta_2"]
    assert "does not follow the fast oscillation" in coarse.warnings[1]
    for constant, truth in zip(coarse.judgement.constants[:2], np.exp(LOGS), strict=False):
        assert constant.low is not None
        assert constant.low < truth < constant.high < 1.6 * constant.low


def test_nelder_mead_takes_more_evaluations_and_fits_no_better() -> None:
    made = problem(3, end=1.0, which=(0,))
    simplex, squares = nelder_mead_dynamic(made), identify_dynamic(made, profiles=False)
    assert simplex["evaluations"] > 3 * squares.evaluations
    assert simplex["rmse_um"] >= 0.99e6 * squares.rmse


@pytest.mark.study(seconds=6)
def test_a_misfit_of_the_model_widens_the_limits_and_is_told() -> None:
    """The same readings with weights of 0.6 and 0.4 taken as exact."""
    wrong = identify_dynamic(problem(1, Exact(paper_cones(SPECIMENS, (0.6, 0.4)))), profiles=False)
    assert "do not follow this model" in wrong.warnings[0]
    assert wrong.sigma > 20 * NOISE


@pytest.mark.parametrize(("time", "voltage", "expected"), [
    ([0, 1, 2, 3, 4], [0, 0, 5, 5, 5], ([0, 2, 2, 4], [0, 0, 5, 5])),
    ([0, 1, 2, 3], [0, 1, 2, 3], ([0, 3], [0, 3])),
    ([0, 1, 2, 3, 4], [0, 0, 1, 2, 3], ([0, 1, 4], [0, 0, 3])),
    ([0, 1, 2], [4, 4, 4], ([0, 2], [4, 4])),
    ([0, 1, 2, 3, 4, 5], [0, 0, 5, 5, 1, 1], ([0, 2, 2, 4, 4, 5], [0, 0, 5, 5, 1, 1])),
])
def test_voltage_behind_samples(time: list, voltage: list, expected: tuple[list, list]) -> None:
    driven = drive_of(np.array(time, float), np.array(voltage, float))
    assert (driven.time.tolist(), driven.voltage.tolist()) == expected


def test_a_noisy_record_of_a_step_is_the_step() -> None:
    rng = np.random.default_rng(1)
    time = np.linspace(0.0, 1.0, 1001)
    clean = np.where(time >= 0.2, 3.5e3, 0.0)
    driven = drive_of(time, clean + rng.normal(0, 5.0, len(time)))
    assert driven.time == pytest.approx([0.0, 0.2, 0.2, 1.0])
    assert driven.voltage == pytest.approx([0.0, 0.0, 3.5e3, 3.5e3], abs=1.5)
    slope = drive_of(time, 3.5e3 * time)
    assert slope.voltage.tolist() == [0.0, 3.5e3]


def test_a_run_that_begins_between_two_rests_is_refused() -> None:
    made = problem(0)
    whole = made.records[0]
    since = np.searchsorted(whole.time, 0.2)
    cut = replace(whole, time=whole.time[since:], displacement=whole.displacement[since:],
                  drive=drive_of(whole.time[since:], np.full(len(whole.time) - since, 3.5e3)))
    with pytest.raises(InputError, match="must begin at rest"):
        identify_dynamic(replace(made, records=(replace(cut, first=whole.first + 1.2e-4),)))
    assert replace(made, records=(cut,)).began == (0.0,)


def toml(names: tuple[str, ...]) -> str:
    """dataset.toml of the paper's actuators."""
    files = {name: (ACTUATORS / f"{name}.toml").read_text().splitlines() for name in names}
    return 'name = "made"\nnoise = "1 um"\n' + "".join(
        "[[specimen]]\n" + "\n".join(line.replace("[", "[specimen.") if line.startswith("[")
                                     else line
                                     for line in lines) + "\n" for lines in files.values())


def test_what_simulate_writes_identify_reads(tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    """A step at the first sample, so that the run begins at a rest of 0 V that its voltages do not
    show."""
    names = ("circular", "elliptical-small")
    assert main(["lumped", "simulate", *(str(ACTUATORS / f"{name}.toml") for name in names),
                 "--duration", "0.5 s",
                 "--interval", "5 ms", "--paper", "--mass", "17.9 g", "--alpha", "0.6,0.4", "-o",
                 str(tmp_path)]) == 0
    (tmp_path / "dataset.toml").write_text(toml(names))
    capsys.readouterr()
    out = tmp_path / "out"
    assert main(["lumped", "identify", str(tmp_path), "--paper", "--dynamic", "--weights",
                 "0.6,0.4", "-o", str(out), "--json"]) == 0
    content = printed_record(capsys.readouterr().out)
    assert content == json.loads((out / "identify.json").read_text())
    drawn = {file.name: file.read_bytes() for file in out.glob("*.svg")}
    assert main(["report", str(out)]) == 0
    assert drawn == {file.name: file.read_bytes() for file in out.glob("*.svg")}
    assert "static" not in content
    for constant, truth in zip(content["dynamic"]["constants"], (23.5e6, 177.2e6, 62.4e3),
                               strict=True):
        assert constant["value"] == pytest.approx(truth, rel=1e-4)
        assert constant["low"] < truth < constant["high"]
    assert [run["began_at_V"] for run in content["dynamic"]["runs"]] == [0.0, 0.0]
    assert "the weights and permittivity are taken as exact" in content["dynamic"]["warnings"][0]
    assert {file.name for file in out.glob("*.png")} == {"dynamic.png", "profiles-dynamic.png",
                                                         "correlations-dynamic.png"}


@pytest.mark.parametrize(("keep", "options", "words"), [
    ("static.csv", ["--dynamic"], "has no transient.csv"),
    ("transient.csv", [], "has no static.csv"),
    ("static.csv", ["--weights", "0.5,0.5"], "without static.csv"),
    ("short", ["--dynamic"], "at least five readings"),
    ("transient.csv", ["--dynamic", "--weights", "0.9"], "2 numbers"),
    ("transient.csv", ["--dynamic", "--weights", "a,b"], "--weights: given 'a,b': must be numbers"),
])
def test_what_cannot_be_identified_is_one_message(keep: str, options: list[str], words: str,
                                                  tmp_path: Path,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "dataset.toml").write_text(toml(("elliptical-large",)))
    if keep == "static.csv":
        (tmp_path / keep).write_text("specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
            f"elliptical-large,17.9,{u},{2 + 0.02 * u**2 + 0.001 * u**3}\n"
            for u in np.linspace(0, 7, 14)))
    else:
        lines = 3 if keep == "short" else 40
        (tmp_path
         / "transient.csv").write_text("specimen,mass_g,run,t_s,voltage_kV,displacement_mm\n"
                                       + "".join(
            f"elliptical-large,17.9,1,{0.01 * n},0,2.8\n" for n in range(lines)))
    assert main(["lumped", "identify", str(tmp_path), "--paper", *options]) == 2
    message = capsys.readouterr().err
    assert words in message
    assert ("tympan: --weights: " if "--weights" in options else f"tympan: {tmp_path}: ") in message
    assert message.count("\n") == 1


@pytest.mark.study
def test_coverage_of_400_runs() -> None:
    """Readings at rest and two responses drawn anew in every run, statics fitted first; profiles in
    every fourth."""
    fits = [with_statics(seed, profiles=seed % 4 == 0) for seed in range(400)]
    for words, inside in (("combinations", covered(fits)),
                          ("constants by profile", within(fits[::4]))):
        print(words, told(inside))
        assert 0.93 <= inside.mean() <= 0.97
