"""Strokes of a sweep, and its best cases: against the flat table, row by row, from made-up results.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import tympan
from tests.support.sweeps import read, written
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.studies.sweep.run import SweepResult
from tympan.studies.sweep.table import dataset, frame
from tympan.studies.sweep.task import SweepTask, TaskResult, columns

TEXT = """
specimen = "oval.toml"
mass = ["10 g", "20 g"]
voltage = ["0 kV", "2 kV", "4 kV"]
ask = ["limits"]
[grid]
"plate.radius" = ["8 mm", "9 mm", "10 mm", "11 mm"]
"membrane.thickness" = ["0.9 mm", "1 mm"]
"""


def made_up(task: SweepTask) -> TaskResult:
    """Stress falls as the voltage grows; the thinner film with a large plate pulls in at 4 kV."""
    radius, thick = task.specimen.plate.outline.radius, task.specimen.membrane.thickness
    rows: list[dict[str, Any]] = []
    for number, case_id in enumerate(task.ids):
        mass, volts = task.masses[number // 3], task.voltages[number % 3]
        row = dict.fromkeys(columns()) | {"id": case_id, "warnings": []}
        if radius > 10.5e-3 and thick < 0.95e-3 and volts > 3e3:
            rows.append(row | {"status": "no_equilibrium"})
            continue
        rows.append(row | {
            "status": "equilibrium", "deflection_m": mass / radius * (1e-3 + 1e-7 * volts / thick),
            "max_true_stress_Pa": 1e5 * mass / (20e-3 * thick / 1e-3) * (2 - volts / 4e3),
            "breakdown_margin": 8e3 * thick / 1e-3 / volts if volts else None})
    limits = [{"breakdown_V": 7e3 if radius < 9.5e-3 else None, "breakdown_spread": 1e-4,
               "last_equilibrium_V": 5e3, "pull_in_V": 5e3, "pull_in_spread": 1e-4, "warnings": []}
              for _ in task.masses]
    return TaskResult(rows, {"limits": limits})


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> SweepResult:
    sweep = read(tmp_path_factory.mktemp("sweep"), TEXT)
    table = dataset(sweep, {entry.task.id: made_up(entry.task).packed() for entry in sweep.entries
                            if entry.task is not None})
    return SweepResult(dict(Counter(table["status"].values.ravel().tolist())), 0, 0, "us",
                       sweep.source, False, table)


def test_the_stroke_is_the_deflection_less_that_at_the_lowest_voltage(result: SweepResult) -> None:
    rows = frame(result.table)
    assert list(rows).index("stroke_m") == list(rows).index("deflection_m") + 1
    assert result.table["stroke_m"].attrs["units"] == "m"
    rest = rows[rows["voltage_V"] == 0].set_index(
        ["plate.radius_m", "membrane.thickness_m", "mass_kg"])["deflection_m"]
    for _, row in rows.iterrows():
        place = row["plate.radius_m"], row["membrane.thickness_m"], row["mass_kg"]
        assert row["stroke_m"] == pytest.approx(row["deflection_m"] - rest[place], abs=0,
                                                rel=1e-12, nan_ok=True)
    assert rows["stroke_m"].isna().sum() == 2


def by_hand(rows: pd.DataFrame, volts: float, most_Pa: float, margin: float) -> pd.DataFrame:
    """The films that keep both at every voltage up to one, the largest stroke first."""
    kept = []
    for _, film in rows.groupby(["plate.radius_m", "membrane.thickness_m", "mass_kg"]):
        way = film[film["voltage_V"] <= volts]
        if ((way["status"] == "equilibrium").all() and (way["max_true_stress_Pa"] < most_Pa).all()
                and (way["breakdown_margin"].dropna() > margin).all()):
            kept.append(way.iloc[-1])
    return pd.DataFrame(kept).sort_values("stroke_m", ascending=False)


@pytest.mark.parametrize(("at", "most", "margin"), [
    ("4 kV", 250e3, 0.0), ("4 kV", 150e3, 0.0), (2e3, 150e3, 3.8), (None, 1e9, 1.9)])
def test_the_best_films_keep_conditions_at_every_voltage_on_the_way(
        result: SweepResult, at: float | str | None, most: float, margin: float) -> None:
    volts = 2e3 if at == 2e3 else 4e3
    answer = result.best("stroke", voltage=at, count=100, under=[
        f"max_true_stress < {most} Pa", f"breakdown_margin > {margin}"])
    expected = by_hand(frame(result.table), volts, most, margin)
    assert len(answer.rows) == len(expected) > 0
    for row, (_, case) in zip(answer.rows, expected.iterrows(), strict=True):
        for name in ("plate.radius_m", "membrane.thickness_m", "mass_kg", "stroke_m", "voltage_V"):
            assert row[name] == case[name], name
        stress, share = row["limited"].values()
        assert stress["at_V"] == 0.0  # where it is largest
        assert stress["value"] == pytest.approx(2e5 * row["mass_kg"] / 20e-3
                                                / (row["membrane.thickness_m"] / 1e-3))
        assert share["at_V"] == volts


def test_conditions_at_the_voltage_alone_would_let_films_pass(result: SweepResult) -> None:
    """At 4 kV the stress of every film is half of that it had without voltage."""
    rows = frame(result.table)
    there = rows[(rows["voltage_V"] == 4e3) & (rows["max_true_stress_Pa"] < 120e3)]
    assert len(there) > len(result.best(under="max_true_stress < 120 kPa", count=100).rows) > 0


def test_a_least_stroke_is_one_at_the_voltage_itself(result: SweepResult) -> None:
    """Without voltage no film has any; a largest one holds on the way, too."""
    rows = frame(result.table)
    there = rows[(rows["voltage_V"] == 4e3) & (rows["stroke_m"] > 0.6)]
    answer = result.best("max_true_stress", under="stroke > 0.6 m", count=100)
    assert len(answer.rows) == len(there) == answer.kept["stroke > 0.6 m"]
    assert 0 < len(there) < answer.equilibria
    for row in answer.rows:
        reached = row["limited"]["stroke > 0.6 m"]
        assert reached["at_V"] == 4e3
        assert reached["value"] > 0.6
    assert len(result.best(under="stroke <= 0.6 m", count=100).rows) == (
        answer.equilibria - len(there))
    assert not result.best(under="deflection > 1 m", voltage=0.0).rows


def test_a_least_force_is_one_at_the_voltage_itself(result: SweepResult) -> None:
    table = result.table.assign(blocked_force_N=(
        10 * result.table["stroke_m"]).where(result.table["voltage"] > 0))
    table["blocked_force_N"].attrs["units"] = "N"
    found = replace(result, table=table)
    forced = found.best(under="blocked_force > 6 N", count=100)
    assert [row["plate.radius_m"] for row in forced.rows] == [
        row["plate.radius_m"] for row in found.best(under="stroke > 0.6 m", count=100).rows]
    assert forced.rows


def test_a_limit_that_was_never_reached_is_beyond_any(result: SweepResult) -> None:
    answer = result.best("stroke", under="breakdown_V > 8 kV, pull_in > 4 kV", count=100)
    assert {row["plate.radius_m"] for row in answer.rows} == {0.01, 0.011}
    assert answer.rows[0]["limited"]["breakdown_V > 8 kV"] == {
        "column": "breakdown_V", "value": None, "at_V": None}
    assert answer.kept == {"breakdown_V > 8 kV": 6, "pull_in > 4 kV": 14}
    assert (answer.cases, answer.equilibria) == (16, 14)
    assert answer.to_pandas()["stroke_m"].is_monotonic_decreasing


@pytest.mark.parametrize(("asked", "words"), [
    ({"of": "strok"}, "best: given 'strok': .*stroke.*did you mean 'stroke'"),
    ({"of": "status"}, "best: given 'status': must be one of"),
    ({"voltage": "3 kV"}, "voltage: given '3 kV': must be one of the sweep's voltages: 0, 2, 4 kV"),
    ({"voltage": "3 mm"}, "voltage: given '3 mm': wrong dimension"),
    ({"under": "max_true_stress"}, "under: given 'max_true_stress': must be a result, one of <"),
    ({"under": "max_true_stress < 3 kV"}, "under: given 'max_true_stress < 3 kV': wrong dimension"),
    ({"under": "breakdown_margin > 3 kV"}, "must be compared with a number without a unit"),
    ({"under": "colour < 3"}, "under: given 'colour < 3': must be one of"),
    ({"count": 0}, "count: given 0: must be a whole number of at least 1"),
])
def test_what_cannot_be_asked_is_said(result: SweepResult, asked: dict[str, Any],
                                      words: str) -> None:
    with pytest.raises(InputError, match=words):
        result.best(**asked)


def test_voltages_of_their_own_are_compared_as_they_are(tmp_path: Path) -> None:
    text = ('specimen = "oval.toml"\nmass = "20 g"\n[list]\nvoltage = ["0 kV", "2 kV"]\n'
            '"plate.radius" = ["8 mm", "9 mm"]\n')
    sweep = read(tmp_path, text)
    with pytest.raises(InputError, match="differ from specimen to specimen"):
        sweep.compared_at("2 kV")
    made: dict[str, TaskResult] = {}
    for entry in sweep.entries:
        assert entry.task is not None
        row = dict.fromkeys(columns()) | {
            "id": entry.task.ids[0], "warnings": [], "status": "equilibrium",
            "deflection_m": 1e-3 + 1e-7 * entry.voltages[0]}
        made[entry.task.id] = TaskResult([row], {})
    table = dataset(sweep, {name: result.packed() for name, result in made.items()})
    assert np.isnan(table["stroke_m"]).all()
    answer = SweepResult({}, 0, 0, "us", "", False, table).best("deflection")
    assert [row["deflection_m"] for row in answer.rows] == pytest.approx([1.2e-3, 1e-3])
    assert answer.at_V is None


SMALL = """
specimen = "oval.toml"
mass = "17.9 g"
voltage = ["0 kV", "2 kV", "4 kV"]
[grid]
"plate.radius" = ["8 mm", "1 cm"]
"""


def test_command_and_python_answer_alike(tmp_path: Path, capsys) -> None:
    file, under = written(tmp_path, SMALL), "max_true_stress < 300 kPa"
    line = ["sweep", str(file), "-o", str(tmp_path / "out"), "--workers", "1", "--refine", "0.6",
            "--voltage", "2 kV", "--best", "stroke", "--under", under, "--json"]
    assert main(line) == 0
    of_command = json.loads(capsys.readouterr().out)["best"]
    settings = tympan.Settings(tympan.MeshSettings().refined(0.6))
    swept = tympan.sweep(file, folder=tmp_path / "out", settings=settings, voltage="2 kV")
    assert swept.kept == 6  # none was solved again
    assert swept.best("stroke", under=under).json() == of_command
    first = of_command["rows"][0]
    specimen = tympan.load(tmp_path / "oval.toml")
    plate = tympan.Plate(tympan.Circle(first["plate.radius_m"]))
    film = tympan.Specimen("film", specimen.frame, plate, specimen.membrane)
    rest, charged = (tympan.solve(film, settings=settings, mass="17.9 g", voltage=volts)
                     for volts in (0.0, "2 kV"))
    assert first["stroke_m"] == pytest.approx(charged.deflection_m - rest.deflection_m, rel=1e-5)
    assert first["limited"][under]["value"] == pytest.approx(rest.max_true_stress_Pa, rel=1e-6)
    assert main(line[:-1]) == 0
    words = capsys.readouterr().out
    assert f"{under}: {rest.max_true_stress_Pa / 1e3:.5g} kPa at 0 kV" in words
    assert re.search("statuses +6 equilibrium\nby +6 finite elements\n", words)
    assert swept.by == {"finite elements": 6}


@pytest.mark.parametrize(("asked", "words"), [
    (["--voltage", "3 kV"],
     "--voltage: given '3 kV': must be one of the sweep's voltages: 0, 2, 4 kV"),
    (["--best", "strok"], "--best: given 'strok': must be one of "),
    (["--best", "stroke", "--under", "a < 3"], "--under: given ['a < 3']: must be one of "),
    (["--under", "stroke < 3 mm"], "--under: given 'stroke < 3 mm': needs --best"),
])
def test_what_is_wrong_is_said_before_anything_is_solved(tmp_path: Path, capsys, asked: list[str],
                                                         words: str) -> None:
    file = written(tmp_path, SMALL)
    assert main(["sweep", str(file), "-o", str(tmp_path / "out"), *asked]) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_films_beyond_a_limit_are_counted_marked_and_may_be_left_out(result: SweepResult) -> None:
    """Thin films exceed their strength at 4 kV; slack ones stay beyond that limit at all above."""
    table = result.table.copy(deep=True)
    table["breakdown_margin"] /= 1.9
    slack = (table["voltage"] == 2e3) & (table["plate.radius"] < 8.5e-3)
    table["slack_share"] = (0 * table["deflection_m"] + 0.1 * slack).variable
    found = replace(result, table=table)
    rows = frame(table)
    weak = rows[(rows["breakdown_margin"] < 1) & (rows["voltage_V"] == 4e3)]
    assert 0 < len(weak) < 16
    ending = " at 4 kV, though they have an equilibrium by the equations"
    assert found.json()["warnings"] == found.warnings == [
        f"{len(weak)} of 16 films beyond breakdown{ending}",
        f"4 of 16 films beyond loss of tension{ending}"]
    assert replace(found, at_V=0.0).warnings == result.warnings == []
    best = found.best(count=20)
    assert sum("breakdown" in row["beyond"] for row in best.rows) == len(weak)
    assert {row["plate.radius_m"] for row in best.rows if "tension" in row["beyond"]} == {8e-3}
    assert best.ends == ("plate.radius",)  # of two thicknesses each is at an end
    assert all("breakdown" not in row["beyond"]
               for row in found.best(under="breakdown_margin > 1").rows)
