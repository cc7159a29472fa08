"""Two results side by side: what differs, in both doors."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import tympan
from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.reports.comparison import OF_THE_RUN, differences


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two films solved under one load each, and stored."""
    folder = tmp_path_factory.mktemp("compared")
    for name, mass in (("light", "10 g"), ("heavy", "20 g")):
        (folder / name).mkdir()
        tympan.solve(circular(), mass=mass, voltage="2 kV").numbers.save(folder / name)
    return folder / "light", folder / "heavy"


def test_differences_are_those_of_the_numbers(pair: tuple[Path, Path]) -> None:
    light, heavy = (tympan.Result.load(folder) for folder in pair)
    table = light.compare(heavy)
    row = table.loc["deflection_m"]
    assert row["first"] == light.deflection_m
    assert row["second"] == heavy.deflection_m
    assert row["difference"] == pytest.approx(heavy.deflection_m - light.deflection_m)
    assert row["relative"] == pytest.approx(heavy.deflection_m / light.deflection_m - 1)
    assert not OF_THE_RUN & {*table.index}
    shared = {name for name, value in light.json().items() if heavy.json()[name] == value}
    assert not shared & {*table.index}
    assert "voltage_V" in shared
    assert table.equals(tympan.compare(*pair))
    assert light.compare(light).empty


def test_the_command_prints_what_python_has(pair: tuple[Path, Path],
                                            capsys: pytest.CaptureFixture[str]) -> None:
    words = [str(folder) for folder in pair]
    assert main(["compare", *words, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)["differences"]
    assert [row["name"] for row in printed] == [*tympan.compare(*pair).index]
    assert main(["compare", *words]) == 0
    said = capsys.readouterr().out
    assert "mass" in said
    assert "+100 %" in said
    assert main(["compare", words[0], words[0]]) == 0
    assert capsys.readouterr().out == "No value differs by more than 1e-9 of itself.\n"


def test_of_a_list_the_largest_difference_is_listed(pair: tuple[Path, Path]) -> None:
    first = tympan.Result.load(pair[0]).numbers
    second = replace(first, warnings=("said",))
    found, = differences(first, second)
    assert (found.name, found.first, found.second) == ("warnings.0", None, "said")
    assert found.difference is None

    class Listed:
        def __init__(self, *values: float) -> None:
            self.values = values

        def json(self) -> dict[str, list[float]]:
            return {"values": [*self.values]}

    found, = differences(Listed(1.0, 2.0, 3.0), Listed(1.1, 2.5, 3.1))
    assert (found.name, found.difference) == ("values.1", 0.5)


def test_other_kinds_and_missing_results_are_refused(pair: tuple[Path, Path], tmp_path: Path,
                                                     capsys: pytest.CaptureFixture[str]) -> None:
    solved = tympan.Result.load(pair[0])
    with pytest.raises(InputError, match="must be of the same kind as the first, CaseResult"):
        solved.compare(tympan.modes(circular(), mass="10 g", count=1))
    assert main(["compare", str(pair[0]), str(tmp_path / "nothing")]) == 2
    assert "nothing: does not exist" in capsys.readouterr().err
