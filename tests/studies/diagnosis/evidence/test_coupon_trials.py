"""Trials of coupons (make hidden): closed forms with an effect are what the engine shows with it.

And what whole runs of these trials found wrong in the engine stays mended.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.trials.coupons.readings import DESIGN, FILM, Film, at_rest
from benchmarks.trials.strata import strips
from benchmarks.trials.strata.evidence import write_dataset
from benchmarks.trials.strata.strips import StripPlan, strip_evidence, strip_sheet
from benchmarks.trials.synthetic_trials import Truth
from benchmarks.trials.trial import Lab
from tests.support import datasets
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import judge_dataset
from tympan.studies.diagnosis.evidence.coupon_readings import coupon_readings
from tympan.studies.diagnosis.fits.fitting import nominal_fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.reduced.simulation import Simulation

#: Of a film of Gent's law that is mounted at √5, strips with free widths under voltage among them.
HIDDEN = (("strain_stiffening", (-0.3,)), ("strain_stiffening", (0.5,)),
          ("second_invariant", (-0.4,)), ("permittivity_stretch", (0.8,)),
          ("permittivity_stretch", (-0.6,)), ("temperature", (-4.0,)), ("width_not_free", (0.35,)),
          ("width_not_held", (0.7,)))


def plan_of(runs: tuple[strips.Run, ...], noise: float = 0.01, count: int = 12) -> StripPlan:
    return StripPlan(strips.film_alone(), runs, count, noise)


def written(folder: Path, plan: StripPlan, truth: Truth, seed: int = 3, exact: bool = False,
            **head: object) -> Path:
    stresses = strip_evidence(plan, truth)
    assert stresses is not None
    sheet = strip_sheet(plan, stresses, np.random.default_rng(seed), exact)
    return write_dataset(folder, plan.design, {"coupon.csv": sheet}, 1e-5, **head)


@pytest.mark.parametrize(("name", "sizes"), HIDDEN)
def test_closed_forms_are_what_the_engine_shows(tmp_path: Path, name: str, sizes: tuple[float, ...]
                                                ) -> None:
    """Of mounted films, in three modes, under voltage, warm, to the digits of a file."""
    truth = Truth(1.08, 0.95, (Cause(name),), sizes, "equations")
    folder = written(tmp_path / "data", plan_of(strips.AT_REST), truth, exact=True)
    readings = coupon_readings(read_dataset(folder))
    simulation = Simulation(readings.setup, (), evidence=readings.evidence)
    shown = simulation.predict(truth.hypothesis, truth.unknowns, readings.table)
    assert shown == pytest.approx(readings.table.value, rel=1e-7, abs=1e-2)
    bare = simulation.predict((), truth.unknowns[:2], readings.table)
    assert np.abs(bare - readings.table.value).max() > 100.0


@pytest.mark.parametrize(("modulus", "time"), [(15e3, 20.0), (40e3, 300.0), (10e3, 2.0)])
def test_branches_by_another_integrator_are_what_the_engine_shows(
        tmp_path: Path, modulus: float, time: float) -> None:
    """At two rates, held and in two modes, to 3 Pa."""
    truth = Truth(1.08, 0.95, (Cause("creep"),), (modulus, float(np.log(time / 10))), "equations")
    folder = written(tmp_path / "data", plan_of(strips.IN_TIME, count=24), truth, exact=True)
    readings = coupon_readings(read_dataset(folder))
    simulation = Simulation(readings.setup, (), evidence=readings.evidence)
    shown = simulation.predict(truth.hypothesis, truth.unknowns, readings.table)
    assert shown == pytest.approx(readings.table.value, abs=3.0)


def test_the_other_family_and_the_other_evolution_are_others_but_alike() -> None:
    """Stresses within 0.02 %; branches of a second alike, slow ones not."""
    first = np.linspace(3.0, 19.0, 400)
    ratio = strips._yeoh(first) / strips._gent(first)
    assert 1e-4 < np.abs(ratio - 1).max() < 2e-4
    run, film = strips.IN_TIME[0], Film(branch=(10e3, 1.0))
    time, stretch = run.places(24)
    for constant, most in ((0.1, 1.0), (100.0, np.inf)):
        stated, logarithmic = (replace(film, branch=(10e3, constant), logarithmic=other)
                               .branch_stress("uniaxial", time, stretch) for other in (False, True))
        change = np.abs(stated - logarithmic).max()
        assert change < most
        assert most < np.inf or change > 500.0


def test_a_trial_is_named_by_all_modes_and_seen_in_none_by_one() -> None:
    """A film that stiffens as it warms, which only one pair of runs shows."""
    records = {record.population: record for record in Lab(2026).run("coupons", 0)}
    alone, whole = records["coupons, uniaxial alone"], records["coupons"]
    assert whole.truth == ("temperature",)
    assert alone.verdict == "nothing"
    assert whole.named == ("temperature",)
    assert whole.identifiable


@pytest.mark.parametrize(("power", "stiffness", "permittivity"), [
    (12.8, 0.9, 1.1), (15.0, 1.0, 1.0), (15.0, 0.9, 1.1)])
def test_a_law_far_off_is_no_reason_to_refuse(
        tmp_path: Path, power: float, stiffness: float, permittivity: float) -> None:
    """Stiffness that grows with the thirteenth power of the temperature: the search for the nominal
    model went where a charged strip has no width, and the readings were refused."""
    truth = Truth(stiffness, permittivity, (Cause("temperature"),), (power,), "equations")
    folder = written(tmp_path / "data", plan_of(strips.AT_REST), truth, exact=True)
    readings = coupon_readings(read_dataset(folder))
    simulation = Simulation(readings.setup, (), evidence=readings.evidence)
    nominal = nominal_fit(simulation, readings.table)
    assert nominal.possible
    assert nominal.chi_squared > 1e3
    assert nominal.unknowns[1] > 0.5


@pytest.mark.parametrize("seed", range(3))
def test_runs_that_are_stretched_and_held_tell_their_noise(tmp_path: Path, seed: int) -> None:
    """The corner between both was taken for noise, three times as large as that is; strips that
    differ by 3 % were then something wrong."""
    plan = strips.laboratory(strips.film_alone(), strips.IN_TIME)
    folder = written(tmp_path / "data", plan, Truth(1.1, 1.0), seed,
                     strip_scatter=strips.STRIPS_DIFFER)
    _, judgement, _ = judge_dataset(read_dataset(folder))
    assert judgement.verdict == "nothing"
    assert judgement.test.noise == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("seed", [2, 6])
def test_noise_stated_too_large_makes_strips_differ_no_less(tmp_path: Path, seed: int) -> None:
    """By what is left the noise was found to be a third, and strips that differ by 4 % were then
    taken to differ by a third of that: `permittivity_stretch` was named."""
    factors = 1 + 0.04 * np.random.default_rng(seed).standard_normal(len(DESIGN))
    head, *lines = at_rest(Film(), 0.005, seed, factors.tolist()).splitlines()
    cells = [line.rpartition(",") for line in lines]
    text = "\n".join([head, *(f"{cell},{4 * float(sigma)}" for cell, _, sigma in cells)])
    folder = datasets.write_dataset(tmp_path / "data", "strip_scatter = 0.04\n" + FILM, (),
                                    coupon=text + "\n")
    _, judgement, _ = judge_dataset(read_dataset(folder))
    assert judgement.verdict in ("nothing", "ambiguous")
