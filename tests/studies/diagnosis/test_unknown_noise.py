"""Readings whose noise nobody states: it is bounded by how successive readings scatter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.support.library import among
from tests.support.trials import FEW, design, few_causes
from tympan.reports.diagnosis.page import verdict_words
from tympan.studies.data.dataset import read_dataset
from tympan.studies.data.noise import ramp_scatter
from tympan.studies.diagnosis.diagnose import diagnose
from tympan.studies.diagnosis.inference.noise_terms import WANDERS, Missed, chain_of, noise_terms
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.result import Misfit
from tympan.studies.diagnosis.sentences import WORDS, headline
from tympan.studies.estimation.noise import SCATTER, Noise

CASE = Path(__file__).parent / "bench" / "unknown-noise"
SIGMA = 20e-6


def remembering(correlation: float, ramp: np.ndarray, seed: int) -> np.ndarray:
    """Errors of variance 1, each like the one before on its ramp."""
    fresh = np.random.default_rng(seed).standard_normal(len(ramp))
    errors = fresh.copy()
    for row in range(1, len(ramp)):
        if ramp[row] == ramp[row - 1]:
            errors[row] = (correlation * errors[row - 1]
                           + (1 - correlation**2) ** 0.5 * fresh[row])
    return errors


def unstated(table: ReadingTable, values: np.ndarray) -> ReadingTable:
    """The table with values of a noise that nobody states."""
    return table.with_values(values).with_noise(Noise.of(np.full(len(table), 50e-6), SCATTER))


def test_readings_scatter_about_their_ramps_by_their_noise() -> None:
    """Of 20 µm, rounded to 10 µm; four degrees of freedom tell it within a factor of 2."""
    scatter = ramp_scatter(read_dataset(CASE))
    assert scatter is not None
    assert scatter.freedom.sum() == 4
    assert 10e-6 < scatter.size < 40e-6


@pytest.mark.study(seconds=8)
@among(*FEW, seconds=40)
def test_a_smooth_misfit_is_told_with_its_cause_and_the_noise_below_which_it_counts() -> None:
    """3 g more than the labels say; "agrees", with a noise of 111 µm, would be wrong."""
    result = diagnose(read_dataset(CASE))
    assert result.verdict == "ambiguous"  # a cause is named where the noise is known
    first = max(result.causes, key=lambda cause: cause.probability)
    assert first.effect == "unaccounted_mass"
    (size,) = first.parameters.values()
    assert size.low is not None
    assert size.high is not None
    assert size.low < 3.0 < size.high
    assert result.misfit.noise == pytest.approx(20, rel=0.5)
    assert result.misfit.baseline_rmse == pytest.approx(156, rel=0.05)
    assert result.misfit.counts_below is not None
    assert 20 < result.misfit.counts_below < 156
    words = verdict_words(result)
    assert "No noise is stated: this misfit counts if the sensor's errors stay below" in words
    assert "it is noise" not in words


def test_a_sensor_that_wanders_or_nothing_known_is_one_whole_sentence() -> None:
    misfit = Misfit(baseline_rmse=80.0, noise=10.0, noise_from=SCATTER, noise_over_stated=None,
                    p_value=1e-9, counts_below=45.0, where="")
    why = WORDS["wanders"].format(misfit=misfit, unit="µm")
    words = headline("unexplained", [], [], "", cannot_tell=why)
    assert words == (
        "Cannot tell, because no noise is stated. The readings are off smoothly, by 80 µm. The "
        "sensor's error may wander by as much. With a noise below 45 µm, stated in dataset.toml, "
        "it is not the sensor. If it is not the sensor: the simulation is wrong, and no effect in "
        "the library explains it.")


@pytest.mark.parametrize("seed", [1, 2])
def test_a_sensor_that_wanders_gets_no_name(three_shapes: Simulation, seed: int) -> None:
    """By 5 times what successive readings scatter: nobody stated that it does not."""
    table = design(SIGMA)
    plain = three_shapes.predict((), np.array([0.05, -0.03]), table)
    values = plain + 5 * SIGMA * remembering(0.96, table.ramp, seed)
    judged = judge(three_shapes, unstated(table, values), few_causes(three_shapes))
    assert not judged.named
    assert judged.verdict == "nothing" or judged.sensor.possible
    assert judged.verdict == "nothing" or judged.sensor.size > 3 * SIGMA


@pytest.mark.parametrize(("correlation", "told"), [(0.7, True), (0.98, False)])
def test_errors_remember_no_more_than_a_few_times_the_scatter(three_shapes: Simulation,
                                                              correlation: float, told: bool
                                                              ) -> None:
    table = design(SIGMA)
    errors = SIGMA * remembering(correlation, table.ramp, 3)
    models = [Missed(errors, np.ones((len(table), 1)))]
    noise = Noise.of(table.sigma, SCATTER)
    chain = chain_of(table)
    (bounded,) = noise.plus(*noise_terms(noise, models, chain=chain, most=WANDERS)).memories
    (free,) = noise.plus(*noise_terms(noise, models, chain=chain)).memories
    assert free.correlation == pytest.approx(correlation, abs=0.15)
    assert (bounded.correlation == free.correlation) is told
    assert bounded.share.max() * bounded.correlation <= 1 - WANDERS**-2
