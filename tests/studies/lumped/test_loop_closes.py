"""build → simulate → identify on their own files, and on another integrator's data with noise."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.oracles.lumped_model import LumpedFile
from tests.support.checks.json_schema import faults, schema_of
from tests.support.lumped import MODELS, clean
from tests.support.noise import autoregressive
from tests.support.specimens import elliptical, specimen_toml
from tympan.cli import main
from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_content, toml
from tympan.studies.files import write_text
from tympan.studies.identify.correlation import variance_inflation
from tympan.studies.identify.dynamic import DynamicProblem, Exact, identify_dynamic
from tympan.studies.identify.responses import ResponseRecord, drive_of
from tympan.studies.identify.static import identify_static
from tympan.studies.lumped.actuator import Actuator, Viscous
from tympan.studies.lumped.equilibria import rest
from tympan.studies.lumped.model_file import LumpedModel, write_model
from tympan.studies.lumped.simulate import simulate
from tympan.studies.signals import step

OVAL = elliptical(75e-3, MATERIALS["vhb-4910"].material)
NOMINAL = LumpedModel(OVAL, (45e-3, 75e-3), (0.6, 0.4), 2e-9, 5e3, 1.02, 0.98)
TRUE = replace(NOMINAL, viscous=Viscous(15e6, 100e6, 100e3))
NOISE = 1e-6
TRUTH = {"k_1": 15e6, "eta_1": 100e6, "eta_2": 100e3, "stiffness": 1.0,
         "relative_permittivity": OVAL.membrane.relative_permittivity}


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two masses at rest and 8 s after a step at 500 Hz, by the formulas in the file's head."""
    folder = tmp_path_factory.mktemp("loop")
    write_model(folder / "true.lumped.toml", TRUE)
    write_model(folder / "nominal.lumped.toml", NOMINAL)
    other, rng = LumpedFile.read(folder / "true.lumped.toml"), np.random.default_rng(4)
    write_text(folder / "dataset.toml", toml({"name": "made", "noise": "1 um",
                                              "specimen": [specimen_content(OVAL)]}))
    rests = [(mass, volts, other.rest(1e-3 * mass, 1e3 * volts) + NOISE * rng.standard_normal())
             for mass in (17.9, 22.45) for volts in np.linspace(0, 4, 9)]
    write_text(folder / "static.csv", "specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
        f"{OVAL.name},{mass},{volts},{1e3 * y:.7f}\n" for mass, volts, y in rests))
    when = np.arange(0.0, 8.0, 2e-3)
    read = other.step(17.9e-3, 0.0, 3.5e3, when) + NOISE * rng.standard_normal(len(when))
    write_text(folder / "transient.csv",
               "specimen,mass_g,run,t_s,voltage_kV,displacement_mm\n" + "".join(
                   f"{OVAL.name},17.9,1,{t:.3f},3.5,{1e3 * y:.7f}\n"
                   for t, y in zip(when, read, strict=True)))
    return folder


def identified(folder: Path, capsys: pytest.CaptureFixture[str], *options: str) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["lumped", "identify", str(folder), *options, "--json"]) == 0
    content = dict(json.loads(capsys.readouterr().out))
    assert list(faults(content, schema_of("lumped_identify"))) == []
    return content


def test_the_oracle_rests_and_moves_as_the_model_does(tmp_path: Path) -> None:
    write_model(tmp_path / "true.lumped.toml", TRUE)
    other, actuator = LumpedFile.read(tmp_path / "true.lumped.toml"), TRUE.actuator(17.9e-3)
    assert other.rest(17.9e-3, 3e3) == pytest.approx(rest(actuator, 3e3), rel=1e-11)
    when = np.linspace(0, 1, 501)
    moved = simulate(actuator, step(0.0, 3.5e3, 0.0, 1.0)).deflection(when)
    assert np.abs(other.step(17.9e-3, 0.0, 3.5e3, when) - moved).max() < 1e-9


