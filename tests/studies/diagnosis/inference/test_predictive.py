"""Predictive bands: that they hold what they say, and that curves end where equilibria do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from tests.support.trials import design, every_cause, read
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.gain import gain_of
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.predictive import Predictive
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reading_table import ReadingTable, States, rows
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.shown.curves import curves, dense

SIGMA = 10e-6


def test_a_band_of_one_member_is_that_of_its_normal_distribution() -> None:
    single = Predictive(np.ones((1, 2)), np.array([[1.0, 5.0]]), np.array([[3.0, 0.0]]))
    low, high = single.band(4.0)
    assert low == pytest.approx([1 - 1.959964 * 5, 5 - 1.959964 * 4], rel=1e-6)
    assert high == pytest.approx([1 + 1.959964 * 5, 5 + 1.959964 * 4], rel=1e-6)
    assert single.below(np.array([6.0, 5.0]), 4.0) == pytest.approx([norm.cdf(1), 0.5])


def test_a_band_of_two_members_holds_what_is_drawn_from_them() -> None:
    both = Predictive(np.array([[0.7], [0.3]]), np.array([[0.0], [6.0]]), np.array([[1.0], [2.0]]))
    generator = np.random.default_rng(1)
    second = generator.random(400_000) < 0.3
    drawn = np.where(second, 6 + 2 * generator.standard_normal(len(second)),
                     generator.standard_normal(len(second)))
    drawn += 0.5 * generator.standard_normal(len(second))
    low, high = both.band(0.5)
    assert np.quantile(drawn, (0.025, 0.975)) == pytest.approx([low[0], high[0]], abs=0.04)


def test_the_unknowns_of_a_fit_spread_as_draws_of_them_do(three_shapes: Simulation) -> None:
    cause = Cause("unaccounted_mass")
    fitted = fit(three_shapes, (cause,), read(three_shapes, design(SIGMA), (cause,), [2e-3], 1))
    table = design(SIGMA, voltages=4)
    spread = Predictive.of(three_shapes, [fitted], np.ones(1), table).deviation[0]
    drawn = np.random.default_rng(2).multivariate_normal(
        fitted.unknowns, np.linalg.inv(fitted.precision), 300)
    predicted = [three_shapes.predict(fitted.hypothesis, unknowns, table) for unknowns in drawn]
    assert spread == pytest.approx(np.std(predicted, axis=0), rel=0.15)


@pytest.mark.study(seconds=14)
def test_readings_held_out_lie_in_their_bands(three_shapes: Simulation) -> None:
    """Nulls and an effect; hundreds are in the study."""
    inside, count = 0.0, 0
    causes = every_cause(three_shapes)
    for seed, hypothesis, sizes in ((1, (), []), (2, (), []), (3, (), []),
                                    (4, (Cause("unaccounted_mass"),), [1.5e-3])):
        table = read(three_shapes, design(SIGMA), hypothesis, sizes, seed)
        predictive = gain_of(three_shapes, table, causes,
                             judge(three_shapes, table, causes)).predictive
        assert predictive is not None
        assert sum(predictive.pit) == predictive.readings
        inside += predictive.coverage_95 * predictive.readings
        count += predictive.readings
    assert 0.91 <= inside / count <= 0.985


def test_curves_go_to_the_highest_voltage_and_end_with_the_equilibria(
        three_shapes: Simulation) -> None:
    table = read(three_shapes, design(SIGMA, voltages=6), (), [], 1)
    judged = judge(three_shapes, table, ())
    columns = curves(three_shapes, judged, None)
    assert columns["voltage"].max() == table.voltage.max()
    assert len(np.unique(columns["specimen"])) == 3
    assert (columns["low"] < columns["baseline"]).all()
    assert (columns["baseline"] < columns["high"]).all()
    half = 0.5 * (columns["high"] - columns["low"])
    assert (half > 1.9 * judged.table.sigma[0]).all()
    assert (half < 3.0 * judged.table.sigma[0]).all()
    further = table.joined(_at(12e3)).with_sigma(np.full(len(table) + 1, SIGMA))
    beyond = replace(judged, misfit=replace(judged.misfit, table=further))
    far = curves(three_shapes, beyond, None)
    circle = (far["specimen"] == "circular") & (far["mass"] == 17.9e-3)
    voltage, there = far["voltage"][circle], np.isfinite(far["baseline"][circle])
    assert there[voltage < 6.5e3].all()
    assert not there[voltage > 10e3].any()
    assert np.array_equal(np.isfinite(far["low"][circle]), there)


def _at(voltage: float) -> ReadingTable:
    return rows(States.of([0], [17.9e-3], [voltage]), "displacement", SIGMA, 5e-3)


def test_ranges_and_ways_have_curves_of_their_own() -> None:
    table = design(SIGMA, voltages=3)
    ways = replace(table, states=replace(table.states, direction=np.where(
        table.states.elapsed % 120 > 0, 1.0, -1.0)))
    lines = dense(ways)
    assert set(lines.states.direction[lines.state].tolist()) == {1.0, -1.0}
    ends = np.array([[2, 0], [5, 3]])
    ranges = replace(table[ends[:, 0]], since=ends[:, 1], kind=np.full(2, "range"))
    lines = dense(ranges)
    assert set(lines.kind.tolist()) == {"range"}
    assert (lines.states.voltage[lines.since] == 0).all()
