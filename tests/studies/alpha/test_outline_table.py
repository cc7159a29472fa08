"""α of every registered outline: one table, one figure, one command."""

from __future__ import annotations

import csv
import json
from contextlib import redirect_stdout

import pytest

from tympan.cli import main
from tympan.geometry.outlines import OUTLINES, examples
from tympan.studies.alpha.table import HEADER


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory):
    target = tmp_path_factory.mktemp("outlines")
    with (target / "printed.txt").open("w", encoding="utf-8") as file, redirect_stdout(file):
        assert main(["outlines", "-o", str(target), "--refine", "0.7"]) == 0
    return target


@pytest.mark.study(seconds=21)
def test_every_registered_outline_has_its_row(folder) -> None:
    with (folder / "outlines.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["shape"] for row in rows] == list(examples())
    assert set(examples()) == set(OUTLINES) - {"dxf", "step"}
    assert tuple(rows[0]) == HEADER
    assert (folder / "outlines.png").stat().st_size > 10_000


@pytest.mark.study(seconds=21)
def test_the_printed_table_has_a_head_above_its_columns(folder) -> None:
    printed = (folder / "printed.txt").read_text(encoding="utf-8").splitlines()
    head, *lines, whose = printed[:-2]
    assert whose.startswith("Film and loads are the source paper's")
    assert printed[-2:] == [str(folder / f"outlines.{kind}") for kind in ("png", "svg")]
    # What the fields alone give stands in the file only.
    shown = [name for name in HEADER[:-1] if not name.startswith("field_")]
    assert head.split() == shown
    assert [line.split()[0] for line in lines] == list(examples())
    assert all(len(line.split()) == len(shown) for line in lines)


@pytest.mark.study(seconds=21)
def test_two_circles_hold_for_every_outline_where_they_were_not_fitted(folder) -> None:
    for row in json.loads((folder / "outlines.json").read_text(encoding="utf-8")):
        assert row["alpha_1"] + (row["alpha_2"] or 0) == pytest.approx(1)
        assert row["held_out_error"] < 1e-4
        assert row["one_circle_held_out_error"] < 2e-4
        assert 0 < row["field_held_out_error"] < 0.1 or row["shape"] == "circle"
        if row["alpha_2"] is not None:
            assert row["circle_1_mm"] < row["one_circle_mm"] < row["circle_2_mm"]
