"""Explanations by the data alone: one that a test adds is told wherever others are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.support.straight_bench import StraightBench, readings
from tympan.studies.data.findings import Finding
from tympan.studies.diagnosis.explanations import registry
from tympan.studies.diagnosis.explanations.kind import Explanation, Written
from tympan.studies.diagnosis.explanations.registry import EXPLANATIONS, explanation_of
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.sentences import headline

BENCH = StraightBench()
ZERO, DRIFT, SAG = map(Cause, ("sensor_zero", "drift", "voltage_sag"))
WORDS = "the readings of a whole day were typed in twice"


def typed_twice(judged: Judgement, written: Written | None = None) -> Explanation | None:
    """Explanation of a test, where nothing else explains a misfit."""
    if judged.verdict != "unexplained":
        return None
    return Explanation.of(Finding("labels", WORDS, check="type them in once"))


def test_a_new_explanation_is_one_function(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is told in its turn, in the headline, too; and not where it says that it is none."""
    monkeypatch.setattr(registry, "EXPLANATIONS", (*EXPLANATIONS, typed_twice))
    named = judge(BENCH, readings({ZERO: 3.0}), (ZERO, DRIFT, SAG))
    found = judge(BENCH, readings({ZERO: 4.0, SAG: 3.0, DRIFT: -4.0}), (ZERO, DRIFT, SAG))
    assert (named.verdict, found.verdict) == ("named", "unexplained")
    assert explanation_of(named) is None
    explanation = explanation_of(found)
    assert explanation is not None
    assert explanation.check == "type them in once"
    assert headline("unexplained", [], [], explanation.what, of_data=True) == (
        f"The dataset looks wrong: {WORDS}.")
    before = replace(found, weighed=replace(found.weighed, odd_specimen="B"))
    first = explanation_of(before)
    assert first is not None
    assert first.finding is None


def test_nothing_is_explained_where_nothing_is_wrong() -> None:
    judged = judge(BENCH, readings({}), (ZERO, DRIFT))
    assert judged.verdict == "nothing"
    assert explanation_of(judged) is None


def test_a_film_that_cannot_be_is_a_fault_of_the_dataset_an_odd_specimen_a_place_to_look() -> None:
    soft = judge(BENCH, readings({}, factors=(-2.2, 0.0)), (ZERO, DRIFT))
    found = explanation_of(soft)
    assert found is not None
    assert found.finding is not None
    assert (found.finding.kind, found.finding.what) == ("film", found.what)
    table = readings({})
    odd = np.where(table.specimen == 1, 1.3 * table.value - 2e-4, table.value)
    found = explanation_of(judge(BENCH, table.with_values(odd), (DRIFT,)))
    assert found is not None
    assert found.finding is None
    assert "elliptical-small" in found.what
    assert "elliptical-small" in found.check
