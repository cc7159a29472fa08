"""What synthetic readings say of a design: they are made as said, and counted as said."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.checks.policy import unlawful
from tests.support.datasets import HEAD, write_dataset
from tests.support.trials import design, every_cause
from tympan.cli import main
from tympan.studies.diagnosis.hypothesis import Cause
from tympan.studies.diagnosis.reading_table import ReadingTable
from tympan.studies.diagnosis.reduced.simulation import Simulation
from tympan.studies.diagnosis.self_check import (
    Bench,
    SyntheticSet,
    self_checked,
    sizes_at,
    summary_of,
)

SAG, ZERO, MASS = Cause("voltage_sag"), Cause("sensor_zero"), Cause("unaccounted_mass")


def test_sizes_are_so_many_usual_ones_in_any_direction() -> None:
    generator = np.random.default_rng(1)
    for name in ("plate_eccentricity", "sensor_zero", "voltage_sag"):
        cause = Cause(name)
        usual = np.array([parameter.deviation for parameter in cause.effect.parameters])
        drawn = np.array([sizes_at(generator, cause, 3.0) / usual for _ in range(20)])
        assert np.linalg.norm(drawn, axis=1) == pytest.approx(np.full(20, 3.0))
        assert (drawn < 0).any() == (cause.effect.parameters[0].limits[0] < 0)


def test_what_is_said_is_counted() -> None:
    """Two sets named rightly, one wrongly, one listed; the pair that is listed together is told."""
    sets = [SyntheticSet(SAG, 2.0, "named", (SAG,)), SyntheticSet(SAG, 1.0, "named", (SAG,)),
            SyntheticSet(SAG, 3.0, "named", (ZERO,)), SyntheticSet(SAG, 0.6, "nothing", ()),
            *[SyntheticSet(ZERO, 2.0, "ambiguous", (MASS, ZERO))] * 3,
            *[SyntheticSet(MASS, 2.0, "ambiguous", (MASS, ZERO))] * 3,
            SyntheticSet(MASS, 0.0, "nothing", ()), SyntheticSet(None, 0.0, "nothing", ())]
    record = summary_of(sets)
    rows = {row["cause"]: row for row in record.rows}
    assert record.sets == 11
    assert (rows["voltage_sag"]["sets"], rows["voltage_sag"]["named"]) == (4, 2)
    assert (rows["sensor_zero"]["listed"], rows["nothing"]["nothing"]) == (3, 1)
    assert record.usual_or_more["named"] == pytest.approx(2 / 9)
    assert record.not_told_apart == (("sensor_zero", "unaccounted_mass"),)
    assert "22 %" in record.sentence
    assert "sensor_zero from unaccounted_mass" in record.sentence


def stated(table: ReadingTable) -> ReadingTable:
    """With a noise that is well known."""
    return table.with_noise(replace(table.noise, freedom=np.array([30.0])))


@pytest.mark.study(seconds=11)
def test_a_good_design_names_more_than_a_poor_one(three_shapes: Simulation) -> None:
    """By the same causes; the same seed gives the same sets, whichever process makes them."""
    causes = (SAG, Cause("prestretch_loss", "circular"), MASS)
    good = Bench(three_shapes, np.zeros(2), stated(design(10e-6)), causes, seed=3)
    poor = Bench(three_shapes, np.zeros(2), stated(design(150e-6, voltages=3)), causes, seed=3)
    records = [self_checked(bench, 7) for bench in (good, poor)]
    named = [record.usual_or_more["named"] for record in records]
    assert named[0] >= 0.5 > named[1]
    assert good.judged_set(4) == good.judged_set(4)


def test_every_cause_can_be_hidden(three_shapes: Simulation) -> None:
    bench = Bench(three_shapes, np.zeros(2), design(10e-6, voltages=3),
                  tuple(every_cause(three_shapes)))
    names = {cause.name for cause in bench.causes}
    hidden = {bench.hidden(number, np.random.default_rng(number))
              for number in range(2 * len(names))}
    assert {cause.name for cause in hidden if cause} == names
    assert None in hidden


@pytest.mark.study
def test_a_design_of_few_readings_is_told_so(tmp_path: Path,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    """One shape, three voltages, before any reading."""
    rows = "".join(f"A,{mass},{voltage},\n" for mass in (17.9, 22.45) for voltage in (0, 3, 6))
    folder = write_dataset(tmp_path / "data", HEAD + 'noise = "20 um"\n', ("A",),
                           static=f"specimen,mass_g,voltage_kV,displacement_mm\n{rows}")
    assert main(["diagnose", str(folder), "--plan", "--self-check", "40", "--json",
                 "-o", str(tmp_path / "out"), "--workers", "1"]) == 0
    record = json.loads(capsys.readouterr().out)["self_check"]
    assert "can name hardly anything" in record["sentence"]
    assert record["usual_or_more"]["named"] < 0.1
    page = (tmp_path / "out" / "self-check.html").read_text(encoding="utf-8")
    assert "hardly anything" in page
    assert unlawful(page) == []
