"""Held-out gain: what is held out, that the training never sees it, and that the numbers mean what
they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.costs import dear
from tests.support.straight_bench import MASSES, StraightBench
from tests.support.straight_bench import readings as straight_readings
from tests.support.trials import design, every_cause, few_causes, read, size_of
from tympan.studies.diagnosis.gain import (
    GainReport,
    SplitGain,
    _overall,
    excess_ratio,
    gain_of,
    splits_of,
)
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.smooth_misfit import MOST_ROWS, GaussianProcess
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.estimation.noise import Off

SIGMA = 10e-6


@pytest.fixture(scope="module")
def sagging(three_shapes: Simulation) -> tuple[ReadingTable, Judgement, GainReport]:
    """Readings with a sagging amplifier of twice the typical size."""
    cause = Cause("voltage_sag")
    table = read(three_shapes, design(SIGMA), (cause,), [size_of(cause, 2.0)], seed=1)
    judgement = judge(three_shapes, table, few_causes(three_shapes))
    return table, judgement, gain_of(three_shapes, table, few_causes(three_shapes), judgement)


def test_whole_shapes_masses_and_voltages_are_held_out(three_shapes: Simulation) -> None:
    table = design(SIGMA)
    splits, impossible = splits_of(three_shapes, table)
    assert [split[:2] for split in splits] == [
        ("shape", "circular"), ("shape", "elliptical-small"), ("shape", "elliptical-large"),
        ("mass", "17.9 g"), ("mass", "22.45 g"), ("voltage", "above 4.55 kV")]
    assert not impossible
    by_kind = {"shape": table.specimen, "mass": table.mass, "voltage": table.voltage > 4.55e3}
    for kind, _, test in splits:
        assert not set(by_kind[kind][test]) & set(by_kind[kind][~test])


def test_specimens_of_one_shape_are_held_out_together_and_alone(three_shapes: Simulation) -> None:
    circle, small, _ = three_shapes.setup.specimens
    twins = (circle, small, replace(circle, name="second circle"))
    simulation = replace(three_shapes, setup=replace(three_shapes.setup, specimens=twins))
    splits, impossible = splits_of(simulation, design(SIGMA))
    assert [name for kind, name, _ in splits if kind == "specimen"] == [
        "circular", "elliptical-small", "second circle"]
    assert impossible == (
        "circular and second circle cannot be held out: fewer than 2 shapes would be left",
        "elliptical-small cannot be held out: fewer than 2 shapes would be left")


def test_too_little_is_said(three_shapes: Simulation) -> None:
    table = design(SIGMA)
    few = table[np.flatnonzero((table.specimen == 0) & (table.mass < 20e-3))[:5]]
    splits, impossible = splits_of(three_shapes, few)
    assert not splits
    assert len(impossible) == 3


def test_a_part_of_which_no_reading_counts_is_not_held_out() -> None:
    bench, table = StraightBench(), straight_readings({Cause("sensor_zero"): 3.0})
    causes = [Cause("sensor_zero"), Cause("drift")]
    judged = judge(bench, table, causes)
    light, heavy = (f"{1e3 * mass:.4g} g" for mass in MASSES)
    rows = np.flatnonzero(table.mass == MASSES[1])
    off = Off(rows, np.full(len(rows), 1e-3))
    for terms, expected in (((), {light, heavy}), ((off,), {light})):
        noise = judged.table.noise.plus(*terms)
        misfit = replace(judged.misfit, table=judged.table.with_noise(noise))
        report = gain_of(bench, table, causes, replace(judged, misfit=misfit))
        assert {split.held_out for split in report.splits if split.kind == "mass"} == expected
        assert report.overall is not None
        assert report.overall.ratio < 1


def test_only_what_cannot_be_held_out_is_told_and_why() -> None:
    bench, table = StraightBench(), straight_readings({})
    assert splits_of(bench, table)[1] == ()
    two = table[table.specimen < 2].compact()
    splits, impossible = splits_of(bench, two)
    assert [kind for kind, _, _ in splits] == ["mass", "mass", "voltage"]
    assert impossible == tuple(
        f"{specimen.name} cannot be held out: fewer than 2 shapes would be left"
        for specimen in bench.setup.specimens[:2])


def test_nothing_wrong_gains_nothing(three_shapes: Simulation) -> None:
    table = read(three_shapes, design(SIGMA), (), [], seed=3)
    judgement = judge(three_shapes, table, every_cause(three_shapes))
    assert judgement.verdict == "nothing"
    assert gain_of(three_shapes, table, every_cause(three_shapes), judgement).overall is None


def test_the_cause_is_found_and_gains_on_every_split(sagging: tuple[ReadingTable, Judgement,
                                                                    GainReport]) -> None:
    report = sagging[2]
    assert len(report.splits) == 6
    for split in report.splits:
        assert split.chosen == (Cause("voltage_sag"),), split.held_out
        assert Cause("voltage_sag") not in split.wrong
        sums = [float(np.sum(split.errors[name]**2)) for name in ("before", "after", "noise")]
        assert excess_ratio(*sums, len(split.rows)) < 0.5, split.held_out
    assert report.overall is not None
    assert report.overall.ratio < 0.2
    assert report.overall.rmse_after < 2e6 * SIGMA < report.overall.rmse_before
    assert report.overall.low is not None
    assert report.overall.high is not None
    assert report.overall.low <= report.overall.ratio <= report.overall.high


def test_extrapolation_is_where_a_cause_beats_curves(sagging: tuple[ReadingTable, Judgement,
                                                                    GainReport]) -> None:
    """Above the voltages trained on, a Gaussian process and the best wrong cause fail where the
    cause does not."""
    above = next(split for split in sagging[2].splits if split.kind == "voltage").rmse
    assert above["before"] > 10 * SIGMA
    assert above["process"] > 3 * above["after"]
    assert above["rival"] > 3 * above["after"]


def test_training_never_sees_what_is_held_out(three_shapes: Simulation,
                                              sagging: tuple[ReadingTable, Judgement, GainReport]
                                              ) -> None:
    """Whatever the readings above 4.55 kV are, the predictions there are the same."""
    table, judgement, report = sagging
    index = next(k for k, candidate in enumerate(report.splits) if candidate.kind == "voltage")
    split = report.splits[index]
    held_out = np.isin(np.arange(len(table)), split.rows)
    spoiled = table.with_values(np.where(held_out, table.value + 50e-6, table.value))
    again = gain_of(three_shapes, spoiled, few_causes(three_shapes), judgement).splits[index]
    assert again.chosen == split.chosen
    moved = (spoiled.value - table.value)[held_out]
    for name in ("before", "after", "process", "rival"):
        np.testing.assert_allclose(again.errors[name] - split.errors[name], moved, atol=1e-12)


@pytest.mark.study(seconds=5)
def test_readings_that_do_not_count_do_not_count_in_the_gain(
        three_shapes: Simulation, sagging: tuple[ReadingTable, Judgement, GainReport]) -> None:
    """Three slips of a pen: errors on readings held out are those of the others."""
    table, _, clean = sagging
    values = table.value.copy()
    values[[13, 44, 74]] += [1e-3, -0.8e-3, 0.6e-3]
    spoiled, causes = table.with_values(values), few_causes(three_shapes)
    judgement = judge(three_shapes, spoiled, causes)
    assert np.flatnonzero(judgement.table.noise.off).tolist() == [13, 44, 74]
    report = gain_of(three_shapes, spoiled, causes, judgement)
    assert not set(np.concatenate([split.rows for split in report.splits])) & {13, 44, 74}
    assert report.overall is not None
    assert clean.overall is not None
    for name in ("rmse_before", "rmse_after"):
        assert getattr(report.overall, name) == pytest.approx(getattr(clean.overall, name), rel=0.3)
    assert report.overall.ratio == pytest.approx(clean.overall.ratio, abs=0.1)
    assert report.predictive is not None
    assert report.predictive.readings == sum(len(split.rows) for split in report.splits
                                             if not split.note)


def test_a_cause_on_the_specimen_held_out_does_not_count(three_shapes: Simulation) -> None:
    cause = Cause("prestretch_loss", "circular")
    table = read(three_shapes, design(SIGMA), (cause,), [0.03], seed=5)
    causes = few_causes(three_shapes, ("prestretch_loss",))
    judgement = judge(three_shapes, table, causes)
    report = gain_of(three_shapes, table, causes, judgement)
    notes = {split.held_out: split.note for split in report.splits if split.note}
    assert notes.pop("circular") == ("prestretch_loss of circular cannot be learned "
                                     "while circular is held out")
    assert all(note.startswith("nothing is seen to be wrong") for note in notes.values())
    assert len(notes) < len(report.splits) - 2
    assert report.overall is not None
    assert "circular" not in report.overall.held_out.split("(")[1].split(")")[0].split(", ")


@pytest.mark.study(seconds=5)
def test_a_mass_left_out_of_account_needs_two_masses(three_shapes: Simulation) -> None:
    """With one mass left it is one with the stiffness, exactly."""
    cause = Cause("unaccounted_mass")
    table = read(three_shapes, design(SIGMA), (cause,), [2e-3], seed=6)
    judgement = judge(three_shapes, table, few_causes(three_shapes))
    report = gain_of(three_shapes, table, few_causes(three_shapes), judgement)
    assert {split.held_out for split in report.splits if split.note} == {"17.9 g", "22.45 g"}


def test_excess_is_what_lies_beyond_noise() -> None:
    noise = 100 * 2.0**2
    assert excess_ratio(100 * (2.0**2 + 5.0**2), 100 * (2.0**2 + 1.5**2), noise,
                        100) == pytest.approx(0.3)
    assert excess_ratio(100 * (2.0**2 + 5.0**2), 0.9 * noise, noise, 100) == 0.0
    assert excess_ratio(noise, noise * (1 + 2 * 0.02**0.5), noise, 100) == pytest.approx(2**0.5)


def synthetic(generator: np.random.Generator, ramps: int, before: float, after: float
              ) -> tuple[list[SplitGain], ReadingTable]:
    """Errors in units of the noise: each ramp is off by one draw with these deviations, its
    readings by noise too."""
    ramp = np.repeat(np.arange(ramps), 20)
    states = States.of(ramp, np.full(len(ramp), 0.02), np.zeros(len(ramp)))
    table = rows(states, "displacement", 1.0)
    noise = generator.standard_normal(len(ramp))
    errors = [deviation * generator.standard_normal(ramps)[ramp] + noise
              for deviation in (before, after)]
    split = SplitGain("mass", "1 g", np.arange(len(ramp)), (), (), (),
                      {"noise": np.ones(len(ramp)), "before": errors[0], "after": errors[1]})
    return [split], table


@pytest.mark.study(seconds=3)
@pytest.mark.parametrize(("ramps", "after", "count"), [
    (6, 1.2, 300), (6, 0.0, 300), dear(24, 1.2, 60, seconds=3), dear(24, 0.1, 60, seconds=3),
    dear(24, 1.2, 300, seconds=27.0), dear(24, 0.1, 300, seconds=27.0)])
def test_the_interval_covers_the_true_ratio(ramps: int, after: float, count: int) -> None:
    """Drawn again as often; by ramps, not by readings, which would cover a third of the time less.

    Where little or nothing is left beyond noise, too, and with few ramps.
    """
    generator = np.random.default_rng(8)
    covered = 0
    for seed in range(count):
        gain = _overall(*synthetic(generator, ramps, 3.0, after), seed)
        assert gain is not None
        assert gain.low is not None
        assert gain.high is not None
        covered += gain.low <= after / 3 <= gain.high
    assert 0.87 <= covered / count <= 1.0


def test_a_process_predicts_as_well_as_it_claims() -> None:
    """Residuals drawn from a kernel on the grid: errors beyond noise are small inside and the
    prior's far outside."""
    generator = np.random.default_rng(4)
    table = design(1e-6)
    truth = GaussianProcess(table, np.zeros(len(table)), (0.5, 0.5), 0.5, 30e-6)
    draw = np.linalg.cholesky(truth.covariance(table, table) + 1e-16 * np.eye(len(table)))
    inside = np.arange(len(table)) % 3 == 1
    errors = []
    for _ in range(6):
        residual = (draw @ generator.standard_normal(len(table))
                    + 1e-6 * generator.standard_normal(len(table)))
        trained = GaussianProcess.trained(table[~inside].compact(), residual[~inside])
        errors.append(residual[inside] - trained.predicted(table[inside]))
    assert np.sqrt(np.mean(np.square(errors))) < 1.6e-6
    far = rows(States.of([0], [17.9e-3], [40e3]), "displacement", 1e-6)
    assert abs(trained.predicted(far)[0]) < 1e-9


def test_a_process_takes_a_range_as_a_difference() -> None:
    generator = np.random.default_rng(5)
    table = design(1e-6)
    process = GaussianProcess.trained(table, 20e-6 * np.sin(table.voltage / 2e3) + 1e-6
                              * generator.standard_normal(len(table)))
    ends = np.array([[14, 0], [44, 30], [70, 62]])
    ranges = replace(table[ends[:, 0]], since=ends[:, 1], kind=np.full(3, "range"))
    np.testing.assert_allclose(process.predicted(ranges), process.predicted(table[ends[:, 0]])
                               - process.predicted(table[ends[:, 1]]), atol=1e-15)


def test_many_rows_are_thinned() -> None:
    table = design(1e-6, voltages=400)
    process = GaussianProcess.trained(table, 1e-5 * np.cos(table.voltage / 2e3))
    assert len(process.train) == MOST_ROWS
    np.testing.assert_allclose(process.predicted(table), 1e-5 * np.cos(table.voltage / 2e3),
                               atol=1e-6)
