"""Effects hidden in taps, lines over films and runs in time: what is read by one means against
another, a seeded trial, and what records add up to; the study has more (make hidden)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from benchmarks.trials.axisymmetric_readings import pulled
from benchmarks.trials.hidden_effects import lab_of, study
from benchmarks.trials.rates.kinds import rates
from benchmarks.trials.rates.strata import strata_page, strata_rates
from benchmarks.trials.record import Record
from benchmarks.trials.strata import steps
from benchmarks.trials.strata.evidence import evidence, sheets, write_dataset
from benchmarks.trials.strata.steps import StepPlan, step_evidence, step_sheets
from benchmarks.trials.strata.trials import (
    STRATA,
    at_rest,
    dataset_of,
    evidence_of,
    without_dwell,
)
from benchmarks.trials.synthetic_trials import FINEST, ROUGH, Truth, draw_rough
from benchmarks.trials.trial import Lab
from tests.oracles.axisymmetric import Film, Ogden, solve_deflection
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.calibration import calibrated
from tympan.studies.diagnosis.diagnose import judge_dataset
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.identifiability import SEEN
from tympan.studies.diagnosis.readings import prepared_readings

#: Single effects that films by both means may have, with their sizes.
HIDDEN = (("parallel_spring", 6.0), ("electrode_mass", 0.1), ("unaccounted_mass", 1e-3),
          ("strain_stiffening", 0.3), ("sensor_gain", 0.02))


@pytest.mark.parametrize(("name", "size"), HIDDEN)
def test_taps_and_lines_are_the_same_by_equations_and_by_elements(name: str, size: float) -> None:
    """Heaves within 2 µm, the weight of grease too, frequencies within 3e-4, lines within 3 µm."""
    plan = STRATA["mixture"].ask(0).plan
    truth = Truth(1.05, 0.97, (Cause(name),), (size,), "equations", FINEST)
    read, elements = (evidence(plan, replace(truth, means=means))
                      for means in ("equations", "elements"))
    assert read is not None
    assert elements is not None
    assert elements.deflections == pytest.approx(read.deflections, abs=2e-6)
    assert len(read.frequencies) == len(read.heights) * 2 == 8
    for row, frequency in read.frequencies.items():
        assert elements.frequencies[row] == pytest.approx(frequency, rel=3e-4)
    for row, heights in read.heights.items():
        assert elements.heights[row] == pytest.approx(heights, abs=3e-6)


@pytest.mark.parametrize("means", ["equations", "another law"])
def test_a_step_ends_where_the_film_rests(means: str) -> None:
    """A branch of a second, by both laws of evolution."""
    plan = steps.slow()
    states = plan.design.table.states
    plan = replace(plan, length=10.0, dwell=10.0, design=plan.design.only(
        (states.mass == steps.MASSES[-1]) & (states.specimen == 0) & (states.voltage > 3e3)))
    truth = Truth(1.05, 0.97, (Cause("creep"),), (20e3, float(np.log(0.1))), means)
    read, none = step_evidence(plan, truth), step_evidence(plan, Truth(1.05, 0.97))
    assert read is not None
    assert none is not None
    assert read.deflections == pytest.approx(none.deflections, abs=2e-8)
    (*_, samples), (*_, rest) = *read.steps, *none.steps
    assert samples[-1] == pytest.approx(rest[-1], abs=2e-8)
    assert samples[len(plan.times[0])] < rest[-1] - 2e-6


def judged(plan: StepPlan, truth: Truth, folder: Path, seed: int = 1) -> tuple[str, str, str]:
    """The verdict and what it names by all of a plan's readings, and the verdict at rest."""
    read = step_evidence(plan, truth)
    assert read is not None
    files = step_sheets(plan, read, 20e-6, np.random.default_rng(seed))
    dataset = read_dataset(write_dataset(folder, plan.design, files, 20e-6))
    _, judgement, _ = judge_dataset(dataset)
    _, alone, _ = judge_dataset(without_dwell(dataset))
    return judgement.verdict, ", ".join(map(str, judgement.named)), alone.verdict


@pytest.mark.study
@pytest.mark.parametrize("age", [1800.0, 3600.0])
@pytest.mark.parametrize("means", ["equations", "another law"])
def test_films_mounted_lately_are_named_by_a_step(tmp_path: Path, age: float, means: str) -> None:
    """Half of what a stated branch of an hour relaxes is still to come, or two fifths."""
    truth = Truth(1.05, 0.97, (Cause("mounting_age"),), (1 / age,), means)
    assert judged(steps.slow(steps.SLOW_BRANCH), truth, tmp_path)[:2] == ("named", "mounting_age")


@pytest.mark.study
def test_films_mounted_for_ever_are_not_called_young(tmp_path: Path) -> None:
    plan = steps.slow(steps.SLOW_BRANCH)
    assert judged(plan, Truth(1.05, 0.97), tmp_path)[0] == "nothing"


