"""The page of a sweep, from results made up: what it shows is what the table says."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.textpath import TextPath

from tests.support.checks.accessible import wordless
from tests.support.checks.policy import unlawful
from tests.support.sweeps import read
from tympan.base.errors import InputError
from tympan.reports.sweep import page
from tympan.reports.sweep.maps import Map, sweep_maps
from tympan.reports.sweep.page import keep_page, render_sweep
from tympan.reports.sweep.view import SweepView
from tympan.studies.sweep.run import SweepResult
from tympan.studies.sweep.table import dataset
from tympan.studies.sweep.task import SweepTask, TaskResult, columns, without_result

TEXT = """
specimen = "oval.toml"
mass = ["10 g", "20 g"]
voltage = ["0 kV", "2 kV", "4 kV"]
ask = ["alpha", "limits"]
[grid]
"plate.radius" = ["8 mm", "10 mm"]
"frame.semi_axes" = [["6 cm", "4.5 cm"], ["7 cm", "4.5 cm"], ["1 cm", "4.5 cm"]]
"""


def made_up(task: SweepTask) -> TaskResult:
    """Deflections of mass over radius and voltage; beyond 3 kV the larger plate pulls in."""
    radius, rows = task.specimen.plate.outline.radius, []
    for number, case_id in enumerate(task.ids):
        mass, volts = task.masses[number // 3], task.voltages[number % 3]
        row = dict.fromkeys(columns()) | {"id": case_id, "warnings": []}
        rows.append(row | {"status": "no_equilibrium"} if radius > 9e-3 and volts > 3e3 else row | {
            "status": "equilibrium", "deflection_m": mass / radius * (1e-3 + 1e-7 * volts)})
    weights = ({"warnings": ["has no <circle>"]} if radius > 9e-3
               else {"alpha_1": 0.6, "alpha_2": 0.4, "alpha_held_out_error": 1e-3, "warnings": []})
    limits = [{"last_equilibrium_V": 1e4 * radius / mass, "warnings": []} for mass in task.masses]
    return TaskResult(rows, {"alpha": [weights], "limits": limits})


@pytest.fixture(scope="module")
def view(tmp_path_factory) -> SweepView:
    """Of a sweep with specimens that cannot be built, one that failed and one that waits."""
    sweep = read(tmp_path_factory.mktemp("sweep"), TEXT)
    tasks = [entry.task for entry in sweep.entries if entry.task is not None]
    results = {task.id: made_up(task) for task in tasks[:-1]}
    results[tasks[1].id] = without_result(tasks[1].ids, tasks[1].ask, tasks[1].loads, "it broke")
    table = dataset(sweep, {name: result.packed() for name, result in results.items()})
    return SweepView(SweepResult(dict(Counter(table["status"].values.ravel().tolist())), 0, 0, "us",
                                 sweep.source, False, table))


def test_every_pair_of_keys_has_maps_of_what_depends_on_both(view: SweepView) -> None:
    maps = {(pair.across.name, pair.up.name): [drawn.title for drawn in pair.maps]
            for pair in sweep_maps(view)}
    assert maps == {
        ("plate.radius", "frame.semi_axes"): ["deflection [mm]", "stroke [mm]", "alpha 1",
                                              "alpha held out error", "last equilibrium [kV]"],
        ("plate.radius", "mass"): ["deflection [mm]", "stroke [mm]", "last equilibrium [kV]"],
        ("plate.radius", "voltage"): ["deflection [mm]", "stroke [mm]"],
        ("frame.semi_axes", "mass"): ["deflection [mm]", "stroke [mm]", "last equilibrium [kV]"],
        ("frame.semi_axes", "voltage"): ["deflection [mm]", "stroke [mm]"],
        ("mass", "voltage"): ["deflection [mm]", "stroke [mm]"]}


def test_a_map_says_what_the_table_has(view: SweepView) -> None:
    first = sweep_maps(view)[0]
    deflection, stroke, *_ = first.maps
    assert (deflection.where, stroke.where) == ("10 g, 4 kV", "10 g, 4 kV")
    assert [text for _, text in deflection.across] == ["8", "10"]
    assert [text for _, text in deflection.up] == ["6 cm, 4.5 cm", "7 cm, 4.5 cm", "1 cm, 4.5 cm"]
    assert deflection.marks[0].text == "oval (8 mm, 6 cm, 4.5 cm): 1.75"
    assert stroke.marks[0].text == "oval (8 mm, 6 cm, 4.5 cm): 0.500"
    assert stroke.marks[3].text == "oval (10 mm, 6 cm, 4.5 cm): no result"  # it pulls in before
    for drawn in (deflection, stroke):
        assert [bool(mark.colour) for mark in drawn.marks] == [True, False, True, False, False,
                                                               False]
        assert [mark.hatched for mark in drawn.marks] == [False, True, False, True, True, True]
    assert [pair.maps[0].marks[0].text for pair in sweep_maps(view)][-1] == (
        "1.17, mean of 3; 3 of 6 without a result")


@pytest.mark.parametrize(("at", "strokes"), [
    ("2 kV", [0.25, None, 0.25, 0.2, None, None]), (4e3, [0.5, None, 0.5, None, None, None]),
    (None, [0.5, None, 0.5, None, None, None])])
def test_all_films_of_a_map_are_at_one_voltage(view: SweepView, at: float | str | None,
                                               strokes: list[float | None]) -> None:
    """Never at the last that each film reaches: what does not reach it is hatched."""
    _, stroke, *_ = sweep_maps(SweepView(view.result, at))[0].maps
    volts = {"2 kV": 2, 4e3: 4, None: 4}[at]
    assert stroke.where == f"10 g, {volts} kV"
    ends = [mark.text.rpartition(": ")[2] for mark in stroke.marks]
    assert ends == ["no result" if value is None else f"{value:.3f}" for value in strokes]
    with pytest.raises(InputError, match="voltage: given '3 kV': must be one of the sweep's"):
        sweep_maps(SweepView(view.result, "3 kV"))


def test_a_map_of_too_many_cases_has_some_of_them(view: SweepView, monkeypatch) -> None:
    monkeypatch.setattr("tympan.reports.sweep.maps._FEW", 1)
    monkeypatch.setattr("tympan.reports.sweep.maps._MOST_MARKS", 2)
    across, up = (key for key in view.keys if key.name in ("plate.radius", "mass"))
    maps = next(maps.maps for maps in sweep_maps(view)
                if {maps.across, maps.up} == {across, up})
    assert {(len(drawn.marks), drawn.shown) for drawn in maps} == {(2, "2 of 4 cases")}
    assert "; 2 of 4 cases</figcaption>" in render_sweep(view.result, [])


def test_what_there_is_not_without_voltage_has_not_failed(tmp_path: Path) -> None:
    sweep = read(tmp_path, TEXT.replace('"alpha", "limits"', '"force"'))
    results = {}
    for entry in sweep.entries:
        if entry.task is None:
            continue
        made = made_up(entry.task)
        records = [{"warnings": ["there is no stroke without voltage"]} if not number % 3 else
                   {"warnings": ["no stroke was found"]} if number == 1 else
                   {"blocked_force_N": 0.0123, "work_J": 4.5e-6, "warnings": []}
                   for number in range(len(made.rows))]
        results[entry.task.id] = TaskResult(made.rows, {"force": records})
    table = dataset(sweep, {name: result.packed() for name, result in results.items()})
    text = render_sweep(SweepResult({}, 0, 0, "us", "", False, table), [])
    assert "there is no stroke without voltage" not in text
    assert "no stroke was found" in text
    assert "blocked force [mN]" in text
    assert "work [mJ]" in text
    assert ">12.3<" in text
    assert ">0.0045<" in text


def test_the_page_says_what_its_columns_mean(view: SweepView) -> None:
    text = render_sweep(view.result, [])
    assert ("<li>Weights of the membrane circles that stand for it, as tympan alpha finds them. "
            "<b>alpha 1</b>: weight of circle n; <b>alpha held out error</b>: its force error, "
            "relative, at other loads.</li>") in text
    assert "<b>last equilibrium [kV]</b>: beyond this nominal voltage there is none" in text
    assert "<b>tension" not in text  # nothing was found, so no column shows it


def test_the_page_says_how_many_rows_a_reduced_film_solved(view: SweepView) -> None:
    assert "by a reduced film" not in render_sweep(view.result, [])
    table = view.table.copy(deep=True)
    table["by"][:, :, :, 1:] = "reduced"
    count = int((table["by"] == "reduced").sum())
    assert f"cases, {count} of them by a reduced film." in render_sweep(
        replace(view.result, table=table), [])


def test_the_page_names_the_voltage_of_its_maps(view: SweepView) -> None:
    assert "All films are compared at one voltage, 4 kV" in render_sweep(view.result, [])
    text = render_sweep(replace(view.result, at_V=2e3), [])
    assert "All films are compared at one voltage, 2 kV" in text
    assert "What depends on the voltage is that at 2 kV" in text


@pytest.mark.parametrize("label", ["50 mm, 45 mm", "1.25, 1.25", "wwwwwwwwwwww"])
def test_slanted_labels_have_their_room(label: str) -> None:
    """As wide as the letters of a usual font, 9 px high, at 40° from below their cells."""
    ticks = [(cell, label) for cell in (32.0, 95.0, 158.0)]
    drawn = Map("deflection", "", ticks, [(75.0, "0")], [], [(75.0, "3.6")], True)
    box = TextPath((0.0, 0.0), label, size=9).get_extents()
    across, below = np.cos(np.radians(40)) * box.width, np.sin(np.radians(40)) * box.width
    assert drawn.slanted or box.width < 63
    assert drawn.margins[0] + 32.0 >= across
    assert not drawn.slanted or drawn.slanted >= below - 5


def test_the_page_stands_alone_and_says_what_failed_and_what_waits(view: SweepView) -> None:
    text = render_sweep(view.result, ["data:image/png;base64,AAAA"])
    assert not re.findall(r'(?:src|href)="(?!data:|#)|https?:|@import|url\((?!#)', text)
    assert "6 cases wait" in text
    rows = re.findall(r"<tr><td class=\"text\">(case|alpha)</td><td>(\d+)</td>"
                      r"<td class=\"text\">(.*?)</td><td class=\"text\">(.*?)</td>", text)
    assert [row[:2] for row in rows] == [("case", "6"), ("case", "6"), ("alpha", "1")]
    assert rows[0][2:] == ("it broke", "oval (8 mm, 7 cm, 4.5 cm)")
    assert "plate" in rows[1][2]
    assert rows[2][2:] == ("has no &lt;circle&gt;", "oval (10 mm, 6 cm, 4.5 cm)")
    body = text[text.index("<tbody>"):text.index("</tbody>")]
    assert body.count("<tr>") == 12
    assert '<td data-value="0.0125">12.5</td>' not in body  # SI is sorted by, the unit is shown
    assert '<td data-value="0.00175">1.75</td>' in body
    assert "3 of 3" in body
    assert "2 of 3" in body
    assert "data:image/png;base64,AAAA" in text
    assert wordless(text) == []
    assert unlawful(text) == []


def test_the_page_is_kept_while_a_sweep_runs_but_never_ends_it(view, tmp_path: Path,
                                                               monkeypatch) -> None:
    watch, asked = keep_page(tmp_path / "out"), []

    def so_far() -> SweepResult:
        asked.append(1)
        return view.result

    for _ in range(3):
        watch(so_far)
    assert (tmp_path / "out" / "sweep.html").exists()
    assert len(asked) == 1  # not again at once

    def full(*_: object) -> None:
        raise InputError("cannot be written")

    monkeypatch.setattr(page, "write_text", full)
    keep_page(tmp_path / "out")(so_far)
    assert len(asked) == 2


def test_films_beyond_breakdown_are_named_marked_and_last(view: SweepView) -> None:
    table = view.table.copy(deep=True)
    strength = 0 * table["deflection_m"] + 2.0 - 1.5 * (table["mass"] > 15e-3)
    table["breakdown_margin"] = strength.where(table["voltage"] > 3e3).variable
    weak = SweepView(replace(view.result, table=table))
    text = render_sweep(weak.result, [])
    assert "2 of 12 films beyond breakdown at 4 kV" in text
    assert "breakdown" not in re.sub(r"<p class=.note.*?</p>", "", render_sweep(view.result, []))
    headings, rows = page._rows(weak)
    assert [row[-1][0] for row in rows] == [""] * 10 + ["breakdown"] * 2
    assert rows[0][headings.index("breakdown margin")][0] == "2"
    masses = {pair.up.name: pair.maps[0] for pair in sweep_maps(weak)}["mass"]
    heavy = [mark for mark in masses.marks if mark.beyond]
    assert len(heavy) == 2  # of the third frame no film can be built
    assert all("beyond breakdown" in mark.text for mark in heavy)
    assert text.count("url(#beyond)") >= len(heavy)