@pytest.mark.study(seconds=3)
def test_what_another_integrator_made_is_found_within_its_limits(
        dataset: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In well under a minute of processor time, from a model with other viscous constants."""
    began = time.process_time()
    content = identified(dataset, capsys, "--dynamic", "--model",
                         str(dataset / "nominal.lumped.toml"), "-o", str(tmp_path / "out"))
    assert time.process_time() - began < 30
    constants = [*content["static"]["constants"], *content["dynamic"]["constants"]]
    assert {constant["name"] for constant in constants} == set(TRUTH)
    for constant in constants:
        truth = TRUTH[constant["name"]]
        assert constant["by"] == "profile"
        assert constant["low"] < truth < constant["high"]
        assert constant["high"] - constant["low"] < 0.02 * truth
    assert content["dynamic"]["variance_inflation"] == 1
    assert not any("Table 1" in words for words in content["dynamic"]["warnings"])
    assert not (tmp_path / "out" / "estimates.json").exists()


def test_estimates_are_there_before_the_limits_and_without_them(
        dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    model = ("--dynamic", "--model", str(dataset / "nominal.lumped.toml"))
    quick = identified(dataset, capsys, *model, "--no-limits")
    for constant in quick["dynamic"]["constants"]:
        assert constant["by"] == "linear"
        assert constant["low"] < TRUTH[constant["name"]] < constant["high"]
    monkeypatch.setattr("tympan.studies.identify.dynamic.identifiability", interrupted)
    with pytest.raises(KeyboardInterrupt):
        main(["lumped", "identify", str(dataset), *model, "-o", str(tmp_path)])
    assert "limits follow" in capsys.readouterr().err
    estimates = json.loads((tmp_path / "estimates.json").read_text())
    assert estimates["dynamic"]["k_1"] == quick["dynamic"]["constants"][0]["value"]
    assert estimates["static"][0]["name"] == "stiffness"


def test_what_one_shape_cannot_tell_is_named_with_what_it_tells(
        dataset: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With α open stiffness and α trade places, and so do k₁, η₁, η₂ with α: no false limits."""
    assert main(["lumped", "identify", str(dataset), "--dynamic", "--alpha", "each", "--model",
                 str(dataset / "nominal.lumped.toml")]) == 0
    words = capsys.readouterr().out
    assert "alpha_1" in words
    assert "not determined by these data" in words
    assert "determined near these values: stiffness" in words
    content = identified(dataset, capsys, "--dynamic", "--alpha", "each", "--no-limits", "--model",
                         str(dataset / "nominal.lumped.toml"))
    assert len(content["static"]["relations"]) == content["static"]["determined"] == 2
    for relation in content["static"]["relations"]:
        assert relation["low"] < relation["value"] < relation["high"]
    for constant in content["dynamic"]["constants"]:
        assert constant["low"] is None or constant["low"] < TRUTH[constant["name"]] \
            < constant["high"]


def test_simulates_folder_is_a_dataset_whose_film_is_found_from_the_specimen(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No model file, no dataset written by hand, no noise: the constants come back as they were."""
    (tmp_path / "oval.toml").write_text(specimen_toml())
    out = tmp_path / "out"
    assert main(["lumped", "simulate", str(tmp_path / "oval.toml"), "--mass", "17.9 g", "--refine",
                 "0.5", "--duration", "4 s", "--interval", "4 ms", "-o", str(out)]) == 0
    content = identified(out, capsys, "--dynamic", "--refine", "0.5")
    for constant, truth in zip(content["dynamic"]["constants"], (23.5e6, 177.2e6, 62.4e3),
                               strict=True):
        assert constant["value"] == pytest.approx(truth, rel=1e-4)
        assert constant["low"] < truth < constant["high"]
    assert content["dynamic"]["noise_um"] == 1e-2


@pytest.mark.parametrize(("options", "words"), [
    (["--model", "{}/nominal.lumped.toml", "--paper"], "cannot be given with --paper"),
    (["--model", "{}/other.lumped.toml"], "none is of ellipse"),
    (["--weights", "0.5,0.5", "--dynamic"], "--weights"),
])
def test_bad_choices_are_one_message(options: list[str], words: str, dataset: Path,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    other = replace(NOMINAL, specimen=replace(OVAL, name="other"))
    write_model(dataset / "other.lumped.toml", other)
    given = [option.format(dataset) for option in options]
    assert main(["lumped", "identify", str(dataset), *given]) == 2
    message = capsys.readouterr().err
    assert words in message
    assert message.count("\n") == 1


def test_derivatives_by_weights_are_those_of_the_rates() -> None:
    """Those of the branches too, which a weight carries with the film; far from any rest."""
    actuator, rng = MODELS["tape"], np.random.default_rng(8)
    state = np.concatenate([[4e-3, 0.1], rng.uniform(0, 0.02, 2)])
    weights, change = np.array(actuator.weights), np.array([1.0, -1.0])
    film = actuator.circles.elastic(state[:1, None])[1][0] \
        + actuator.rig.film_voltage(3e3) ** 2 * actuator.circles.electric(state[:1, None])[1][0]
    slope = -(film + actuator.drag(state)) @ change / actuator.moved
    changed = (replace(actuator, weights=tuple(weights + sign * 1e-4 * change)) for sign in (1, -1))
    ends = [moved.linear(state, 3e3)[0][1] for moved in changed]
    assert slope == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-8)


def test_alike_residuals_widen_the_limits_and_independent_ones_do_not() -> None:
    """A straight line through an autoregression: the inflation of its slope in closed form."""
    size, memory, rng = 4000, 0.95, np.random.default_rng(2)
    line = np.column_stack([np.linspace(-1, 1, size), np.ones(size)])
    white, alike = [], []
    for _ in range(20):
        for residuals, noise in ((white, rng.standard_normal(size)),
                                 (alike, autoregressive(rng.standard_normal(size), memory))):
            noise -= line @ np.linalg.lstsq(line, noise, rcond=None)[0]
            residuals.append(variance_inflation([(noise, line)], 1, 1.0))
    assert white.count(1.0) >= 19
    exact = (1 + memory) / (1 - memory)
    assert 0.5 * exact < np.mean(alike) < 1.1 * exact


def test_limits_hold_the_truth_where_the_noise_is_alike() -> None:
    """Sixteen seeds, noise unknown: without the inflation half of the limits would miss it."""
    actuator = TRUE.actuator(17.9e-3)
    when = np.arange(0.0, 3.0, 5e-3)
    y = simulate(actuator, step(0.0, 3.5e3, 0.1, 3.0)).deflection(when)
    volts = np.where(when >= 0.1, 3.5e3, 0.0)
    logs, inside, narrow = np.log([15e6, 100e6, 100e3]), [], []
    for seed in range(16):
        white = np.random.default_rng(seed).standard_normal(len(when))
        read = y + 3e-6 * autoregressive(white, 0.95)
        record = ResponseRecord(0, 17.9e-3, "1", when, read, drive_of(when, volts), 5e-3,
                                float(read[0]))
        fit = identify_dynamic(DynamicProblem(Exact((NOMINAL.actuator(1.0),)), (record,)), False)
        for combination in fit.judgement.combinations:
            away = abs(np.array(combination.coefficients) @ logs - combination.value)
            half = combination.deviation * fit.judgement.quantile
            inside.append(away < half)
            narrow.append(away < half / fit.inflation**0.5)
    assert np.mean(inside) > 0.85
    assert np.mean(narrow) < 0.8


def test_a_fit_of_cones_to_a_film_says_what_its_permittivity_makes_up_for() -> None:
    (words,) = identify_static(clean(), profiles=False).warnings
    assert "times as stiff" in words
    problem = clean()
    membranes = tuple(LumpedModel(actuator.specimen, tuple(actuator.circles.radius.tolist()),
                                  tuple(actuator.weights), 0.0, 1e4).actuator(1.0)
                      for actuator in problem.actuators)
    assert all(isinstance(actuator, Actuator) and actuator.rig == Rig() for actuator in membranes)
    film = replace(problem, actuators=membranes, law="film", alpha="given", noise=None)
    assert identify_static(film, profiles=False).warnings == []