@pytest.mark.study(seconds=22)
def test_what_heaves_leave_open_is_named_by_taps() -> None:
    """A trial of the study: 3.3 g left out of account, by the equations."""
    records = {record.population: record for record in Lab(2026).run("frequencies", 34)}
    alone, tapped = records["frequencies, at rest"], records["frequencies"]
    assert alone.truth == ("unaccounted_mass",)
    assert alone.verdict == "ambiguous"
    assert "unaccounted_mass" in alone.listed
    assert tapped.named == ("unaccounted_mass",)
    assert tapped.identifiable
    assert not alone.identifiable


def test_a_film_sags_under_its_grease(tmp_path: Path) -> None:
    """By 76 µm under 1 kg/m², twenty usual masses; the reduced model within 1 µm."""
    plan = STRATA["lines"].ask(0).plan
    truth = Truth(1.05, 0.97, (Cause("electrode_mass"),), (1.0,), "elements", FINEST)
    read = evidence(plan, truth)
    assert read is not None
    files = sheets(plan, read, 10e-6, None)
    prepared = prepared_readings(read_dataset(write_dataset(tmp_path, plan.design, files, 10e-6)))
    nominal = calibrated(prepared.setup, prepared.table)
    rows = nominal.table.rows_of["film"]
    shown = nominal.simulation.predict(truth.hypothesis, truth.unknowns, nominal.table)[rows]
    assert shown == pytest.approx(nominal.table.value[rows], abs=1e-6)
    bare = replace(nominal.simulation, masses=None)
    flat = bare.predict(truth.hypothesis, truth.unknowns, nominal.table)[rows]
    assert np.abs(flat - nominal.table.value[rows]).max() > 50e-6


@pytest.mark.study(seconds=33)
def test_a_permittivity_that_rises_is_not_taken_for_a_film_that_hardens_less(tmp_path: Path
                                                                              ) -> None:
    """Falling ones are seen by nobody here, so that a diagnosis that asks for one sign alone leaves
    them out: a trial of the study, which got the other's name."""
    plan = STRATA["lines"].ask(5).plan
    truth = Truth(1.192, 1.07, (Cause("permittivity_stretch"),), (-0.854,), "elements", FINEST)
    read = evidence(plan, truth)
    assert read is not None
    files = sheets(plan, read, 10e-6, np.random.default_rng(5))
    del files["field.csv"]
    dataset = read_dataset(write_dataset(tmp_path, plan.design, files, 10e-6))
    _, judgement, _ = judge_dataset(dataset)
    assert Cause("permittivity_stretch") in judgement.misfit.invisible
    assert Cause("permittivity_stretch") in judgement.weighed.suspects
    assert Cause("strain_stiffening") not in judgement.named


@pytest.mark.study(seconds=17)
def test_a_few_taps_do_not_tell_their_noise_by_themselves() -> None:
    """A trial of the study in which nothing can be seen: by the scatter of twelve taps about
    smooth curves alone they were a tenth as noisy as stated, and unexplained."""
    records = Lab(2026).run("frequencies", 9)
    assert all(record.seen < 1 for record in records)
    assert [record.verdict for record in records] == ["nothing", "nothing"]


def test_records_add_up_before_and_after() -> None:
    """Of three ambiguous at rest two are named by taps, one of them wrongly."""
    blank = Record("frequencies, at rest", 0, "equations", ("drift",), 0, 30.0, 1.0, "ambiguous",
                   listed=("drift", "sensor_zero"), widths=(2.0,))
    after = replace(blank, population="frequencies", seen=90.0, told=50.0, listed=())
    records = [*(replace(blank, number=number) for number in range(3)),
               replace(after, number=0, verdict="named", named=("drift",)),
               replace(after, number=1, verdict="named", named=("sensor_zero",)),
               replace(after, number=2, verdict="ambiguous", listed=("drift",))]
    by_words = {rate.what: rate for rate in strata_rates(records)}
    assert by_words["frequencies, identifiable: it is named"].hits == 1
    assert by_words["frequencies: another is named"].hits == 1
    text = strata_page(records, "about")
    assert "| frequencies | 3 | at rest | 0 | 3 | 0 | 0 | 0 | 0 |" in text
    assert "| frequencies | 3 | 1 | 1 | 1 | 0 |" in text
    assert "| frequencies #1 | all | equations | drift | 2 | sensor_zero |" in text


