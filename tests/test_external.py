"""Cases of docs/external.md on their own data, in seconds: what each section's numbers rest on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.external import (
    by_command,
    elastosil,
    rubber,
    spot,
    table2,
    table2_ranges,
    vhb_temperature,
    vhb_voltage,
)
from benchmarks.external.__main__ import CASES
from benchmarks.external.case import HERE
from tympan.studies.diagnosis.inference.predictive import Predictive
from tympan.studies.diagnosis.reading_table import States, rows

DOCS = Path(__file__).parents[1] / "docs"


@pytest.mark.parametrize("name", CASES)
def test_every_case_has_its_words_and_its_place_on_the_page(name: str) -> None:
    assert (HERE / "text" / f"{name}.md").read_text(encoding="utf-8").startswith("## ")
    page = (DOCS / "external.md").read_text(encoding="utf-8")
    assert f"(`{name}`)" in page
    assert "{" not in page


def test_a_law_of_one_constant_is_fitted_and_judged_as_by_hand() -> None:
    coupons = rubber.load("treloar_1944")
    result = rubber.foretold("neo_hooke", coupons, ("uniaxial",))
    tests = coupons[coupons.mode == "uniaxial"]
    slope = tests.stretch - tests.stretch**-2
    modulus = float(slope @ tests.stress / (slope @ slope))
    assert result.values == pytest.approx([modulus])
    sheets = coupons[coupons.mode == "equibiaxial"]
    missed = modulus * (sheets.stretch - sheets.stretch**-5) - sheets.stress
    exact = np.sqrt(np.mean(missed**2) / np.mean(sheets.stress**2))
    assert result.error["equibiaxial"] == pytest.approx(exact)
    assert result.admissible
    assert result.held_out == ("equibiaxial", "pure_shear")


def test_what_the_third_mode_says_has_a_sign() -> None:
    coupons = rubber.load("kawabata_1981")
    result = rubber.foretold("yeoh", coupons, ("uniaxial", "pure_shear"))
    assert "too soft at large stretches" in rubber.wrong(result, "equibiaxial")
    assert rubber.wrong(result, "uniaxial") == "nothing by more than a twentieth"


def test_the_strip_drops_as_measured_and_an_ideal_one_more() -> None:
    strip = vhb_voltage.load(23)
    stretches = (1.5, 2.0, 2.5, 2.9)
    up = strip.loading
    drops = np.interp(stretches, strip.stretch[up], strip.drop[up]) / 1e3
    assert drops == pytest.approx([7.0, 8.0, 8.9, 9.7], abs=0.06)
    ideal = np.interp(stretches, strip.stretch[up], strip.ideal(4.6)[up]) / 1e3
    assert ideal == pytest.approx([8.8, 11.7, 14.7, 17.0], abs=0.06)


@pytest.mark.parametrize(("number", "size"), [(1, 0.3), (2, 0.6), (5, 0.4), (6, 3.0)])
def test_a_cause_put_in_is_the_one_that_fits_best(number: int, size: float) -> None:
    strip = vhb_voltage.load(23)
    cause = vhb_voltage.CAUSES[number]
    noise = 100.0 * np.random.default_rng(number).standard_normal(len(strip.drop))
    put_in = replace(strip, drop=cause.drop(strip, strip.permittivity, size) + noise)
    fits = [vhb_voltage.fit(other, put_in) for other in vhb_voltage.CAUSES]
    best = min(fits, key=lambda result: result.misfit)
    assert best.cause is cause
    assert best.limits[0] < size < best.limits[1]
    assert best.rms < 150.0


def test_what_temperature_and_rate_do_is_found_again_where_it_is_put_in() -> None:
    tests = vhb_temperature.runs()
    assert len(tests) == 18
    usual = next(run.stress for run in tests if (run.temperature, run.rate) == (20, 0.05))
    for cause, constants in ((vhb_temperature.CAUSES[4], (0.8, 0.12)),
                             (vhb_temperature.CAUSES[5], (0.3, 70.0))):
        put_in = [replace(run, stress=cause.stress(run, usual, np.array(constants)))
                  for run in tests]
        result = vhb_temperature.fit(cause, put_in)
        assert result.values == pytest.approx(constants, rel=1e-5)
        assert result.misfit[-20] < 1e-4
        others = [vhb_temperature.fit(other, put_in).over(vhb_temperature.FITTED)
                  for other in vhb_temperature.CAUSES if other is not cause]
        assert min(others) > 0.003


def test_the_membrane_is_a_drum_that_air_and_grease_slow() -> None:
    assert elastosil.frequency(1.3) == pytest.approx(elastosil.in_vacuo(1.3), rel=1e-7)
    # In vacuo all mass is on the film: f goes with one over its root.
    bare = elastosil.DENSITY * elastosil.THICKNESS / 1.3**2
    greased = elastosil.frequency(1.3, grease=bare)
    assert greased == pytest.approx(elastosil.in_vacuo(1.3) / np.sqrt(2), rel=1e-7)
    # The air of a piston as large is more than that of a drum.
    radius = elastosil.SIDE / np.sqrt(np.pi)
    piston = 16 / (3 * np.pi) * elastosil.AIR * radius
    slowest = elastosil.in_vacuo(1.3) / np.sqrt(1 + piston / bare)
    assert slowest < elastosil.frequency(1.3, air=elastosil.AIR) < elastosil.in_vacuo(1.3)


def test_finite_elements_and_equations_have_one_disc() -> None:
    assert abs(spot.point(1.2).error) < 1e-5


def test_other_levels_move_the_ends_of_the_ranges(tmp_path: Path) -> None:
    ends = table2.ends_of_seeds(5)
    spread = [levels.high - levels.low for levels in ends]
    assert spread == sorted(spread)
    assert all(0 <= levels.low < levels.high <= 7 for levels in ends)
    folder = table2.with_ends(ends[0], tmp_path / "data")
    rows = (folder / "range.csv").read_text().splitlines()
    assert rows[0].startswith("specimen,mass_g,voltage_min_kV")
    assert rows[3].split(",")[2:] == [f"{ends[0].low:.4f}", f"{ends[0].high:.4f}", "2.06"]


def test_ranges_between_other_ends_are_the_same_rows_at_other_voltages() -> None:
    states = States.of([0, 1, 0, 1], [17.9e-3] * 4, [0.0, 0.0, 7e3, 7e3])
    lengths = rows(states, "displacement", 1e-5, 2e-3)[np.array([2, 3])]
    ranges = replace(lengths, kind=np.full(2, "range"), since=np.array([0, 1]))
    moved = table2_ranges.Ends("seed", 0.25, 6.5).moved(ranges)
    assert moved.states.voltage.tolist() == [250.0, 250.0, 6500.0, 6500.0]
    assert moved.voltage.tolist() == [6500.0, 6500.0]
    assert ranges.voltage.tolist() == [7e3, 7e3]


def test_seeds_are_mixed_evenly() -> None:
    """Of two expectations 4 apart the median lies between, and the band holds both."""
    parts = [Predictive(np.ones((1, 1)), np.array([[mean]]), np.zeros((1, 1)))
             for mean in (0.0, 4.0)]
    both, noise = table2_ranges.marginal(parts), np.array([1.0])
    assert both.weight.sum() == pytest.approx(1.0)
    assert table2_ranges.median(both, noise)[0] == pytest.approx(2.0, abs=1e-6)
    low, high = both.band(noise)
    # Half of each, so that each end leaves 5 % of its own.
    assert (low[0], high[0]) == pytest.approx((-1.6449, 5.6449), abs=0.01)


def test_the_command_finds_a_second_invariant_in_three_modes_but_not_all_of_them() -> None:
    """The equibiaxial sheets of Kawabata's rubber pull more than its strips tell."""
    said = by_command.judged(rubber.DATASETS["Kawabata 1981, neo_hooke"])
    best = said["attempts"][0]
    assert best["effect"] == "second_invariant"
    assert best["parameters"]["s"]["low"] > 0
    assert best["explains"] > 0.4
    assert said["verdict"] == "unexplained"
    assert "`second_invariant`" in rubber.effects_with_sizes(said)


