"""Causes that the library lacks: what they do to readings, and what is counted of their trials."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.trials.judging import blamed
from benchmarks.trials.rates.kinds import bench_rates
from benchmarks.trials.rates.page import bench_page
from benchmarks.trials.record import Record
from benchmarks.trials.synthetic_trials import Design, Truth, paper, readings
from benchmarks.trials.trial import measured
from benchmarks.trials.unmodelled_faults import (
    FURTHER,
    Exchanged,
    Hardening,
    Jump,
    Late,
    MissingSector,
    OtherPlate,
    Rim,
    Stick,
    Thickness,
    Warp,
)
from tests.support.costs import dear
from tests.support.trials import design as uniform
from tests.support.trials import few_causes, read
from tympan.geometry.specimen import Plate
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.inference import verdict
from tympan.studies.diagnosis.inference.verdict import judge
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.effects.library.families import BARE_FILM

CAUSES = [Cause("parallel_spring"), Cause("sensor_zero"), Cause("unaccounted_mass")]


@pytest.fixture(scope="module")
def design() -> Design:
    """Few states, of all specimens and both masses."""
    whole = paper()
    return whole.only(np.isin(whole.table.states.voltage, np.unique(whole.table.voltage)[::7]))


@pytest.fixture(scope="module")
def plain(design: Design) -> np.ndarray:
    values = readings(design, Truth())
    assert values is not None
    return values


def of(design: Design, truth: Truth) -> np.ndarray:
    values = readings(design, truth)
    assert values is not None
    return values


@pytest.mark.parametrize("name", FURTHER)
def test_each_changes_readings_of_what_is_at_fault_alone(design: Design, plain: np.ndarray,
                                                         name: str) -> None:
    stranger = FURTHER[name](np.random.default_rng(5), design)
    off = np.abs(of(design, Truth(stranger=stranger)) - plain) > 0.3e-6
    assert off.any()
    names = np.array([specimen.name for specimen in design.setup.specimens])
    if stranger.at_fault in names:
        assert np.all(names[design.table.specimen[off]] == stranger.at_fault)


def test_a_missing_sector_leaves_its_share_of_the_film_bare(design: Design) -> None:
    sector = MissingSector(None, 0.3, 0.2 * np.pi)
    assert sector.family is BARE_FILM
    for specimen in sector.setup(design.setup).specimens[:1]:
        assert BARE_FILM.of(specimen, design.setup.rig) == pytest.approx(0.1, abs=2e-3)
        assert not specimen.mirror_planes


def test_a_hardening_lead_is_the_derivative_of_its_energy() -> None:
    lead, step = Hardening(5.0, 3e-3), 1e-7
    for out in (1e-3, 3e-3, 6e-3):
        below, above = (lead.derivatives(out + way * step) for way in (-1, 1))
        for order in range(2):
            assert (above[order] - below[order]) / (2 * step) == pytest.approx(
                lead.derivatives(out)[order + 1], rel=1e-6)
    assert lead.derivatives(3e-3)[2] == pytest.approx(10.0)


def test_a_warped_frame_stretches_its_film_and_moves_no_plate_by_itself(
        design: Design, plain: np.ndarray) -> None:
    """Of a round film a saddle is the same up and down, and its film deflects less."""
    up, down = (of(design, Truth(stranger=Warp("circular", length))) for length in (6e-3, -6e-3))
    of_it = design.table.specimen == 0
    assert up == pytest.approx(down, abs=1e-9)
    assert np.all(up[of_it] < plain[of_it] - 5e-6)


def test_a_rim_and_a_plate_are_as_the_films_they_make(design: Design, plain: np.ndarray) -> None:
    """A rim that reaches over the whole film is a film twice as thick; a plate is one as large."""
    thick = of(design, Truth(stranger=Rim("circular", 1.0, 10.0)))
    films = design.setup.with_films(lambda film: replace(film, thickness=2 * film.thickness),
                                    "circular")
    assert thick == pytest.approx(of(replace(design, setup=films), Truth()), rel=2e-4)
    small = of(design, Truth(stranger=OtherPlate("circular", -0.1)))
    plates = design.setup.with_specimens(
        lambda one: replace(one, plate=Plate(replace(one.plate.outline, radius=9e-3))), "circular")
    assert small == pytest.approx(of(replace(design, setup=plates), Truth()), rel=1e-9)


def test_labels_stand_where_they_should_not() -> None:
    design = paper()
    states, shown = design.table.states, np.arange(len(design.table), dtype=float)
    late = Late(20).shown(shown, states)
    assert np.array_equal(late[15:30], [*range(15, 21), *range(20, 29)])
    assert np.array_equal(np.delete(late, range(15, 30)), np.delete(shown, range(15, 30)))
    masses = Exchanged("mass", (1, 1)).shown(shown, states)
    assert np.array_equal(masses[30:60], [*range(45, 60), *range(30, 45)])
    both = Exchanged("specimen", (0, 2)).shown(shown, states)
    assert np.array_equal(both, [*range(60, 90), *range(30, 60), *range(30)])


@pytest.mark.study(seconds=15)
@pytest.mark.parametrize(("stranger", "told"), [
    (Exchanged("specimen", (0, 2)), {"specimen"}),
    dear(Exchanged("mass", (1, 1)), {"mass"}, seconds=5), dear(Late(20), {"voltage"}, seconds=5)])
def test_what_a_page_blames_is_the_column(three_shapes: Simulation, stranger: Exchanged | Late,
                                          told: set[str]) -> None:
    table = read(three_shapes, paper().table, (), [], seed=1)
    shown = stranger.shown(table.value, table.states)
    assert blamed(judge(three_shapes, table.with_values(shown), CAUSES)) == told


@pytest.mark.study(seconds=9)
@pytest.mark.parametrize("share", [0.02, dear(-0.03, seconds=20)])
def test_a_film_of_another_thickness_is_no_slip_of_labels(three_shapes: Simulation, share: float
                                                          ) -> None:
    """Other labels leave little of it, a film of its own leaves noise; of these causes none does.
    """
    causes = [Cause("prestretch_anisotropy"), Cause("prestretch_loss", "elliptical-small"),
              Cause("sensor_zero"), Cause("parallel_spring")]
    design = paper()
    shown = of(design, Truth(1.05, 0.97, stranger=Thickness(which="elliptical-large",
                                                            share=share)))
    table = measured(design, shown, np.random.default_rng(1), 0)
    judged = judge(three_shapes, table, causes)
    assert judged.weighed.odd_specimen == "elliptical-large"
    assert blamed(judged) == {"elliptical-large"}


def test_what_a_page_blames_is_the_specimen(three_shapes: Simulation) -> None:
    table = read(three_shapes, paper().table, (), [], seed=1)
    off = np.where(table.specimen == 1, 150e-6, 0.0)
    assert blamed(judge(three_shapes, table, CAUSES)) == set()
    assert blamed(judge(three_shapes, table.with_values(table.value + off), CAUSES)) == {
        "elliptical-small"}


def test_rates_count_what_is_told_of_strangers() -> None:
    blank = Record("strangers", 0, "elements", ("one frame bent oval",), 0, 50.0, 50.0,
                   "unexplained", rows=(1, 1, 0), predicted=(19, 20))
    records = [blank, replace(blank, rows=(1, 1, 1)), replace(blank, rows=(0, 1, 1)),
               replace(blank, verdict="named", named=("drift",), rows=(0, 1, 0)),
               replace(blank, seen=1.0, verdict="nothing", rows=(0, 1, 0), predicted=(9, 10)),
               Record("gain", 0, "elements", ("drift",), 0, 90.0, 90.0, "named", ("drift",),
                      limits=(0.1, 0.3), held=0.2, predicted=(8, 10)),
               Record("gain", 1, "elements", ("drift",), 0, 90.0, 90.0, "named", ("drift",),
                      limits=(0.1, 0.3), held=0.4)]
    by_words = {rate.what: (rate.hits, rate.count) for rate in bench_rates(records)}
    assert by_words["strangers: some effect is named"] == (1, 5)
    assert by_words["strangers, Δχ² ≥ 25 from the library: some effect is named"] == (1, 4)
    assert by_words["the same, of one specimen or column: that is told"] == (2, 4)
    assert by_words["the same: others are told besides"] == (1, 4)
    assert by_words["the same: others alone are told"] == (1, 4)
    within = "readings held out within their 95 % predictive bands"
    every = "all of these and of the strangers, verdict"
    assert by_words[f"{every} unexplained: {within}"] == (57, 60)
    assert by_words[f"{every} nothing: {within}"] == (9, 10)
    assert by_words[f"{every} named: {within}"] == (27, 30)
    assert by_words["one effect: the gain's 95 % limits hold the ratio at states held back"] == (
        1, 2)
    text = bench_page(records, "")
    assert "| one frame bent oval | 4 | unexplained 3; drift 1 | 2 of 4 |" in text


@pytest.mark.study(seconds=7)
@pytest.mark.parametrize("stranger", [Jump(150e-6, 40), dear(Stick(200e-6), seconds=10)])
def test_a_stranger_that_shows_is_unexplained_by_what_causes_leave(
        three_shapes: Simulation, stranger: Jump | Stick, monkeypatch: pytest.MonkeyPatch) -> None:
    """By what every cause leaves, whatever the doubt; without that rule a cause would be told."""
    table = read(three_shapes, uniform(20e-6), (), [], seed=1)
    table = table.with_values(stranger.shown(table.value, table.states))

    def judged() -> str:
        return judge(three_shapes, table, few_causes(three_shapes)).verdict

    monkeypatch.setattr(verdict, "DISCREPANCY", 2.0)
    assert judged() == "unexplained"
    monkeypatch.setattr(verdict._Adequacy, "enough", lambda self, fit: True)
    assert judged() != "unexplained"
