"""Coupons as evidence: what is hidden in stresses by closed forms is named, or never another.

No stress here is the engine's: see :mod:`benchmarks.trials.coupons.readings`.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from _pytest.mark.structures import ParameterSet
from scipy.constants import epsilon_0

from benchmarks.trials.coupons.readings import (
    DESIGN,
    FILM,
    LESS,
    MODULUS,
    PERMITTIVITY,
    STIFFER,
    STRETCH,
    THICKNESS,
    Film,
    at_rest,
    in_time,
)
from tests.support.costs import dear
from tests.support.datasets import SPECIMEN, write_dataset
from tests.support.library import WHOLE, library_of
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import diagnose
from tympan.studies.diagnosis.evidence.coupon_readings import coupon_readings
from tympan.studies.diagnosis.inference.verdict import ALARM, judge
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects import EFFECTS


def written(folder: Path, film: Film, noise: float, seed: int) -> Path:
    """A dataset of coupons at rest."""
    return write_dataset(folder, FILM, (), coupon=at_rest(film, noise, seed))


def written_in_time(folder: Path, film: Film, noise: float, seed: int) -> Path:
    """A dataset of coupons in time."""
    return write_dataset(folder, FILM, (), coupon=in_time(film, noise, seed))


def judged(folder: Path) -> tuple[str, list[str]]:
    """The verdict, and the causes that are named, or of which one is suspected.

    "unusual" where noise alone is left about a film whose factors are far from 1.
    """
    readings = coupon_readings(read_dataset(folder))
    simulation = Simulation(readings.setup, (), evidence=readings.evidence)
    judgement = judge(simulation, readings.table, readings.causes)
    verdict = "unusual" if judgement.unusual and judgement.test.p_value >= ALARM else (
        judgement.verdict)
    return verdict, [cause.name for cause in judgement.named or judgement.weighed.suspects]


HIDDEN = {
    "strain_stiffening": [Film(hardening=h) for h in (-0.1, 0.1, 0.5)],
    "second_invariant": [Film(second=s) for s in (-0.04, 0.05, 0.3)],
    "permittivity_stretch": [Film(falling=n) for n in (0.3, 0.6, 1.2)],
    "temperature": [Film(power=p) for p in (-3.0, 0.5, 1.0)],
    "width_not_free": [Film(held=w) for w in (0.15, 0.4, 0.9)],
    "width_not_held": [Film(let=w) for w in (0.15, 0.4, 0.9)],
}


#: What strips and the benches of actuators have.
FEW = ("unaccounted_mass", "sensor_zero", "temperature", "width_not_free")

#: Processor seconds of the sizes that take more than 3 s.
SECONDS = {("strain_stiffening", 2): 7.0, ("second_invariant", 2): 12.0}
#: Which of the two noises of an effect's second size are judged in every run: both where the louder
#: one leaves nothing to be seen.
ALWAYS = {effect: (0.01, 0.04) if effect.startswith("width") else (0.01,) for effect in HIDDEN}


def trials() -> Iterator[ParameterSet]:
    """Every effect at its second size; other sizes and noises, which show the same, are dear."""
    for effect, films in HIDDEN.items():
        for number, film in enumerate(films):
            for noise in (0.01, 0.04):
                name = f"{effect}-{number}-{noise}"
                if number == 1 and noise in ALWAYS[effect]:
                    yield pytest.param(effect, film, noise, id=name)
                else:
                    yield dear(effect, film, noise, name=name,
                               seconds=SECONDS.get((effect, number), 3.0))


@pytest.mark.parametrize(("effect", "film", "noise"), [*trials()])
def test_what_is_hidden_is_named_or_not_told_but_never_another(
        tmp_path: Path, effect: str, film: Film, noise: float) -> None:
    verdict, causes = judged(written(tmp_path / "data", film, noise, seed=7))
    assert verdict != "unexplained"
    # A permittivity of a few per cent of the stated one is told where its way is lost in noise.
    assert verdict != "unusual" or (effect == "permittivity_stretch" and film.falling > 1)
    if verdict == "named":
        assert causes == [effect]
    if verdict == "ambiguous":
        assert effect in causes
    if noise == 0.01:
        assert verdict in ("named", "ambiguous")


def test_a_wrong_unit_of_stress_is_no_stiffer_film(tmp_path: Path) -> None:
    folder = written(tmp_path / "data", Film(), 0.01, seed=7)
    file = folder / "coupon.csv"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("nominal_stress_kPa", "nominal_stress_MPa"), encoding="utf-8")
    with pytest.raises(InputError, match="times those of the stated material"):
        coupon_readings(read_dataset(folder))


@pytest.mark.study(seconds=5)
@pytest.mark.parametrize("noise", [0.01, dear(0.04, seconds=6.0)])
def test_hardening_with_a_second_invariant_is_both(tmp_path: Path, noise: float) -> None:
    """Neither alone explains three modes of one film, and no third takes the place of one."""
    hidden = {"strain_stiffening", "second_invariant"}
    film = Film(hardening=0.3, second=0.1)
    verdict, causes = judged(written(tmp_path / "data", film, noise, seed=7))
    assert verdict == "named" if noise == 0.01 else verdict in ("named", "ambiguous")
    assert set(causes) == hidden if verdict == "named" else hidden <= set(causes)


@pytest.mark.parametrize("seed", range(6))
def test_nothing_hidden_is_nothing(tmp_path: Path, seed: int) -> None:
    noise = (0.01, 0.04)[seed % 2]
    assert judged(written(tmp_path / "data", Film(), noise, seed)) == ("nothing", [])


@pytest.mark.parametrize(("branch", "noise"), [
    dear((4e3, 30.0), 0.01, seconds=3.0), dear((30e3, 10.0), 0.01, seconds=2.0),
    ((15e3, 200.0), 0.01), ((4e3, 30.0), 0.04), dear((30e3, 10.0), 0.04, seconds=2.0),
    dear((15e3, 200.0), 0.04, seconds=2.0)])
def test_a_branch_that_the_law_lacks_is_creep(tmp_path: Path, branch: tuple[float, float],
                                              noise: float) -> None:
    verdict, causes = judged(written_in_time(tmp_path / "data", Film(branch=branch), noise, seed=5))
    assert verdict in ("named", "ambiguous")
    assert causes[0] == "creep"
    if noise == 0.01:
        assert (verdict, causes) == ("named", ["creep"])


class Twice(Film):
    """A film with a slow branch of 20 kPa beside the other."""

    def branch_stress(self, mode: str, time: Any, stretch: Any) -> Any:
        slow = Film(branch=(20e3, 100.0)).branch_stress(mode, time, stretch)
        return super().branch_stress(mode, time, stretch) + slow


def test_two_branches_that_the_law_lacks_are_both_creep(tmp_path: Path) -> None:
    """Within their limits."""
    found = diagnose(read_dataset(written_in_time(
        tmp_path / "data", Twice(branch=(20e3, 5.0)), 0.003, seed=5)))
    named = [cause for cause in found.causes if cause.named]
    assert [(cause.effect, cause.again) for cause in named] == [("creep", False), ("creep", True)]
    for time, cause in zip((5.0, 100.0), sorted(
            named, key=lambda cause: cause.parameters["tau"].value), strict=True):
        size = cause.parameters["mu"], cause.parameters["tau"]
        assert size[0].low < 20 < size[0].high
        assert size[1].low < time < size[1].high


def test_in_time_nothing_hidden_is_nothing_and_a_hardening_film_does_not_creep(
        tmp_path: Path) -> None:
    assert judged(written_in_time(tmp_path / "none", Film(), 0.01, seed=5)) == ("nothing", [])
    verdict, causes = judged(written_in_time(tmp_path / "hard", Film(hardening=0.3), 0.01, seed=5))
    assert (verdict, causes) == ("named", ["strain_stiffening"])


@pytest.mark.parametrize(("film", "effect", "values"), [
    (Film(hardening=0.4), "strain_stiffening", (0.4,)),
    (Film(second=-0.3), "second_invariant", (-0.3,)),
    (Film(falling=0.7), "permittivity_stretch", (0.7,)),
    (Film(power=-2.0), "temperature", (-2.0,)), (Film(held=0.3), "width_not_free", (0.3,)),
    (Film(let=0.6), "width_not_held", (0.6,))])
def test_stresses_are_those_of_closed_forms(tmp_path: Path, film: Film, effect: str,
                                            values: tuple[float, ...]) -> None:
    """Of every effect in every mode, at both voltages and temperatures, to rounding."""
    readings = coupon_readings(read_dataset(written(tmp_path / "data", film, 0.01, 0)))
    (tests,) = readings.evidence
    factors = np.log([STIFFER, LESS])
    setup = Simulation(readings.setup, (), evidence=(tests,)).extended((), factors)
    shown, possible = tests.shown(EFFECTS[effect].apply(setup, values))
    expected = np.concatenate([film.stress(mode, STRETCH, voltage, celsius)
                               for mode, voltage, celsius in DESIGN])
    assert possible.all()
    assert shown == pytest.approx(expected, rel=1e-7, abs=1e-2)


def test_branches_are_those_of_their_differential_equation(tmp_path: Path) -> None:
    branch = (15e3, 20.0)
    data = read_dataset(written_in_time(tmp_path / "data", Film(branch=branch), 1e-5, 0))
    readings = coupon_readings(data)
    setup = Simulation(readings.setup, (), evidence=readings.evidence).extended(
        (), np.log([STIFFER, 1.0]))
    shown, _ = readings.evidence[0].shown(EFFECTS["creep"].apply(setup, branch))
    assert data.coupons is not None
    assert shown == pytest.approx(data.coupons.stress, abs=4.0)


def test_a_free_strip_widens_under_voltage_as_its_balance_says(tmp_path: Path) -> None:
    """Nothing pulls across: μ (λ₂ - 1/(λ² λ₂³)) = ε E² λ² λ₂, so λ₂⁴ = 1/(λ² (1 - ε E² λ²/μ)).

    Where ε E² λ² is above μ, no width bears the voltage.
    """
    stretch = np.array([1.2, 1.5, 1.8, 2.1])
    field = epsilon_0 * PERMITTIVITY * (5e3 / THICKNESS) ** 2
    lines = "".join(f"uniaxial,{value},10,{kilovolt}\n" for kilovolt in (5, 25) for value in
                    stretch)
    folder = write_dataset(tmp_path / "data", FILM, specimens=(),
                           coupon="mode,stretch,nominal_stress_kPa,voltage_kV\n" + lines)
    readings = coupon_readings(read_dataset(folder))
    shown, possible = readings.evidence[0].shown(readings.setup)
    across = (stretch**2 * (1 - field * stretch**2 / MODULUS)) ** -0.25
    expected = MODULUS * (stretch - 1 / (stretch**3 * across**2)) - field * stretch * across**2
    assert possible[:4].all()
    assert not possible[4:].any()
    assert shown[:4] == pytest.approx(expected, rel=1e-9)


def drops(folder: Path, film: Film, noise: float, *, wrong_law: float = 0.0, head: str = ""
          ) -> Path:
    """Pure-shear runs without voltage and under two; what both lack of the law is ``wrong_law``."""
    lines, generator = [], np.random.default_rng(3)
    for number, voltage in enumerate((0.0, 4e3, 6e3)):
        stretch = np.linspace(1.1, 3.0, 60) + 0.01 * number
        stress = film.stress("pure_shear", stretch, voltage) + wrong_law * np.sin(3 * stretch)
        stress = stress + generator.normal(0, noise, len(stretch))
        lines += [f"pure_shear,{x:.8f},{y / 1e3:.8f},{voltage / 1e3},{noise / 1e3}\n"
                  for x, y in zip(stretch, stress, strict=True)]
    return write_dataset(folder, head + FILM, specimens=(), coupon=(
        "mode,stretch,nominal_stress_kPa,voltage_kV,sigma_kPa\n" + "".join(lines)))


@pytest.mark.study(seconds=3)
def test_drops_are_judged_whatever_the_law_is(tmp_path: Path) -> None:
    """A law that is wrong by a wave of 5 kPa hides no voltage that is right, nor the cause of one
    that is wrong."""
    drop = 'coupon_reading = "drop"\n'
    right = drops(tmp_path / "right", Film(), 50.0, wrong_law=5e3, head=drop)
    assert judged(right) == ("nothing", [])
    verdict, _ = judged(drops(tmp_path / "law", Film(), 50.0, wrong_law=5e3))
    assert verdict == "unexplained"
    verdict, causes = judged(drops(tmp_path / "falling", Film(falling=0.6), 50.0, wrong_law=5e3,
                                   head=drop))
    assert verdict in ("named", "ambiguous")
    assert "permittivity_stretch" in causes


def test_falling_permittivity_and_a_strip_that_narrows_are_one_class_in_drops(
        tmp_path: Path) -> None:
    """Held strips tell them by nothing: λ^(1 - n) and λ^(1 - 2q) are one curve, so neither is
    named, and no pair of both."""
    folder = drops(tmp_path / "data", Film(falling=0.6), 50.0,
                   head='coupon_reading = "drop"\n')
    content = diagnose(read_dataset(folder)).json()
    assert content["verdict"] == "ambiguous"
    assert content["indistinguishable"] == [["permittivity_stretch", "width_not_held"]]
    first = content["causes"][:2]
    assert {cause["effect"] for cause in first} == {"permittivity_stretch", "width_not_held"}
    assert all(not cause["with"] and cause["probability"] > 0.2 for cause in first)


@pytest.mark.study(seconds=3)
@pytest.mark.parametrize("seed", [0, dear(1, seconds=5.0)])
def test_strips_that_differ_are_no_misfit_once_that_is_said(tmp_path: Path, seed: int) -> None:
    """Each run another strip, 4 % stiffer or softer: without a word of it something seems wrong.

    With it nothing is, and what warmth does is still named.
    """
    def differing(name: str, head: str, film: Film) -> Path:
        factors = 1 + 0.04 * np.random.default_rng(seed).standard_normal(len(DESIGN))
        return write_dataset(tmp_path / name, head + FILM, (),
                             coupon=at_rest(film, 0.005, seed, factors.tolist()))

    said = "strip_scatter = 0.04\n"
    assert judged(differing("silent", "", Film()))[0] != "nothing"
    assert judged(differing("said", said, Film())) == ("nothing", [])
    verdict, causes = judged(differing("warm", said, Film(power=-5.0)))
    assert verdict in ("named", "ambiguous")
    assert "temperature" in causes


def test_one_command_writes_page_readings_and_films_at_each_temperature(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = written(tmp_path / "data", Film(power=-3.0), 0.01, 2)
    assert main(["diagnose", str(folder), "-o", str(tmp_path / "out"), "--json"]) == 0
    content: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert content["verdict"] == "named"
    power = content["causes"][0]["parameters"]["p"]
    assert power["low"] < -3 < power["high"]
    assert content["gain"]["rmse_after_kPa"] < 0.5 * content["gain"]["rmse_before_kPa"]
    page = (tmp_path / "out" / "diagnosis.html").read_text(encoding="utf-8")
    assert "kPa" in page
    assert "µm" not in page
    extended = tmp_path / "out" / "extended"
    film, warm = (load_specimen(extended / f"film{name}.toml").membrane
                  for name in ("", " at 50 C"))
    assert film.temperature_power == pytest.approx(power["value"])
    ratio = warm.material.mu / film.material.mu
    assert ratio == pytest.approx((323.15 / 293.15) ** power["value"])
    assert Rig.read(extended / "rig.toml") == Rig()


@pytest.mark.study(seconds=5)
@pytest.mark.parametrize("library", [FEW, dear(WHOLE, seconds=72.0)], ids=["few", "whole"])
def test_coupons_beside_an_actuator_are_judged_by_themselves_and_with_it(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], library: tuple[str, ...]) -> None:
    """Coupons of an actuator's film: a verdict on both, their own one in the same file and a page.

    Lines of actuators' readings alone are in readings.csv.
    """
    rows = "".join(f"A,{mass},{kv},{1.9 * mass / 17.9 + 0.03 * kv**2}\n"
                   for mass in (17.9, 22.45) for kv in (0, 2, 4, 6))
    coupons = (written(tmp_path / "film", Film(power=-3.0), 0.01, 2) / "coupon.csv").read_text()
    specimen = SPECIMEN.format(name="A").replace('material = "vhb-4910"', (
        '[specimen.membrane.material]\nlaw = "neo_hooke"\nmu = "20 kPa"'))
    folder = write_dataset(tmp_path / "data", 'name = "x"\nnoise = "20 um"\n' + specimen, (),
                           static="specimen,mass_g,voltage_kV,displacement_mm\n" + rows,
                           coupon=coupons)
    with library_of(*library):
        assert main(["diagnose", str(folder), "-o", str(tmp_path / "out"), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert "baseline_rmse_um" in content["misfit"]
    assert content["coupons"]["causes"][0]["effect"] == "temperature"
    assert any("weighed together" in words for words in content["warnings"])
    assert "stress" not in (tmp_path / "out" / "readings.csv").read_text(encoding="utf-8")
    assert (tmp_path / "out" / "coupons" / "diagnosis.html").exists()
    assert "coupons/diagnosis.html" in (tmp_path / "out" / "diagnosis.html").read_text(
        encoding="utf-8")


@pytest.mark.parametrize(("text", "head", "words"), [
    ("mode,stretch,nominal_stress_kPa\nuniaxial,1.1,3\n", FILM, "at least 5 readings"),
    ("mode,stretch,nominal_stress_kPa,voltage_kV\n" + "pure_shear,1.1,3,6\n" * 6,
     'coupon_reading = "drop"\n' + FILM, "without"),
    ("mode,stretch,nominal_stress_kPa,specimen\n" + "pure_shear,1.1,3,b\n" * 6,
     FILM + FILM.replace('name = "film"\n', "", 1).replace("film", "other").replace(
         "1 mm", "2 mm"), "names a strip"),
    ("mode,stretch,nominal_stress_kPa,voltage_kV\nuniaxial,1.1,3,-6\n", FILM, "0 to 1000 kV"),
    ("mode,stretch,nominal_stress_kPa,temperature_C\nuniaxial,1.1,3,293.15e3\n", FILM,
     "degrees Celsius"),
], ids=["few", "no reference", "whose film", "negative voltage", "kelvins"])
def test_bad_coupons_get_one_message(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                     text: str, head: str, words: str) -> None:
    folder = write_dataset(tmp_path / "data", head, specimens=(), coupon=text)
    assert main(["diagnose", str(folder), "-o", str(tmp_path / "out")]) == 2
    out, err = capsys.readouterr()
    assert words in err
    assert out == ""


def test_only_effects_that_a_coupon_could_show_are_weighed(tmp_path: Path) -> None:
    dataset = read_dataset(written(tmp_path / "data", Film(), 0.01, 0))
    names = {cause.name for cause in coupon_readings(dataset).causes}
    assert names == {"strain_stiffening", "second_invariant", "permittivity_stretch", "temperature",
                     "width_not_free", "width_not_held", "amplifier_gain", "voltage_sag"}
