"""Coupons weighed together with actuators of their film: the film softens more than stated.

Readings of the actuators are by the axisymmetric equations, of the coupons by closed forms, of a
film 2 % stiffer and as much less permittive (the verdict case ``softer-film``).
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.trials.coupons.readings import DESIGN, FILM, STRETCH, Film, at_rest
from benchmarks.trials.strata.trials import at_rest as actuators_alone
from benchmarks.trials.trial import Lab
from benchmarks.trials.verdict_cases.made import FOLDER
from tests.support.datasets import write_dataset
from tests.support.library import among, library_of
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import judge_dataset, weighed_together
from tympan.studies.diagnosis.evidence.coupon_readings import coupon_readings
from tympan.studies.diagnosis.evidence.coupons import BATCH
from tympan.studies.diagnosis.evidence.kind import PreparedReadings
from tympan.studies.diagnosis.evidence.registry import PLATES, REST
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.reduced.simulation import Simulation

CASE = FOLDER / "softer-film"
STIFFENING = Cause("strain_stiffening")
SOME = ("strain_stiffening", "second_invariant", "permittivity_stretch", "unaccounted_mass",
        "parallel_spring", "amplifier_gain", "sensor_zero", "temperature", "width_not_free")


@pytest.fixture(scope="module")
def together() -> tuple[PreparedReadings, Judgement]:
    """The verdict on all readings of the case, among effects of every kind of evidence."""
    with library_of(*SOME):
        readings, judgement, _ = judge_dataset(read_dataset(CASE))
    return readings, judgement


@pytest.mark.study(seconds=40)
def test_a_cause_of_the_film_is_named_among_all_effects() -> None:
    _, judgement, _ = judge_dataset(read_dataset(CASE))
    assert judgement.named == (STIFFENING,)


@pytest.mark.study(seconds=40)
def test_a_cause_of_the_film_is_named_by_both(together: tuple[PreparedReadings, Judgement]) -> None:
    """With one size for both, and its limits about the true one."""
    readings, judgement = together
    assert judgement.verdict == "named"
    assert judgement.named == (STIFFENING,)
    assert {"temperature", "width_not_free", "sensor_zero"} <= {
        cause.name for cause in readings.causes}
    chosen = judgement.chosen
    assert chosen is not None
    assert abs(chosen.unknowns[2] + 0.3) < 3 * chosen.deviations[2] < 0.06
    assert any("weighed together with 72 readings" in remark for remark in readings.remarks)


@pytest.mark.study(seconds=30)
@among(*SOME, seconds=30)
def test_noise_of_actuators_is_told_over_what_is_stated(
        tmp_path: Path, together: tuple[PreparedReadings, Judgement]) -> None:
    """Also beside coupons, where it is found before all are judged."""
    assert together[1].noise_over(together[0].table) == pytest.approx(1.0, abs=0.1)
    folder = shutil.copytree(CASE, tmp_path / "quieter")
    words = (CASE / "dataset.toml").read_text(encoding="utf-8")
    assert 'noise = "20 um"' in words
    (folder / "dataset.toml").write_text(words.replace("20 um", "10 um"), encoding="utf-8")
    readings, judgement, _ = judge_dataset(read_dataset(folder))
    assert judgement.verdict == "named"
    assert judgement.noise_over(readings.table) == pytest.approx(2.0, rel=0.2)


@pytest.mark.study
def test_actuators_alone_leave_it_open() -> None:
    _, judgement, _ = judge_dataset(actuators_alone(read_dataset(CASE)))
    assert judgement.verdict == "ambiguous"
    assert {STIFFENING, Cause("permittivity_stretch")} <= set(judgement.weighed.suspects)


def test_rows_are_what_each_simulation_predicts(together: tuple[PreparedReadings, Judgement]
                                                ) -> None:
    """Actuators' rows as without coupons; derivatives of all as differences, in any order."""
    _, judgement = together
    simulation, table = judgement.simulation, judgement.table
    hypothesis, unknowns = (STIFFENING,), np.array([0.05, -0.04, -0.25])
    joint = simulation.prediction(hypothesis, unknowns, table)
    alone = judgement.of_first()
    assert alone.simulation.evidence == tuple(PLATES)
    assert len(alone.table) == 160
    assert joint.values[:160] == pytest.approx(
        alone.simulation.predict(hypothesis, unknowns, alone.table), rel=1e-12)
    for number in range(3):
        step = np.zeros(3)
        step[number] = 1e-4
        sides = [simulation.prediction(hypothesis, unknowns + sign * step, table).extended
                 for sign in (-1, 1)]
        change = (sides[1] - sides[0]) / 2e-4
        assert joint.jacobian[:, number] == pytest.approx(
            change, abs=1e-4 * np.abs(change).max())
    turn = np.random.default_rng(0).permutation(len(table))
    turned = simulation.prediction(hypothesis, unknowns, table[turn]).values
    assert turned == pytest.approx(joint.values[turn], rel=1e-9, abs=1e-12)


