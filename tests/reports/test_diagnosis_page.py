"""What the page of a diagnosis says of surprises, of rivals and of what a name depends on."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest

from tests.support.checks.policy import unlawful
from tests.support.diagnosed import diagnosed
from tympan.reports.diagnosis.figures import compose_residuals
from tympan.reports.diagnosis.page import render_diagnosis, verdict_words
from tympan.reports.diagnosis.self_check import _compose
from tympan.studies.data.findings import Finding
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.result import (
    Attempt,
    FoundCause,
    FoundFamily,
    MisfitOfKind,
    NextExperiment,
    NoEffect,
    ReadingOff,
    Robust,
    ShownSize,
    Verdict,
)
from tympan.studies.diagnosis.self_check import SyntheticSet, summary_of


def cause(effect: str, headline: str, **others: Any) -> FoundCause:
    return FoundCause(**{"effect": effect, "probability": 0.97, "headline": headline,
                         "check": f"look at {effect[:6]}", "surprise": 1.0, **others})


def test_a_surprise_is_to_be_looked_at_first() -> None:
    named = cause("unaccounted_mass", "Every load is 20 g heavier", named=True, surprise=12.3)
    assert ("Unaccounted mass: that is 12 times its typical size, so look at it first."
            in verdict_words(diagnosed("named", named)))
    usual = replace(named, surprise=2.0)
    assert "typical" not in verdict_words(diagnosed("named", usual))


@pytest.mark.parametrize(("verdict", "words"), [
    ("named", "no more than small errors of every other kind make at once, each about 30 %"),
    ("unexplained", "Such a bench has no single fault to find")])
def test_small_errors_are_said_where_they_are_the_rest(verdict: Verdict, words: str) -> None:
    usual = diagnosed(verdict, cause("drift", "Readings rise", named=verdict == "named"))
    rough = replace(usual, small_errors=0.3)
    assert words in " ".join(verdict_words(rough).split())
    assert words not in " ".join(verdict_words(usual).split())
    beside = "here small errors of other kinds leave trends beside it"
    shown = {"readings": "<svg/>", "residuals": "<svg/>"}
    assert [beside in render_diagnosis(each, shown) for each in (rough, usual)] == [True, False]


def test_where_nothing_explains_it_there_may_be_no_extended_model() -> None:
    usual = diagnosed("unexplained", cause("drift", "Readings rise"))
    none = replace(usual, after=None)
    words = "The model is not extended, as no effect improves its predictions of held-out readings."
    assert [words in verdict_words(each) for each in (usual, none)] == [False, True]
    pages = [" ".join(render_diagnosis(each, {}).split()) for each in (usual, none)]
    assert ["<code>extended</code>" in page for page in pages] == [True, False]
    assert ["so there is no extended model" in page for page in pages] == [False, True]
    assert all("the bands are as wide as the misfit" in page for page in pages)


@pytest.mark.parametrize(("shifts", "words"), [
    ({7: 0.118, 8: 0.126, 9: 0.108},
     "Lines 7 to 9 are all about 0.118 mm too large: was the sensor moved before line 7?"),
    ({3: 0.9, 7: -0.12, 8: -0.13, 9: -0.1}, "Lines 7 to 9 are all about 0.12 mm too small"),
    ({7: 0.118, 8: 0.126}, ""), ({7: 0.1, 8: -0.1, 9: 0.1}, ""), ({7: 0.1, 9: 0.1, 11: 0.1}, "")])
def test_outliers_in_a_row_that_are_off_alike_are_a_sensor_that_was_moved(
        shifts: dict[int, float], words: str) -> None:
    off = tuple(ReadingOff(file="static.csv", line=line, kind="displacement", specimen="a",
                           unit="mm", read=2.0 + shift, expected=2.0, probability=1.0)
                for line, shift in shifts.items())
    told = " ".join(verdict_words(replace(
        diagnosed("named", cause("drift", "Readings rise", named=True)), readings_off=off)).split())
    assert words in told
    assert ("was the sensor moved" in told) == bool(words)


@pytest.mark.parametrize(("kind", "lines"), [("labels", (46, 47, 50)), ("film", ())])
def test_what_is_wrong_in_the_dataset_is_said_once(kind: Literal["labels", "film"],
                                                   lines: tuple[int, ...]) -> None:
    """In the headline; further down the page says where it is, and what else is wrong."""
    what, other = "the column voltage looks one row too high", "rows were pasted"
    finding = Finding(kind, what, "static.csv" if lines else "", lines, "look up the labels")
    usual = diagnosed("unexplained", cause("drift", "Readings rise"))
    found = replace(
        usual, headline=f"The dataset looks wrong: {what}.", findings=(
            Finding("copies", other, "static.csv", (3,), "take them out"), finding),
        misfit=replace(usual.misfit, where=what),
        next_experiment=NextExperiment(what="", checks=(finding.check,), after_checks="mend it"))
    page = " ".join(render_diagnosis(found, {"film": "<svg/>"}).split())
    assert page.lower().count(what) == 1
    assert page.count(other.capitalize()) == 1
    assert ("What is said above is in static.csv, lines 46 to 50." in page) == bool(lines)
    assert "<li>Mend it.</li>" in page
    unknown = "Something is at work that tympan does not know"
    assert [unknown in verdict_words(each) for each in (usual, found)] == [True, False]


def test_readings_that_do_not_count_are_crosses_and_leave_the_others_their_scale() -> None:
    """At the edge of the picture, on their side."""
    columns = {"specimen": np.repeat("round", 4), "mass": np.full(4, 0.02),
               "voltage": np.array([0.0, 1e3, 2e3, 3e3]), "sigma": np.full(4, 0.05),
               "read": np.array([10.0, 10.1, 18.0, 9.9]), "baseline": np.full(4, 10.0),
               "extended": np.full(4, 10.0), "counts": np.array([1.0, 1.0, 0.0, 1.0])}
    figure = compose_residuals(columns, "Hz", 1.0)
    axes = figure.axes[0]
    (cross,) = [line for line in axes.lines if line.get_marker() == "x"]
    low, high = axes.get_ylim()
    assert (low, high) == pytest.approx((-0.14375, 0.14375))
    assert float(cross.get_xdata()[0]) == 2.0
    assert 0.9 * high < float(cross.get_ydata()[0]) < high
    assert "left out" in [words.get_text() for words in figure.legends[0].get_texts()]


def test_a_family_is_named_with_the_one_that_stands_for_it() -> None:
    family = FoundFamily(
        name="bare_film", headline="The electrodes cover less of the film than stated: 20 % less",
        size=ShownSize(0.2, "", 0.1, 0.3, ""), members=("electrode_margin", "electrode_patch"),
        member="The electrodes end 4 mm short of the frame")
    named = cause("electrode_margin", family.headline, named=True, family=family, surprise=12.3)
    words = verdict_words(diagnosed("named", named))
    assert f"one of the causes that fit them equally well: {family.member}." in words
    assert "look at it first" not in words


@pytest.mark.parametrize(("unknown", "told"), [(0.04, False), (0.13, True)])
def test_the_probability_of_something_else_is_said_where_it_is_not_small(unknown: float,
                                                                        told: bool) -> None:
    named = cause("drift", "Readings rise", named=True)
    words = verdict_words(diagnosed("named", named, probability=NoEffect(0.0, unknown)))
    assert ("none of these, but something that no effect makes, is 13 %." in words) == told


def test_how_the_probability_of_something_else_drifts_is_said_beside_it() -> None:
    named = cause("drift", "Readings rise", named=True)
    scales = tuple(Robust(factor, ("drift",), unknown) for factor, unknown in (
        (1 / 3, 0.05), (1.0, 0.13), (10.0, 0.41)))
    words = verdict_words(diagnosed("named", named, probability=NoEffect(0.0, 0.13), robust=scales))
    assert ("no effect makes, is 13 %; it is 5 % to 41 % as typical sizes are taken 1/3 of, to 10 "
            "times, what the library says.") in words


def test_a_rival_that_only_its_size_speaks_against_is_called_so() -> None:
    page = render_diagnosis(diagnosed(
        "ambiguous", cause("sensor_zero", "Every reading is 50 µm too large"), cause(
            "drift", "Readings rise", probability=0.0, only_its_size=True, surprise=12.3)), {})
    assert unlawful(page) == []
    assert ("Only its size speaks against it: as a cause it would have to be 12 times its typical "
            "size.") in page
    assert page.index("look at sensor; look at drift") < page.index("Readings, and the models")


@pytest.mark.parametrize(("stand_out", "words"), [
    ((["drift"], ["drift"]),
     "Drift stands out whether typical sizes are taken 1/3 of, or 10 times,"),
    ((["drift"], []), "with 0.33 times those of the library drift; with 10 times"),
    (([], []), "Nothing stands out, whichever sizes"),
])
def test_what_the_name_depends_on_is_said(stand_out: tuple[list[str], ...], words: str) -> None:
    diagnosis = diagnosed(
        "named", cause("drift", "Readings rise", named=True),
        robust=tuple(Robust(factor, tuple(names))
                     for factor, names in zip((1 / 3, 10.0), stand_out, strict=True)))
    page = " ".join(render_diagnosis(diagnosis, {}).split())
    assert words in page
    assert "Were the noise 1.5 times as large, the probability of what is named would be 96 %" in (
        page)
    assert "misses by 22 µm where the baseline model misses by 61 µm; the noise is 20 µm" in page
    assert "Of readings held out in turn, 94 % lay within the bands that are to hold 95 %" in page


@pytest.mark.parametrize(("over", "words"), [
    (0.919, "noise of one reading: 15 µm is stated, and the readings scatter 0.92 times as much"),
    (1.3, "noise of one reading: 15 µm is stated, and the readings scatter 1.3 times as much"),
    (1.02, "noise of one reading: 15 µm is stated</div>")])
def test_the_noise_is_stated_as_the_file_has_it(over: float, words: str) -> None:
    """With the errors of the reduced model it is not what was found over what it is found to be."""
    usual = diagnosed("named", cause("drift", "Readings rise", named=True))
    misfit = replace(usual.misfit, noise=14.4 * over, noise_stated=15.0, noise_over_stated=over)
    page = " ".join(render_diagnosis(replace(usual, misfit=misfit), {}).split())
    assert words in page


def test_what_cannot_be_told_of_two_families_is_said_once_with_both() -> None:
    def of_family(effect: str, member: str) -> FoundCause:
        size = ShownSize(0.1, "%", 0.05, 0.2, "")
        return cause(effect, f"A {effect}", named=True, family=FoundFamily(
            name=effect, headline=f"A {effect}", size=size, members=(effect,), member=member))

    both = of_family("electrode_margin", "A margin of 2 mm"), of_family("creep", "A branch of 9 s")
    words = " ".join(verdict_words(diagnosed("named", *both)).split())
    assert words.count("These readings cannot tell more.") == 1
    assert ("one of the causes that fit them equally well, in each of these cases: "
            "A margin of 2 mm; A branch of 9 s.") in words
    words = " ".join(verdict_words(diagnosed("named", both[0])).split())
    assert "one of the causes that fit them equally well: A margin of 2 mm." in words


def test_an_effect_that_takes_nothing_away_is_not_listed() -> None:
    def attempt(effect: str, explains: float) -> Attempt:
        return Attempt(effect=effect, which=None, explains=explains, parameters={},
                       headline=f"An attempt at {effect}", prior_widths=0.0, plausible=True,
                       at_limit=False)

    page = render_diagnosis(diagnosed(
        "unexplained", cause("drift", "Readings rise"), attempts=(
            attempt("drift", 0.6), attempt("creep", 0.0))), {})
    assert "An attempt at drift" in page
    assert "An attempt at creep" not in page
    assert "<tr><th>creep</th>" not in page


def test_a_name_says_its_share_of_the_library_where_something_else_is_probable() -> None:
    """Such a share of 90 % is what a name takes; the probability printed beside it may be less."""
    named = cause("drift", "Readings rise", named=True, probability=0.81, in_library=0.94)
    usual = diagnosed("named", named)
    words = "Drift has 94 % of the probability of all effects in the library; from 90 % on it can"
    assert words not in " ".join(verdict_words(usual).split())
    doubted = replace(usual, probability=NoEffect(0.0, 0.14))
    assert words in " ".join(verdict_words(doubted).split())


def test_the_bars_of_a_self_check_end_within_the_page() -> None:
    check = summary_of([SyntheticSet(Cause("drift"), 2.0, "named", (Cause("drift"),))])
    axes, = _compose(check.rows).axes
    left, right = axes.get_position().x0, axes.get_position().x1
    # Names stand on the left, and the last number of the axis ends on the right.
    assert 0.2 < left < 0.3
    assert 0.9 < right < 1.0


def test_each_kind_of_readings_has_its_misfit_beside_its_noise() -> None:
    found = diagnosed("unexplained", cause("drift", "Readings rise"))
    force = MisfitOfKind(kind="force", unit="mN", readings=60, noise=0.5, baseline_rmse=6.02)
    both = replace(found, misfit=replace(found.misfit, others=(force,)))
    assert "It misses those of force by 6.02 mN; their noise is 0.5 mN." in " ".join(
        verdict_words(both).split())
    assert "those of force" not in verdict_words(found)


def test_outliers_are_said_to_make_a_misfit_only_where_they_do() -> None:
    found = diagnosed("nothing", cause("drift", "Readings rise"))
    pages = [" ".join(render_diagnosis(replace(found, misfit=replace(
        found.misfit, correlation=0.5, p_value=0.15, p_value_of_all=of_all)), {}).split())
        for of_all in (1e-6, 0.9)]
    assert ["noise alone would make such a misfit" in page for page in pages] == [True, False]
