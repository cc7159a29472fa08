"""Data of an independent solver with what benches do to it: what is told of the noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tympan.reports.diagnosis.page import build_diagnosis_page, verdict_words
from tympan.studies.data.dataset import read_dataset
from tympan.studies.diagnosis.diagnose import diagnose, judge_dataset
from tympan.studies.diagnosis.inference.verdict import Judgement
from tympan.studies.diagnosis.result import READINGS, Diagnosis

BENCH = Path(__file__).parent / "bench"


def folder_of(folder: Path, name: str, noise: str = "10 um") -> Path:
    """A dataset of the bench."""
    about = f'name = "{name}"\ngravity = "9.80665 m/s^2"\n'
    about += f'noise = "{noise}"\n' if noise else ""
    (folder / "dataset.toml").write_text(about + (BENCH / "films.toml").read_text())
    for file in BENCH.glob(f"{name}*.csv"):
        stem = file.stem.removeprefix(name).removeprefix("-") or "static"
        (folder / f"{stem}.csv").write_text(file.read_text())
    return folder


def judged(folder: Path, name: str, noise: str = "10 um") -> Judgement:
    return judge_dataset(read_dataset(folder_of(folder, name, noise)))[1]


def lines_off(judgement: Judgement) -> list[tuple[str, int]]:
    table, off = judgement.table, np.flatnonzero(judgement.table.noise.off)
    return [(str(table.file[row]), int(table.line[row])) for row in off]


@pytest.mark.study(seconds=7)
def test_one_reading_off_is_told_and_the_rest_agrees(tmp_path: Path) -> None:
    judgement = judged(tmp_path, "slip")
    assert judgement.verdict == "nothing"
    assert lines_off(judgement) == [("static.csv", 67)]
    assert judgement.table.noise.off.max() == pytest.approx(0.5e-3, abs=40e-6)
    assert judgement.table.noise.memories == ()
    assert judgement.test_of_all is not None
    assert judgement.test_of_all.p_value < 1e-3 < judgement.test.p_value


@pytest.mark.study(seconds=3)
def test_errors_that_remember_are_no_misfit(tmp_path: Path) -> None:
    judgement = judged(tmp_path, "remembers", noise="")
    assert judgement.verdict == "nothing"
    (memory,) = judgement.table.noise.memories
    assert memory.correlation == pytest.approx(0.8, abs=0.15)
    assert not lines_off(judgement)


@pytest.mark.study(seconds=9)
def test_a_frequency_of_another_mode_is_told(tmp_path: Path) -> None:
    """And the other eleven keep the noise that is written beside them."""
    judgement = judged(tmp_path, "mode")
    assert judgement.verdict == "nothing"
    assert lines_off(judgement) == [("frequency.csv", 6)]
    others = judgement.table.sigma[(judgement.table.kind == "frequency")
                                   & (judgement.table.noise.off == 0)]
    assert np.all(others < 0.1)


@pytest.fixture(scope="module")
def with_slips(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    return diagnose(read_dataset(folder_of(tmp_path_factory.mktemp("bench"), "zero")))


@pytest.mark.study(seconds=21)
def test_an_effect_is_named_beside_slips(with_slips: Diagnosis) -> None:
    (cause,) = (cause for cause in with_slips.causes if cause.named)
    assert cause.effect == "sensor_zero"
    (size,) = cause.parameters.values()
    assert size.low is not None
    assert size.high is not None
    assert size.low < 200 < size.high


def test_slips_are_told_by_line_and_size(with_slips: Diagnosis, tmp_path: Path) -> None:
    """In JSON, in the words of command and page, and in the page's table; and read back."""
    off = with_slips.readings_off
    assert [(one.file, one.line) for one in off] == [
        ("static.csv", line) for line in (11, 42, 55)]
    assert all(one.unit == "mm" and one.probability > 0.99 for one in off)
    words = verdict_words(with_slips)
    with_slips.save(tmp_path)
    (file,) = build_diagnosis_page(Diagnosis.load(tmp_path), tmp_path)
    page = file.read_text()
    columns = Diagnosis.load(tmp_path).tables[READINGS]
    assert columns["line"][columns["counts"] == 0].tolist() == [11, 42, 55]
    assert np.all(columns["sigma"] < 15e-6)
    for one in off:
        assert f"static.csv, line {one.line}, reads {one.read:.5g} mm" in words
        assert f"<td>{one.line}</td>" in page
