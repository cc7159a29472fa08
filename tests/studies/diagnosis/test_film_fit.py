"""``material fit`` of a dataset: films fitted to readings by the axisymmetric equations."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import tympan
from tests.oracles import axisymmetric
from tests.oracles.readings import runs_in_time
from tests.oracles.readings.round_actuators import GRAVITY, Hidden, dataset_file
from tests.oracles.readings.runs_in_time import Run
from tests.support.checks.json_schema import faults, printed_record
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.library import load_specimen
from tympan.reports.schema import json_records
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.film_fit import FilmFit, fit_film
from tympan.studies.files import from_json

RUN = Run(shapes=("middle",), masses=(2e-2,), voltage=5e3, length=60.0, rate=40.0, noise=3e-6)
TWO = Hidden(branch=100e3, time=20.0, others=((100e3, 0.5),))


@pytest.mark.study(seconds=11)
def test_law_permittivity_and_both_branches_are_within_their_limits(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And the specimen that is stored has them."""
    data, folder = runs_in_time.write(tmp_path / "data", TWO, RUN, 1), tmp_path / "fit"
    assert main(["material", "fit", str(data), "-o", str(folder), "--json"]) == 0
    printed = printed_record(capsys.readouterr().out)
    (record,) = [record for record in json_records() if record.name == "film_fit"]
    assert list(faults(printed, record.schema)) == []
    assert printed == json.loads((folder / "film_fit.json").read_text(encoding="utf-8"))
    found = from_json(FilmFit, printed)
    assert found.stiffness_factor.low < TWO.stiffness < found.stiffness_factor.high
    assert found.permittivity_factor.low < TWO.permittivity < found.permittivity_factor.high
    truth = [*TWO.others, (TWO.branch, TWO.time)]
    for branch, (modulus, time) in zip(found.branches, truth, strict=True):
        assert branch.modulus_Pa.low < modulus < branch.modulus_Pa.high
        assert branch.time_s.low < time < branch.time_s.high
    assert found.p_value > 0.01
    assert not any("branch" in words for words in found.not_told)
    film = load_specimen(folder / "middle.toml").membrane
    fitted = sorted(film.branches, key=lambda branch: branch.time)
    assert [branch.modulus for branch in fitted] == pytest.approx(
        [branch.modulus_Pa.value for branch in found.branches])
    assert film.material.mu == pytest.approx(20e3 * found.stiffness_factor.value)


@pytest.mark.study(seconds=14)
def test_what_a_run_does_not_tell_is_said(tmp_path: Path) -> None:
    """One branch makes no second one, none makes none, and what is asked for is refused."""
    one = read_dataset(runs_in_time.write(tmp_path / "one", Hidden(branch=100e3), RUN, 1))
    (branch,) = fit_film(one).branches
    assert branch.time_s.low < 5.0 < branch.time_s.high
    none = read_dataset(runs_in_time.write(tmp_path / "none", Hidden(), RUN, 1))
    found = fit_film(none)
    assert found.branches == ()
    assert any(words.startswith("no branch shows") for words in found.not_told)
    with pytest.raises(InputError, match="from 0 to 2"):
        fit_film(one, branches=3)


#: Displacements [m] and voltages [V] of a tester's runs, and loads [kg] that hang beside it.
PLACES, CHARGED, HANGING = np.linspace(0.5e-3, 8e-3, 16), (0.0, 2e3, 4e3), (1e-2, 2e-2)
#: Standard deviation of a force [N] and of a deflection at rest [m].
FORCE_NOISE, REST_NOISE = 2e-3, 2e-5


def film(hidden: Hidden) -> axisymmetric.Film:
    return axisymmetric.Film(1e-2, 4.5e-2, 1e-3, 5**0.5, axisymmetric.neo_hooke(
        20e3 * hidden.stiffness), 4.7 * hidden.permittivity)


