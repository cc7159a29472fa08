"""Constants of a law told by readings of actuators, of films whose truth nobody states."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tympan
from tests.oracles import axisymmetric
from tests.oracles.readings.round_actuators import GRAVITY, dataset_file
from tests.support.checks.json_schema import faults, printed_record
from tympan.cli import main
from tympan.fem.film.laws import Gent, Ogden, Yeoh
from tympan.fem.film.library import load_specimen
from tympan.geometry.specimen import Material
from tympan.reports.schema import json_records
from tympan.studies.diagnosis.law_fit import LawConstants

#: Displacements [m] and voltages [V] of a tester, loads [kg] at rest; noise [N] and [m].
PLACES, CHARGED, HANGING = np.linspace(1e-3, 20e-3, 16), (0.0, 2e3, 4e3), (1e-2, 2e-2)
FORCE_NOISE, REST_NOISE = 2e-3, 2e-5
#: What the datasets state.
STATED = 'law = "ogden", mu = ["18.4 kPa", "0.21 kPa"], alpha = [2, 4]'


def hidden(seed: int) -> tuple[tuple[float, float], float]:
    """Two moduli [Pa], within a fifth and within four fifths of those stated; a permittivity."""
    random = np.random.default_rng(1000 + seed)
    stiff, stiffening, permittivity = random.uniform((0.8, 0.3, 0.85), (1.2, 1.8, 1.15)).tolist()
    return (18400.0 * stiff, 210.0 * stiffening), 4.7 * permittivity


def measured(folder: Path, seed: int, most: float = 1.0) -> Path:
    """A tester's runs to a share of :data:`PLACES`, and deflections at rest, by the equations."""
    mu, permittivity = hidden(seed)
    truth = axisymmetric.Film(1e-2, 4.5e-2, 1e-3, 5**0.5, axisymmetric.Ogden(mu, (2.0, 4.0)),
                              permittivity)
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    about = dataset_file(REST_NOISE, ["middle"]).replace('law = "neo_hooke", mu = "20 kPa"', STATED)
    (folder / "dataset.toml").write_text(about, encoding="utf-8")
    rows = ["specimen,voltage_kV,displacement_mm,force_mN,run,sigma_mN"]
    for voltage in CHARGED:
        for place in (most * PLACES).tolist():
            force = axisymmetric.solve_deflection(truth, place, voltage).force
            force += FORCE_NOISE * random.standard_normal()
            rows.append(f"middle,{voltage / 1e3},{1e3 * place},{1e3 * force:.6f},{voltage},"
                        f"{1e3 * FORCE_NOISE}")
    (folder / "force.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    rows = ["specimen,mass_g,voltage_kV,displacement_mm"]
    for mass in HANGING:
        for voltage in CHARGED:
            there = axisymmetric.solve_load(truth, GRAVITY * mass, voltage).deflection
            there += REST_NOISE * random.standard_normal()
            rows.append(f"middle,{1e3 * mass},{voltage / 1e3},{1e3 * there:.6f}")
    (folder / "static.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return folder


def held_true(folder: Path, seeds: range) -> tuple[int, int, list[float]]:
    """How many limits hold the truth, of how many; half widths of the moduli's limits, relative."""
    held, widths = [], []
    for seed in seeds:
        law = tympan.fit_material(measured(folder / str(seed), seed), constants=["mu"]).law
        mu, permittivity = hidden(seed)
        moduli = {each.name: each for each in law.constants}
        assert [moduli[name].unit for name in ("mu_1", "mu_2", "alpha_1")] == ["Pa", "Pa", ""]
        for each, truth in ((moduli["mu_1"], mu[0]), (moduli["mu_2"], mu[1])):
            held.append(each.low < truth < each.high)
            widths.append((each.high - each.low) / 2 / truth)
        factor = law.permittivity_factor
        held.append(factor.low < permittivity / 4.7 < factor.high)
        assert law.p_value > 1e-3
    return sum(held), len(held), widths


@pytest.mark.study(seconds=36)
def test_limits_of_hidden_moduli_hold_them(tmp_path: Path) -> None:
    held, count, widths = held_true(tmp_path, range(4))
    assert held >= count - 2  # fewer of twelve in one of 50 draws
    assert max(widths) < 0.35


@pytest.mark.study
def test_of_40_films_limits_hold_the_moduli_as_often_as_they_say(tmp_path: Path) -> None:
    held, count, _ = held_true(tmp_path, range(100, 140))
    assert 0.89 * count <= held


@pytest.mark.study(seconds=15)
def test_command_writes_the_film_and_both_doors_agree(tmp_path: Path, capsys) -> None:
    data, folder = measured(tmp_path / "data", 7), tmp_path / "fit"
    assert main(["material", "fit", str(data), "--constants", "mu", "-o", str(folder),
                 "--json"]) == 0
    printed = printed_record(capsys.readouterr().out)
    (record,) = [record for record in json_records() if record.name == "film_fit"]
    assert list(faults(printed, record.schema)) == []
    fitted = [each["value"] for each in printed["law"]["constants"]]
    film = load_specimen(folder / "middle.toml").membrane
    assert [*film.material.mu, *film.material.alpha] == pytest.approx(fitted, rel=1e-6)
    assert film.relative_permittivity == pytest.approx(
        4.7 * printed["law"]["permittivity_factor"]["value"], rel=1e-6)
    assert printed["law"]["p_value"] > printed["p_value"]
    assert main(["material", "fit", str(data), "--constants", "mu"]) == 0
    assert "mu_2 = " in capsys.readouterr().out


@pytest.mark.study(seconds=3)
def test_powers_that_short_runs_do_not_tell_are_named(tmp_path: Path) -> None:
    """To 3 mm the film hardly stretches: the second term may be there or not."""
    result = tympan.fit_material(measured(tmp_path / "short", 3, most=0.15), constants=["all"])
    assert any("mu_2" in words for words in result.not_told)


@pytest.mark.parametrize(("arguments", "words"), [
    (["--constants", "nu"], "must be one of all, alpha, mu"),
    (["--constants", "mu", "--branches", "1"], "must be 0"),
])
def test_what_cannot_be_fitted_is_refused(tmp_path: Path, arguments: list[str], words: str,
                                          capsys) -> None:
    assert main(["material", "fit", str(measured(tmp_path / "data", 1)), *arguments]) == 2
    assert words in capsys.readouterr().err


def test_one_constant_is_the_factor_s(tmp_path: Path, capsys) -> None:
    data = measured(tmp_path / "data", 1)
    about = data / "dataset.toml"
    text = about.read_text("utf-8")
    about.write_text(text.replace(STATED, 'law = "neo_hooke", mu = "20 kPa"'), "utf-8")
    assert main(["material", "fit", str(data), "--constants", "all"]) == 2
    assert "none but the one that the factor" in capsys.readouterr().err
    about.write_text(text, "utf-8")
    (data / "coupon.csv").write_text("mode,stretch,nominal_stress_kPa\nuniaxial,1.5,20\n"
                                     "uniaxial,2,30\nuniaxial,2.5,40\n", "utf-8")
    assert main(["material", "fit", str(data), "--constants", "all"]) == 2
    assert "there is coupon.csv" in capsys.readouterr().err


@pytest.mark.parametrize("law", [Ogden((18e3, 200.0), (2.0, 4.0)), Gent(18e3, 110.0),
                                 Yeoh((180e3, -16e3, 6.6e3))])
def test_constants_make_the_law_again(law: Material) -> None:
    """And a unit of each changes the stress of the mounted film by itself, in line."""
    constants = LawConstants.of(law)
    assert constants.made(constants.values) == law
    units, stretch = constants.units((1.5, 1.5)), np.array(1.5)
    stress = law.derivatives(stretch, stretch)[1]
    for number, unit in enumerate(units):
        values = constants.values.copy()
        values[number] += 1e-4 * unit
        moved = constants.made(values).derivatives(stretch, stretch)[1]
        assert abs(moved / stress - 1) == pytest.approx(1e-4, rel=0.02)