def test_on_a_rough_bench_one_effect_is_large_and_all_others_are_a_little_there() -> None:
    """Also in what is read: all of them show in the steps beside the large one."""
    plan = STRATA["rough transients"].ask(2).plan
    assert isinstance(plan, StepPlan)
    causes = [Cause(name) for name in (*steps.FAST, *steps.AT_REST)]
    large, generator = (Cause("plate_damping"),), np.random.default_rng(4)
    draws = [draw_rough(generator, causes, large, "equations") for _ in range(200)]
    widths = np.array([truth.widths for truth in draws])
    of_large = widths[:, causes.index(large[0])]
    others = np.delete(np.abs(widths), causes.index(large[0]), axis=1)
    assert of_large.min() >= 3
    assert of_large.max() <= 20
    assert np.sqrt(np.mean(others**2)) == pytest.approx(ROUGH, rel=0.05)
    truth = draws[0]
    alone = truth.of(large)
    assert (alone.hypothesis, alone.stiffness) == (large, truth.stiffness)
    assert alone.widths == (of_large[0],)
    every, some = step_evidence(plan, truth), step_evidence(plan, alone)
    assert every is not None
    assert some is not None
    assert np.abs(every.deflections - some.deflections).max() > 20e-6
    assert np.abs(every.steps[0][2] - some.steps[0][2]).max() > 20e-6


def test_rates_of_rough_benches_are_of_what_is_large() -> None:
    """A small effect that is named with nothing large counts by itself."""
    blank = Record("rough transients", 0, "equations", ("creep",), 0, 900.0, 90.0, "named",
                   named=("creep", "sensor_zero"))
    records = [blank, replace(blank, number=1, named=("sensor_zero",)),
               replace(blank, number=2, verdict="unexplained", named=()),
               replace(blank, number=3, truth=(), seen=0.0, told=0.0, named=("sensor_zero",))]
    rough = [rate for rate in rates(records) if rate.count in (1, 3)]
    assert [(rate.hits, rate.count) for rate in rough[-4:]] == [(1, 3), (1, 3), (1, 3), (1, 1)]


@pytest.mark.study
def test_strata_are_taken_up_again(tmp_path: Path) -> None:
    """Two trials of each, without the force laws that readings at rest need; none runs twice."""
    counts, keep = dict.fromkeys(STRATA, 2), tmp_path / "trials.jsonl"
    lab = lab_of(11, 1, counts)
    assert "paper" not in vars(lab)
    records = study(lab, counts, 1, keep)
    assert study(lab, counts, 1, keep) == records
    assert all(record.verdict not in ("refused", "raised") for record in records)
    assert max(record.seen for record in records) > SEEN


@pytest.mark.study(seconds=38)
def test_what_readings_at_rest_leave_open_is_named_by_a_tester(tmp_path: Path) -> None:
    """A spring of 3 N/m beside all films: at rest a zero of the sensor may be it as well."""
    plan, spring = STRATA["force"].ask(0).plan, Cause("parallel_spring")
    read = evidence_of(plan, Truth(1.05, 0.97, (spring,), (3.0,), "equations"))
    dataset = dataset_of(tmp_path / "data", plan, read, 20e-6, 1, False)
    before, after = (judge_dataset(some, seed=1)[1] for some in (at_rest(dataset), dataset))
    assert before.verdict == "ambiguous"
    assert {spring, Cause("sensor_zero")} <= set(before.weighed.suspects)
    assert after.verdict == "named"
    assert after.named == (spring,)


@pytest.mark.parametrize(("name", "size"), [
    ("gauge_zero", 5e-3), ("gauge_gain", 0.02), ("displacement_zero", -3e-4),
    ("tester_compliance", 1e-3), ("parallel_spring", 6.0), ("voltage_sag", 1e-9)])
def test_a_tester_shows_what_two_roots_say(name: str, size: float) -> None:
    """The balance of tester and film found by bisection, of films by the equations."""
    specimen = STRATA["force"].ask(0).plan.design.setup.specimens[1]
    truth = Truth(1.05, 0.97, (Cause(name),), (size,), "equations")
    shown = np.array([-1e-3, 2e-3, 5e-3])
    force = pulled(specimen, truth, 4000.0, shown)
    assert force is not None
    sizes, law = {name: size}, specimen.membrane.material
    film = Film(10e-3, 60e-3, specimen.membrane.thickness, specimen.membrane.prestretch[0],
                Ogden(tuple(1.05 * mu for mu in law.mu), tuple(law.alpha)),
                0.97 * specimen.membrane.relative_permittivity)
    seen = 4000.0 / (1 + 4000.0**2 * sizes.get("voltage_sag", 0.0))

    def pull(plate: float) -> float:
        spring = sizes.get("parallel_spring", 0.0)
        return solve_deflection(film, plate, seen).force + spring * plate

    for at, read in zip(shown.tolist(), force.tolist(), strict=True):
        plate = brentq(lambda w, at=at: w + sizes.get("tester_compliance", 0.0) * pull(w)
                       + sizes.get("displacement_zero", 0.0) - at, at - 3e-3, at + 3e-3, xtol=1e-12)
        expected = ((1 + sizes.get("gauge_gain", 0.0)) * pull(plate)
                    + sizes.get("gauge_zero", 0.0))
        assert read == pytest.approx(expected, abs=1e-8)
