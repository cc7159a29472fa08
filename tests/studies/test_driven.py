"""Voltages by the names of segments: what is read, at both doors, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest

import tympan
from tests.support.checks.json_schema import printed_record
from tests.support.specimens import circular, quarters
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.toml_writer import specimen_to_toml
from tympan.studies.driven import driven, drives

FOUR = quarters(1e-3)


def shares(given: object) -> tuple[list[float], object]:
    specimen, voltage = driven(FOUR, given)
    return [segment.share for segment in specimen.electrode.segments], voltage


def test_voltages_become_shares_of_the_highest() -> None:
    for given in ("A = 3 kV, C = 1.5 kV", "A=3kV,C=1500 V", {"A": "3 kV", "C": 1500.0}):
        assert shares(given) == ([1.0, 0.0, 0.5, 0.0], "3000 V")
    assert shares("A = 80 %, B = 40 %") == ([1.0, 0.5, 0.0, 0.0], "80 %")
    assert shares("3 kV") == ([1.0] * 4, "3 kV")


def test_several_voltages_keep_their_proportion() -> None:
    assert shares("A = 1 kV, 2 kV, B = 0.5 kV, 1 kV") == ([1.0, 0.5, 0.0, 0.0], [1e3, 2e3])
    assert shares("A = 0 kV..2 kV in 3") == ([1.0, 0.0, 0.0, 0.0], [0.0, 1e3, 2e3])
    with pytest.raises(InputError, match="proportion"):
        driven(FOUR, "A = 1 kV, 2 kV, B = 1 kV")
    assert [top for _, top in drives(FOUR, "A = 1 kV, 2 kV, B = 3 kV")] == [3e3, 3e3]


@pytest.mark.parametrize(("given", "said"), [
    ("A = 3 kV, E = 2 kV", "A, B, C, D"), ("A = 3 kV, A = 2 kV", "once"),
    ("2 kV, A = 3 kV", "once"), ("A = 3", "no unit"), ("A = 3 kV, B = 50 %", "all of them"),
    ("A = 120 %", "from 0 to 100 %"), (["A = 3 kV", "2 kV"], "in all voltages"),
    ("A = 1 kV, 2 kV, B = 1 kV, 2 kV, 3 kV", "equally many")])
def test_what_cannot_be_read_is_refused(given: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        driven(FOUR, given)


def test_one_electrode_has_no_names() -> None:
    with pytest.raises(InputError, match="no segments"):
        driven(circular(), "A = 3 kV")


def test_both_doors_take_them(tmp_path: Path, capsys) -> None:
    file = tmp_path / "four.toml"
    file.write_text(specimen_to_toml(FOUR))
    by_name = tympan.solve(file, mass="17.9 g", voltage="A = 3 kV, B = 1 kV")
    assert tympan.solve(file, mass="17.9 g", voltage={"B": 1e3, "A": 3e3}).tilt_rad == (
        by_name.tilt_rad)
    assert main(["solve", str(file), "--mass", "17.9 g", "--voltage", "A = 3 kV, B = 1 kV",
                 "--json"]) == 0
    printed = printed_record(capsys.readouterr().out)
    assert printed["tilt_x_rad"] == by_name.tilt_x_rad
    assert printed["voltage_V"] == 3e3
    assert tympan.load(file).electrode == FOUR.electrode
