"""Conclusions of a judgement, without a film: of a bench whose readings are straight in all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from tests.support.datasets import HEAD, write_dataset
from tests.support.straight_bench import StraightBench, readings
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.conclusions import Conclusions
from tympan.studies.diagnosis.fits.fitting import fit
from tympan.studies.diagnosis.hypothesis import SIZES, Cause
from tympan.studies.diagnosis.inference.families import has_size
from tympan.studies.diagnosis.inference.verdict import Judgement, judge
from tympan.studies.diagnosis.sentences import suspects_among

BENCH = StraightBench()
ZERO, DRIFT, SAG = map(Cause, ("sensor_zero", "drift", "voltage_sag"))


@pytest.fixture(scope="module")
def sagging() -> Judgement:
    return judge(BENCH, readings({SAG: 3.0}), [SAG, ZERO])


def concluded(judged: Judgement, dataset: Any = None) -> Conclusions:
    nothing = cast(Any, None)
    prepared = SimpleNamespace(observables=set(), assumed=False)
    return Conclusions(dataset, cast(Any, prepared), judged, 0.0, nothing, (), "")


def test_a_rival_is_listed_beside_what_is_more_probable(sagging: Judgement) -> None:
    rival = fit(BENCH, (DRIFT,), readings({DRIFT: 12.0}))
    doubted = replace(sagging, weighed=replace(
        sagging.weighed, verdict="ambiguous", named=(), rivals=(rival,), suspects=(SAG, DRIFT)))
    assert doubted.posterior is not None
    causes = list(concluded(doubted)._causes(doubted.posterior))
    assert causes[0].in_library == pytest.approx(doubted.posterior.in_library()[SAG])
    assert [cause.effect for cause in causes if cause.only_its_size] == [DRIFT.name]
    assert [cause.effect for cause in suspects_among(causes)] == [SAG.name, DRIFT.name]


def test_an_effect_has_a_size_where_its_limits_leave_none_out() -> None:
    large = fit(BENCH, (DRIFT,), readings({DRIFT: 12.0}))
    assert has_size(large, DRIFT)
    unknowns = large.unknowns.copy()
    unknowns[SIZES] = 0.0
    assert not has_size(replace(large, unknowns=unknowns), DRIFT)


def test_the_noise_that_is_stated_is_that_of_the_file(tmp_path: Path, sagging: Judgement) -> None:
    """The table's has the errors of the reduced model in it, and what readings scatter by."""
    text = "specimen,mass_g,voltage_kV,displacement_mm\n" + "".join(
        f"A,17.9,{number},{2 + number}\n" for number in range(5))
    data = read_dataset(write_dataset(tmp_path / "d", HEAD + 'noise = "15 um"\n', ("A",),
                                      static=text))
    assert concluded(sagging, data)._noise_stated() == pytest.approx(15.0)
    assert float(np.median(sagging.table.sigma)) != pytest.approx(15e-6)
    unknown = read_dataset(write_dataset(tmp_path / "e", HEAD, ("A",), static=text))
    assert concluded(sagging, unknown)._noise_stated() is None