def test_the_command_lists_width_and_permittivity_for_the_strip_under_voltage() -> None:
    """As one class, each with the whole misfit: w/2 and n/2 are the power q of the case's fit."""
    said = by_command.judged(vhb_voltage.DATASETS["23 °C, up"])
    assert said["verdict"] == "ambiguous"
    assert said["indistinguishable"] == [["permittivity_stretch", "width_not_held"]]
    sizes = {attempt["effect"]: next(iter(attempt["parameters"].values()))["value"]
             for attempt in said["attempts"] if attempt["explains"] > 0.98}
    cause = next(cause for cause in vhb_voltage.CAUSES if cause.symbol == "q")
    power = vhb_voltage.fit(cause, vhb_voltage.load(23)).size
    assert sizes.keys() == {"permittivity_stretch", "width_not_held"}
    assert np.array(list(sizes.values())) / 2 == pytest.approx(power, abs=0.01)


@pytest.mark.study(seconds=10)
def test_the_command_finds_most_of_the_warm_strips_in_the_temperature() -> None:
    """But says that it does not explain them whole; its power is the share a degree of the fit."""
    said = by_command.judged(vhb_temperature.DATASETS["20, 40, 60 °C, three rates"])
    assert said["verdict"] == "unexplained"
    best = said["attempts"][0]
    assert best["effect"] == "temperature"
    assert best["explains"] > 0.8
    assert best["parameters"]["p"]["value"] / 293.15 == pytest.approx(-0.0112, abs=0.001)
    assert said["gain"]["rmse_after_kPa"] < 0.5 * said["gain"]["rmse_before_kPa"]
