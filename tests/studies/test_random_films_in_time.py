"""Random films with viscous branches in time: none raises or gains energy."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.trials.random_films_in_time import (
    EXPLAINED,
    UNEXPLAINED,
    MotionRecord,
    failed,
    films_in_time,
    judged,
)
from benchmarks.trials.robustness import Judge
from tests.support.costs import dear
from tympan.geometry.mesher import MeshSettings
from tympan.studies.case import Case, Settings
from tympan.studies.modes import carried
from tympan.studies.transient import begun

QUICK = 12
COARSE = MeshSettings(order=2).refined(0.5)


@pytest.mark.parametrize("drawn", [
    dear(drawn, seconds=7) if drawn.number in (5, 8, 9) else drawn
    for drawn in films_in_time(QUICK)], ids=lambda drawn: str(drawn.number))
def test_random_film_in_time(drawn) -> None:
    record = Judge(lambda motion: judged(motion, COARSE), failed)(drawn)
    assert record.status in ("done", "pull_in", "thinning", "refused"), record
    assert record.status != "refused" or "equilibrium" in record.words
    assert not record.wrong, record


def test_the_design_is_the_same_every_time_and_has_every_part() -> None:
    first, second = list(films_in_time(20)), list(films_in_time(60))
    assert [str(drawn) for drawn in first] == [str(drawn) for drawn in second[:20]]
    motions = [drawn.motion for drawn in second]
    for part in ("plate_damping", "series_resistance", "gas_pressure"):
        shares = [getattr(motion.rig, part) != 0 for motion in motions]
        assert any(shares)
        assert not all(shares)
    assert {motion.inertia for motion in motions} == {True, False}
    assert {len(motion.specimen.membrane.branches) for motion in motions} == {1, 2, 3}


@pytest.mark.parametrize(("changes", "wrong"), [
    ({}, False),
    ({"unexplained": -2 * UNEXPLAINED, "again": -2 * UNEXPLAINED}, True),
    ({"unexplained": -2 * UNEXPLAINED, "again": -EXPLAINED * UNEXPLAINED}, False),
    ({"unexplained": 2 * UNEXPLAINED, "wrinkles": True}, False),
    ({"unexplained": -2 * UNEXPLAINED, "wrinkles": True}, True),
    ({"heat": -2 * UNEXPLAINED}, True),
    ({"jumps": -2 * UNEXPLAINED}, True),
    ({"status": "raised"}, True)])
def test_what_counts_as_wrong(changes: dict, wrong: bool) -> None:
    record = MotionRecord(0, "done", heat=0.1, jumps=0.0)
    assert bool(replace(record, **changes).wrong) == wrong


def test_a_plate_that_may_tilt_swings_with_its_rotary_inertia() -> None:
    """Number 7 hangs off the centre: without inertia about its axes it had no motion at all."""
    drawn = list(films_in_time(8))[7]
    transient, *_ = begun(drawn.motion, Settings(COARSE))
    assert transient.plate is not None
    assert transient.plate.inertia.diagonal().min() > 0
    same = carried(Case(drawn.motion.specimen, mass=drawn.motion.mass, rig=drawn.motion.rig))
    assert transient.plate.mass == same.mass
