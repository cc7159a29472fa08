"""Identification of the lumped model's static constants: derivatives, coverage, and the sign of Eq.
(11)."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.checks.json_schema import printed_record
from tests.support.lumped import NOISE, TRUTH, clean, noisy
from tympan.cli import main
from tympan.studies.identify.static import Sharing, StaticFit, identify_static, nelder_mead
from tympan.studies.lumped.actuator import Actuator
from tympan.studies.lumped.equilibria import rest


@pytest.mark.parametrize("sharing", ["each", "shared"])
def test_truth_leaves_no_residual_and_derivatives_are_exact(sharing: Sharing) -> None:
    problem = replace(clean(), alpha=sharing)
    truth = TRUTH if sharing == "shared" else np.append(TRUTH, TRUTH[-1])
    for objective in ("deflection", "force", "printed"):
        residual, slopes = problem.residual(truth, objective)
        if objective != "printed":
            assert np.abs(residual).max() < 1e-11
        for number, size in enumerate(problem.column("scale")):
            step = np.zeros(len(truth))
            step[number] = 1e-4 * size
            ends = [problem.residual(truth + sign * step, objective)[0] for sign in (1, -1)]
            numeric = (ends[0] - ends[1]) / (2e-4 * size)
            assert slopes[:, number] == pytest.approx(numeric, rel=1e-5,
                                                      abs=1e-6 * np.abs(numeric).max())


def hits(fits: list[StaticFit]) -> np.ndarray:
    """Whether each determined combination's interval holds the truth."""
    scale = fits[0].problem.column("scale")
    return np.array([
        abs(np.array(combination.coefficients) @ (TRUTH / scale) - combination.value)
        <= combination.half
        for fit in fits for combination in fit.judgement.combinations
        if combination.half is not None])


def test_intervals_cover_the_truth_and_the_undetermined_are_named() -> None:
    """40 runs, the noise known in 30; 95 % of the independent combinations, within 3.3 standard
    deviations of it."""
    fits = [identify_static(noisy(seed, NOISE if seed < 30 else None), profiles=seed % 5 == 0)
            for seed in range(40)]
    inside = hits(fits)
    assert abs(inside.mean() - 0.95) < 3.3 * np.sqrt(0.95 * 0.05 / len(inside))
    for fit in fits:
        assert 2 <= fit.judgement.determined < len(TRUTH)
        named = set(fit.judgement.undetermined)
        assert {"beta_1", "beta_2", "beta_3", "gamma_1", "gamma_2", "gamma_3"} <= named
        assert fit.rmse == pytest.approx(NOISE, rel=0.4)


def test_each_ellipse_has_its_own_alpha_and_one_for_both_is_wrong() -> None:
    """Readings with 0.40 and 0.55: `each` finds both, `shared` leaves ten times the noise and
    says so."""
    base, values = clean(), np.append(TRUTH[:-1], [0.40, 0.55])
    problem = base
    read = problem.rest(values)[0]
    for number, (specimen, alpha) in enumerate(zip(base.specimens, (1.0, 0.40, 0.55), strict=True)):
        first = int(np.flatnonzero(base.which == number)[0])
        weights = (alpha, 1 - alpha) if number else None
        law = problem.specimen(number, values)
        assert read[first] == pytest.approx(rest(Actuator.of(law, base.mass[first], weights),
                                                 0.0), rel=1e-9)
        assert law.frame == specimen.frame
    read = read + NOISE * np.random.default_rng(3).standard_normal(len(read))
    each, shared = (identify_static(replace(base, displacement=read, alpha=sharing))
                    for sharing in ("each", "shared"))
    for constant, truth in zip(each.judgement.constants[-2:], (0.40, 0.55), strict=True):
        assert constant.low is not None
        assert constant.high is not None
        assert constant.low < truth < constant.high < constant.low + 0.01
    assert shared.rmse > 10 * each.rmse
    assert "do not follow this law" in shared.warnings[0]


@pytest.mark.study
def test_coverage_of_400_runs() -> None:
    """Combinations pooled, and by profile the two constants that are determined; the six others
    never get limits."""
    fits = [identify_static(noisy(seed)) for seed in range(400)]
    profiled = np.array([constant.low <= truth <= constant.high for fit in fits
                         for constant, truth in zip(fit.judgement.constants, TRUTH, strict=True)
                         if constant.low is not None])
    for words, inside in (("combinations", hits(fits)), ("constants by profile", profiled)):
        print(f"{words} {inside.sum()} of {len(inside)} = {inside.mean():.4f}; "
              f"95 % of a binomial is within "
              f"{1.96 * np.sqrt(0.95 * 0.05 / len(inside)):.4f} of 0.95")
        assert 0.93 <= inside.mean() <= 0.97
    assert all(fit.judgement.undetermined
               == [f"{name}_{i}" for name in ("beta", "gamma") for i in (1, 2, 3)]
               for fit in fits)


def test_eq_11_as_printed_asks_the_film_to_push_down() -> None:
    """With its signs the fit's films are unstable and their rest is nowhere near the readings; with
    Eq. (5)'s it is."""
    problem = replace(clean(), alpha="shared")
    right, wrong = (identify_static(problem, objective).values
                    for objective in ("force", "printed"))
    assert (problem.force(right, problem.read)[1] > 0).all()
    assert (problem.force(wrong, problem.read)[0] < 0).all()
    assert np.abs(problem.force(right, problem.read)[0]
                  - problem.load).max() < 1e-4 * problem.load.max()


def test_nelder_mead_takes_more_evaluations_and_fits_no_better() -> None:
    problem = noisy(1)
    simplex, squares = nelder_mead(problem, most=1500), identify_static(problem)
    assert simplex["evaluations"] > 5 * squares.evaluations
    assert simplex["rmse_um"] >= 0.99e6 * squares.rmse


def test_identify_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    actuators = Path(__file__).parents[3] / "studies" / "shipped"
    names = ["circular", "elliptical-small", "elliptical-large"]
    head = 'name = "made"\nnoise = "1 um"\n' + "".join(
        "[[specimen]]\n" + "\n".join(line.replace("[", "[specimen.") if line.startswith("[")
                                     else line
                                     for line in (actuators
                                                  / f"{name}.toml").read_text().splitlines()) + "\n"
        for name in names)
    (tmp_path / "dataset.toml").write_text(head)
    read = noisy(5)
    (tmp_path / "static.csv").write_text("specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
        f"{names[n]},{1e3 * m:.6g},{u / 1e3:.6g},{1e3 * y:.9g}\n"
        for n, m, u, y in zip(read.which, read.mass, read.voltage, read.displacement, strict=True)))
    out = tmp_path / "out"
    assert main(["lumped", "identify", str(tmp_path), "--paper", "-o", str(out), "--json"]) == 0
    content = printed_record(capsys.readouterr().out)
    assert content == json.loads((out / "identify.json").read_text())
    drawn = {file.name: file.read_bytes() for file in out.glob("*.svg")}
    assert main(["report", str(out)]) == 0
    assert drawn == {file.name: file.read_bytes() for file in out.glob("*.svg")}
    assert content["static"]["rmse_um"] == pytest.approx(1.0, rel=0.4)
    assert "gamma_2" in content["static"]["not_determined"]
    (words,) = content["static"]["warnings"]
    assert "2.33 to 2.79" in words
    assert "times as stiff" in words
    assert main(["lumped", "identify", str(tmp_path), "--paper", "--law", "film"]) == 0
    assert "do not follow this law" in capsys.readouterr().out
    assert (out / "static.png").stat().st_size > 10_000
