"""Readings of every film and rig, and what a diagnosis makes of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.compose.concepts import Asked, Combination, concepts, write_drawings
from benchmarks.compose.data import (
    RAISED,
    Judged,
    Read,
    design_for,
    of_combination,
    table_of,
    write,
)
from benchmarks.trials.synthetic_trials import Truth
from tympan.studies.data.dataset import read_dataset

NAMED = {concept.name: concept for concept in concepts()}
#: Nothing but the plain film, a mechanism, no plate, a plate that rubs, a drawing.
CASES = [(), ("frame ellipse", "bias magnet"), ("no plate", "rig.gas_pressure"),
         ("rig.friction",), ("frame drawn",)]


def asked(folder: Path, names: tuple[str, ...]) -> Asked:
    return Combination(tuple(NAMED[name] for name in names)).write(folder)


@pytest.mark.parametrize("mapped", [False, True])
@pytest.mark.parametrize("names", CASES, ids=lambda names: " + ".join(names) or "plain")
def test_written_readings_are_read_back_with_film_and_rig(tmp_path: Path, names: tuple[str, ...],
                                                          mapped: bool) -> None:
    files = tmp_path / "in"
    files.mkdir()
    write_drawings(files)
    one = asked(files, names)
    design = design_for(one, 1.0)
    values = np.linspace(1e-3, 4e-3, len(design.table))
    write(one, Read(design, Truth(), values, 1e-9), tmp_path / "set", mapped,
          np.random.default_rng(1))
    data = read_dataset(tmp_path / "set")
    sheet = data.static
    assert sheet is not None
    assert sheet["displacement"] == pytest.approx(values, abs=1e-8)
    assert sheet["voltage"] == pytest.approx(design.table.voltage)
    if one.mass is not None:
        assert sheet["mass"] == pytest.approx(design.table.mass)
    assert data.specimens == design.setup.specimens
    assert data.rig == design.setup.rig
    assert ("Weg [mm]" in (tmp_path / "set" / "static.csv").read_text("utf-8")) is mapped


def judged(hidden: str, named: tuple[str, ...], verdict: str = "named") -> Judged:
    return Judged("plain", hidden, False, 5.0, verdict, named, (), 100.0, 50.0, 1.0)


def test_a_name_is_wrong_unless_it_is_hidden_or_of_its_family() -> None:
    assert judged("", ("friction",)).wrong
    assert not judged("", (), "nothing").wrong
    assert judged("voltage_sag", ("voltage_sag",)).right
    assert judged("voltage_sag", ("friction",)).wrong
    # Both carry part of the load.
    assert judged("unaccounted_mass", ("friction",)).right
    assert not judged("voltage_sag", (), "ambiguous").right


def test_what_raised_is_counted_and_no_verdict() -> None:
    raised = judged("friction", (), RAISED)
    assert not raised.ended
    row = next(line for line in table_of([raised, judged("friction", ("friction",))])
               if line.startswith("| headings as tympan has them, one effect"))
    assert [cell.strip() for cell in row.split("|")[2:7]] == ["2", "1", "0", "0", "1"]


@pytest.mark.study(seconds=12)
@pytest.mark.parametrize("names", CASES[1:3], ids=" + ".join)
def test_nothing_hidden_is_nothing_and_an_effect_is_not_named_wrongly(tmp_path: Path,
                                                                      names: tuple[str, ...]
                                                                      ) -> None:
    (tmp_path / "in").mkdir()
    found = of_combination(Combination(tuple(NAMED[name] for name in names)), 0, tmp_path, seed=1)
    assert [one.ended for one in found] == [True, True], found
    assert found[0].verdict == "nothing"
    assert not any(one.wrong for one in found)
    assert found[1].verdict != "nothing"
