"""Large counts of rows, samples and bends: memory beyond results stays, and how far it is shows."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.lumped import MODELS
from tests.support.specimens import circular
from tympan import progress
from tympan.base.errors import InputError
from tympan.studies.case import Settings
from tympan.studies.columns import Column, Sheet, read_own_sheet, read_sheet, write_sheet
from tympan.studies.lumped import simulate as lumped
from tympan.studies.signals import Pieces, step
from tympan.studies.trace import sample_count
from tympan.studies.transient import TransientCase, respond
from tympan.tables.columns import TOGETHER

COLUMNS = (Column("t", "s"), Column("voltage", "kV"))
#: Rows of a table, many times what is in memory as texts at once.
MANY = 5 * TOGETHER


def peak(call: Callable[[], object]) -> int:
    """Most bytes that a call takes at once."""
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A long table, which no test changes."""
    time, file = np.arange(MANY) * 1e-3, tmp_path_factory.mktemp("long") / "signal.csv"
    write_sheet(file, COLUMNS, {"t": time, "voltage": 1e3 * (time % 2.0)})
    return file


def test_a_long_table_is_read_and_written_in_little_memory(written: Path) -> None:
    """A row takes some 160 bytes, most of them the file's own; as a list of texts it takes 400."""
    sheets: list[Sheet] = []
    taken = peak(lambda: sheets.append(read_sheet(written, COLUMNS)))
    assert taken < 200 * MANY
    sheet = sheets[0]
    assert sheet.t == pytest.approx(np.arange(MANY) * 1e-3, rel=1e-11)
    assert sheet.voltage == pytest.approx(1e3 * (sheet.t % 2.0), abs=1e-6)
    again = written.with_name("again.csv")
    assert peak(lambda: write_sheet(again, COLUMNS, sheet.values)) < 500 * TOGETHER
    assert again.read_bytes() == written.read_bytes()
    assert read_own_sheet(again, COLUMNS)["t"].tolist() == sheet.t.tolist()


@pytest.mark.parametrize("line", [2, TOGETHER + 2, MANY + 1])
def test_what_is_wrong_in_a_long_table_is_named_wherever_it_stands(written: Path, line: int
                                                                   ) -> None:
    lines = written.read_text().splitlines()
    for row, words in (("7,x", "must be a number"), ("7", "must have 2 cells")):
        file = written.with_name("wrong.csv")
        file.write_text("\n".join([*lines[:line - 1], row, *lines[line:], ""]))
        with pytest.raises(InputError, match=rf"line {line}.*{words}"):
            read_sheet(file, COLUMNS)
    sheet = read_sheet(written, COLUMNS)
    assert f"line {line}, column 1 (t_s): given '{lines[line - 1].split(',')[0]}': no" in str(
        sheet.error(line - 2, "t", "no"))


def test_samples_of_all_specimens_count_together() -> None:
    """They are written into one file, which has to be read again."""
    assert sample_count(0.5, 1e-6) == 500_001
    with pytest.raises(InputError, match="1000000 samples"):
        sample_count(0.5, 1e-6, runs=3)


def test_too_many_bends_are_refused_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch
                                                                ) -> None:
    monkeypatch.setattr(lumped, "first_mesh", None)
    monkeypatch.setattr(lumped, "_WORK", 6000)
    actuator = MODELS["paper"]
    with pytest.raises(InputError, match=r"1003 bends in 1 s.*takes too many steps"):
        lumped.simulate(actuator, Pieces(np.linspace(0, 1, 1003), np.arange(1003) % 2.0))


def test_a_run_says_how_much_of_its_signal_is_over() -> None:
    shares: list[list[float]] = [[], []]
    actuator = MODELS["paper"]
    many = np.linspace(0, 1, 9000)
    lumped.simulate(actuator, Pieces(many, 1e3 * (np.arange(9000) % 2.0)),
                    progress=shares[0].append)
    case = TransientCase(circular(), step(0.0, 1e3, 0.5, 1.0), mass=10e-3)
    respond(case, Settings(), 0.1, progress=shares[1].append)
    for told in shares:
        assert len(told) > 2
        assert told == sorted(told)
        assert told[-1] == pytest.approx(1.0)


def test_a_bar_goes_on_within_a_step(monkeypatch: pytest.MonkeyPatch,
                                     capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    shown: list[float] = []
    with progress.bar(2) as at:
        made = next(cell.cell_contents for cell in at.__closure__
                    if hasattr(cell.cell_contents, "set_postfix_str"))
        for words, share in (("a", None), ("", 0.25), ("b", None), ("", 0.5)):
            at(words, share)
            shown.append(made.n)
    assert shown == [0, 0.25, 1, 1.5]
    assert made.n == 2