def measured(folder: Path, hidden: Hidden, seed: int, voltages: tuple[float, ...] = CHARGED,
           masses: tuple[float, ...] = HANGING, sigma: bool = True, more: str = "") -> Path:
    """Runs of a tester and deflections at rest, by the equations, with noise."""
    random, truth = np.random.default_rng(seed), film(hidden)
    folder.mkdir()
    (folder / "dataset.toml").write_text(dataset_file(REST_NOISE, ["middle"]), encoding="utf-8")
    rows = ["specimen,voltage_kV,displacement_mm,force_mN,run" + (",sigma_mN" if sigma else "")]
    for voltage in voltages:
        for place in PLACES.tolist():
            force = axisymmetric.solve_deflection(truth, place, voltage).force
            force += FORCE_NOISE * random.standard_normal()
            rows.append(f"middle,{voltage / 1e3},{1e3 * place},{1e3 * force:.6f},{voltage}"
                        + (f",{1e3 * FORCE_NOISE}" if sigma else ""))
    (folder / "force.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    rows = ["specimen,mass_g,voltage_kV,displacement_mm"]
    for mass in masses:
        for voltage in CHARGED:
            there = axisymmetric.solve_load(truth, GRAVITY * mass, voltage).deflection
            there += REST_NOISE * random.standard_normal()
            rows.append(f"middle,{1e3 * mass},{voltage / 1e3},{1e3 * there:.6f}")
    if masses:
        (folder / "static.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    if more:
        (folder / "coupon.csv").write_text(more, encoding="utf-8")
    return folder


def drawn(seed: int) -> Hidden:
    """Factors on stiffness and permittivity within a fifth."""
    stiffness, permittivity = np.random.default_rng(1000 + seed).uniform(0.8, 1.2, 2).tolist()
    return Hidden(stiffness, permittivity)


def held_true(folder: Path, seeds: range) -> tuple[int, int, list[float]]:
    """How many limits hold the truth, of how many; widths of the stiffness' limits."""
    held, widths = [], []
    for seed in seeds:
        hidden = drawn(seed)
        # Every second tester says what its noise is; of the others the scatter tells it.
        found = fit_film(read_dataset(measured(folder / str(seed), hidden, seed,
                                             sigma=bool(seed % 2))))
        for factor, truth in ((found.stiffness_factor, hidden.stiffness),
                              (found.permittivity_factor, hidden.permittivity)):
            held.append(factor.low < truth < factor.high)
        widths.append(found.stiffness_factor.high / found.stiffness_factor.low - 1)
    return sum(held), len(held), widths


def test_limits_from_a_tester_hold_the_truth(tmp_path: Path) -> None:
    held, count, widths = held_true(tmp_path, range(6))
    assert held >= count - 2  # fewer of twelve in one of 50 draws
    assert max(widths) < 0.03


@pytest.mark.study
def test_of_60_actuators_limits_hold_the_truth_as_often_as_they_say(tmp_path: Path) -> None:
    held, count, _ = held_true(tmp_path, range(60))
    assert 0.92 <= held / count <= 0.98


def test_a_film_fitted_to_half_of_the_runs_foretells_the_other_half(tmp_path: Path) -> None:
    """Runs of a tester at 0 and 4 kV and a load foretell that at 2 kV and twice the load."""
    hidden = Hidden(1.15, 0.88)
    found = fit_film(read_dataset(measured(tmp_path / "half", hidden, 3, CHARGED[::2],
                                          HANGING[:1])))
    found.save(tmp_path / "fit")
    fitted = tympan.load(tmp_path / "fit" / "middle.toml")
    curve, = tympan.force(fitted, from_="0.5 mm", to="8 mm", points=len(PLACES),
                          voltage=[CHARGED[1]]).curves
    exact = [axisymmetric.solve_deflection(film(hidden), place, CHARGED[1]).force
             for place in PLACES.tolist()]
    assert np.array(curve.force_N) == pytest.approx(exact, abs=FORCE_NOISE)
    for voltage in CHARGED:
        rest = tympan.solve(fitted, mass=HANGING[1], voltage=voltage).deflection_m
        there = axisymmetric.solve_load(film(hidden), GRAVITY * HANGING[1], voltage).deflection
        assert rest == pytest.approx(there, abs=REST_NOISE)
        # A film as it is stated does not.
        plain = axisymmetric.solve_load(film(Hidden(1, 1)), GRAVITY * HANGING[1], voltage)
        assert abs(plain.deflection - there) > 5 * REST_NOISE


def test_without_voltage_the_permittivity_is_not_told(tmp_path: Path) -> None:
    found = fit_film(read_dataset(measured(tmp_path / "d", Hidden(1.1), 5, CHARGED[:1], ())))
    assert found.stiffness_factor.low < 1.1 < found.stiffness_factor.high < 1.13
    assert found.branches == ()
    assert "the permittivity is known hardly better than before any reading" in found.not_told
    assert any("transient.csv" in words for words in found.not_told)
    with pytest.raises(InputError, match="must be 0"):
        fit_film(read_dataset(tmp_path / "d"), branches=1)


def test_coupons_of_the_film_tell_with_the_tester(tmp_path: Path) -> None:
    """A weak tester's stiffness is a coupon's, but for what strips of one batch may differ."""
    coupon = "specimen,mode,stretch,nominal_stress_kPa\n" + "".join(
        f"S,uniaxial,{stretch},{22 * (stretch - stretch**-2) + noise:.5f}\n"
        for stretch, noise in zip(np.linspace(1.1, 4, 25).round(3).tolist(),
                                  0.2 * np.random.default_rng(2).standard_normal(25), strict=True))
    alone = fit_film(read_dataset(measured(tmp_path / "a", Hidden(1.1, 1.0), 6)))
    both = fit_film(read_dataset(measured(tmp_path / "b", Hidden(1.1, 1.0), 6, more=coupon)))
    assert both.readings == alone.readings + 25
    assert both.stiffness_factor.low < 1.1 < both.stiffness_factor.high
    width, before = (fit.stiffness_factor.high - fit.stiffness_factor.low for fit in (both, alone))
    assert width < 1.02 * before
    (tmp_path / "b" / "force.csv").unlink()
    (tmp_path / "b" / "static.csv").unlink()
    with pytest.raises(InputError, match=r"coupon\.csv"):
        fit_film(read_dataset(tmp_path / "b"))


def test_both_doors_answer_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = measured(tmp_path / "d", Hidden(1.1, 0.9), 7)
    coupon = tmp_path / "coupon.csv"
    coupon.write_text("mode,stretch,nominal_stress_kPa\n" + "".join(
        f"uniaxial,{stretch},{20 * (stretch - stretch**-2) + 0.1 * (-1) ** number:.5f}\n"
        for number, stretch in enumerate(np.linspace(1.1, 3, 20).round(3).tolist())),
        encoding="utf-8")
    for given, words, named in (
            (data / "dataset.toml", [], {}), (coupon, ["--law", "neo_hooke", "--noise", "1 kPa"],
                                              {"law": ["neo_hooke"], "noise": "1 kPa"})):
        assert main(["material", "fit", str(given), *words, "--json"]) == 0
        result = tympan.fit_material(given, **named)
        assert json.loads(json.dumps(result.json())) == printed_record(capsys.readouterr().out)
        assert len(result.to_pandas())
        result.plot(tmp_path / f"{given.stem}.png")
        assert result.save(tmp_path / f"{given.stem}-saved").is_dir()
    for wrong in ((), (data, coupon)):
        with pytest.raises(InputError, match="one folder"):
            tympan.fit_material(*wrong)
    with pytest.raises(InputError, match="is for coupons"):
        tympan.fit_material(data, noise="1 kPa")


@pytest.mark.parametrize(("more", "words"), [
    (["--law", "gent"], "--law"), (["other"], "one folder"), (["--voltage", "3 kV"], "--voltage"),
    (["--branches", "1"], "no transient.csv")])
def test_what_is_no_such_dataset_is_refused(tmp_path: Path, more: list[str], words: str,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    data = runs_in_time.write(tmp_path / "data", Hidden(), Run(
        shapes=("middle",), masses=(2e-2,), length=1.0), 1)
    (data / "transient.csv").unlink()
    (data / "static.csv").write_text("specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
        f"middle,20,{voltage},2\n" for voltage in range(4)), encoding="utf-8")
    assert main(["material", "fit", str(data), *more]) == 2
    assert words in capsys.readouterr().err
