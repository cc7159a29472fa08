"""Coupons in which nothing is hidden: the verdict's test has the level that it is meant to have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom, kstest

from benchmarks.trials.coupons.nulls import ALONE, p_values, row
from benchmarks.trials.strata.trials import STRATA, dataset_of, evidence_of
from benchmarks.trials.synthetic_trials import draw
from tympan.studies.diagnosis.diagnose import judge_dataset
from tympan.studies.diagnosis.inference.verdict import ALARM

#: Sets of coupons, three of each kind, and the chance that a right level fails here.
SETS, UNLIKELY = 3 * len(ALONE), 1e-3


@pytest.mark.study(seconds=16)
def test_coupons_in_which_nothing_is_hidden_rarely_alarm() -> None:
    """p-values are spread evenly, as far as so few can tell."""
    values = np.concatenate([*p_values(ALONE, SETS).values()])
    assert len(values) == SETS
    assert np.sum(values < ALARM) <= binom.ppf(1 - UNLIKELY, SETS, ALARM)
    assert kstest(values, "uniform").pvalue > UNLIKELY


@pytest.mark.study(seconds=6)
def test_actuators_noise_is_no_better_known_for_coupons_beside_them(tmp_path: Path) -> None:
    """32 heaves tell their noise with 18 degrees of freedom, among them the 8 of the stated one; as
    well known as by 96 stresses more they alarmed, p = 0.003."""
    number = 21
    question, random = STRATA["film"].ask(number), np.random.default_rng([number, 17])
    read = evidence_of(question.plan, draw(random, (), question.means))
    dataset = dataset_of(tmp_path / "data", question.plan, read, 10e-6, number, False)
    _, judgement, _ = judge_dataset(dataset)
    assert judgement.verdict == "nothing"


def test_a_row_counts_alarms() -> None:
    """And how far p-values are from even ones: two of five up to 0.019, 0.4 − 0.019."""
    assert row("some", [0.001, 0.019, 0.5, 0.7, 0.9]) == (
        "| some | 2 of 5 | 40.0% | 5.3% to 85.3% | 0.381 | 0.36 |")