def test_effects_of_rows_that_do_not_feel_them_change_nothing(
        together: tuple[PreparedReadings, Judgement]) -> None:
    _, judgement = together
    stress = judgement.table.kind == "stress"
    for name, size, silent in (("temperature", 5.0, ~stress), ("parallel_spring", 3.0, stress),
                               ("width_not_free", 0.3, ~stress), ("sensor_zero", 1e-4, stress)):
        shown, bare = (judgement.simulation.predict(hypothesis, unknowns, judgement.table)
                       for hypothesis, unknowns in (((Cause(name),), np.array([0.0, 0.0, size])),
                                                    ((), np.zeros(2))))
        assert shown[silent] == pytest.approx(bare[silent], rel=1e-12)
        assert np.abs(shown[~silent] - bare[~silent]).max() > 0


Written = Callable[..., Path]


@pytest.fixture
def written(tmp_path: Path) -> Written:
    def write(film: Film, name: str = "data", head: str = FILM) -> Path:
        return write_dataset(tmp_path / name, head, (), coupon=at_rest(film, 1e-3, 1))

    return write


def test_films_that_differ_by_a_tenth_are_one_standard_deviation_apart(written: Written) -> None:
    """In stiffness, or in what voltage does; by another law they are still far apart."""
    readings = coupon_readings(read_dataset(written(Film())))
    simulation = Simulation(readings.setup, (), evidence=readings.evidence)
    judgement = judge(simulation, readings.table, readings.causes)
    (tests,), films = readings.evidence, replace(simulation, evidence=(REST,))
    joint, table = weighed_together(films, readings.table[:0], tests, judgement)
    assert joint.evidence == (REST, tests)
    assert len(table) == len(DESIGN) * len(STRETCH)

    def apart(film: Film) -> float:
        """How much two films' stresses are apart, in standard deviations."""
        change = np.concatenate([film.stress(mode, STRETCH, voltage, celsius)
                                 - Film().stress(mode, STRETCH, voltage, celsius)
                                 for mode, voltage, celsius in DESIGN])
        return float(np.linalg.norm(table.noise.whitened(change[tests.rows])))

    assert apart(Film(stiffer=Film.stiffer * (1 + BATCH))) == pytest.approx(1.0, abs=0.1)
    assert apart(Film(less=Film.less * (1 + BATCH))) == pytest.approx(1.0, abs=0.1)
    assert apart(Film(second=0.02)) > 10
    assert apart(Film(power=0.3)) > 10


def test_coupons_of_another_film_are_not_weighed_with_it(written: Written) -> None:
    readings = coupon_readings(read_dataset(written(Film())))
    (tests,) = readings.evidence
    assert tests.of_one_film(readings.setup)
    for change in ({"thickness": 2e-3}, {"prestretch": (2.0, 2.0)}):
        other = readings.setup.with_films(lambda film, to=change: replace(film, **to))
        assert not tests.of_one_film(other)


@pytest.mark.study
def test_a_trial_is_named_by_both_that_neither_misleads() -> None:
    """Of the study: a second invariant, which actuators show in nothing."""
    records = {record.population: record for record in Lab(2026).run("film", 2)}
    assert records["film, actuators alone"].verdict == "nothing"
    assert records["film"].named == ("second_invariant",)


def test_expected_is_what_is_hidden() -> None:
    expected = json.loads((CASE / "expected.json").read_text())
    assert expected["verdict"] == ["named"]
    assert expected["parameters"]["strain_stiffening"]["h"]["value"] == -0.3
