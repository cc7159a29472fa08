"""A misfit that nothing explains: in limits, in predictions, and in what is advised."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.trials import design, read
from tympan.studies.diagnosis.explanations.registry import explanation_of
from tympan.studies.diagnosis.fits.evidence import interval
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.smooth_misfit import Discrepancy, GaussianProcess
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.patterns.reading_patterns import PATTERNS
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.sentences import pattern_checks

SIGMA = 10e-6
MASS = (Cause("unaccounted_mass"),)


@pytest.mark.study(seconds=24)
def test_limits_of_a_louder_fit_are_those_with_more_noise(three_shapes: Simulation) -> None:
    table = read(three_shapes, design(SIGMA, voltages=5), MASS, [2e-3], seed=1)
    quiet = fit(three_shapes, MASS, table)
    loud = fit(three_shapes, MASS, table.with_sigma(3 * table.sigma))
    for number in range(3):
        widths = [np.ptp(interval(fitted, number)) for fitted in (quiet.louder(3.0), loud, quiet)]
        assert widths[0] == pytest.approx(widths[1], rel=0.05)
        assert widths[0] == pytest.approx(3 * widths[2], rel=0.05)
    assert quiet.misfit == pytest.approx(1.0, abs=0.3)
    bent = table.with_values(table.value + 50e-6 * np.sin(np.arange(len(table))))
    found = fit(three_shapes, MASS, bent)
    freedom = len(table) - 3
    assert found.misfit == pytest.approx((found.chi_squared / freedom) ** 0.5)
    assert found.misfit > 3


@pytest.mark.study(seconds=14)
def test_predictions_are_off_by_what_a_discrepancy_does_there_and_to_the_fit(
        three_shapes: Simulation) -> None:
    """Of draws of the process, added to readings, of which one film is held out."""
    whole = design(SIGMA, voltages=6)
    process = GaussianProcess(whole, np.zeros(len(whole)), (0.5, 0.5), 0.5, 100e-6)
    held = whole.specimen == 2
    exact = three_shapes.predict((), np.zeros(2), whole)
    spread = np.linalg.cholesky(process.covariance(whole, whole)
                                + 1e-4 * process.size**2 * np.eye(len(whole)))
    generator, scores = np.random.default_rng(3), []
    for _ in range(40):
        drawn = spread @ generator.standard_normal(len(whole))
        table = whole.with_values(exact + drawn + SIGMA * generator.standard_normal(len(whole)))
        train, test = table[~held].compact(), table[held].compact()
        fitted = fit(three_shapes, (), train)
        shown = three_shapes.prediction((), fitted.unknowns, test)
        variance = Discrepancy(process, train).variance(fitted, shown.jacobian, test)
        scores.append((test.value - shown.values) / np.sqrt(variance + SIGMA**2))
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, abs=0.2)


@pytest.mark.study(seconds=10)
def test_the_size_of_a_discrepancy_is_found_beside_what_the_fit_took(
        three_shapes: Simulation) -> None:
    table = design(SIGMA, voltages=6)
    smooth = 150e-6 * (table.voltage / 6.5e3) ** 2 * (table.specimen - 1)
    table = read(three_shapes, table, (), [], seed=2)
    table = table.with_values(table.value + smooth)
    found = Discrepancy.of(fit(three_shapes, (), table), table)
    assert found is not None
    assert 30e-6 < found.process.size < 1e-3


def _advice(simulation: Simulation, table: ReadingTable, more: np.ndarray) -> list[str]:
    """What to look at where readings are off by that, and there is no effect to think of."""
    table = read(simulation, table, (), [], seed=5)
    judged = judge(simulation, table.with_values(table.value + more), ())
    assert judged.verdict == "unexplained"
    explanation = explanation_of(judged)
    return pattern_checks(judged) if explanation is None else [explanation.check]


def test_advice_follows_the_pattern(three_shapes: Simulation) -> None:
    table = design(SIGMA, voltages=8)
    mixed = replace(table, order=np.random.default_rng(1).permutation(len(table)) * 1.0)
    line = (mixed.order - mixed.order.mean()) / len(mixed)
    assert _advice(three_shapes, mixed, 300e-6 * line)[0] == PATTERNS["order"].check
    one = np.where(table.specimen == 1, 1.0, 0.0)
    assert _advice(three_shapes, table, 150e-6 * one)[0] == PATTERNS["specimen"].check.format(
        name="elliptical-small")
    bent = 80e-6 * np.sin(5 * (table.voltage / 6.5e3) ** 2)
    assert _advice(three_shapes, table, bent)[0] == PATTERNS["voltage"].check
    ramp = (table.specimen == 2) & (table.mass > 20e-3)
    assert "elliptical-large under 22.45 g" in _advice(three_shapes, table, 200e-6 * ramp)[0]


@pytest.mark.parametrize(("masses", "wrong", "error"), [
    ((12e-3, 17.9e-3, 22.45e-3), 12e-3, 0.3e-3),
    ((10e-3, 14e-3, 17.9e-3, 22.45e-3), 14e-3, 0.5e-3)])
def test_one_weight_of_several_is_told(three_shapes: Simulation, masses: tuple[float, ...],
                                       wrong: float, error: float) -> None:
    table = design(SIGMA, voltages=6, masses=masses)
    off = three_shapes.predict(MASS, np.array([0, 0, error]), table) - three_shapes.predict(
        (), np.zeros(2), table)
    advice = _advice(three_shapes, table, np.where(table.mass == wrong, off, 0.0))
    assert advice == [PATTERNS["load"].check.format(name=f"{1e3 * wrong:g} g")]
