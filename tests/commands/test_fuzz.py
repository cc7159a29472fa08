"""Files changed at random are read or refused; ``make fuzz`` tries many more, ``make hostile``
commands."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import pytest
from hypothesis import HealthCheck, given, settings

from benchmarks.trials.fuzz import kinds
from benchmarks.trials.fuzz.reading import inputs, survive
from benchmarks.trials.hostile import all_cases
from benchmarks.trials.hostile.case import Answer, Case, run

KINDS = kinds()


@pytest.mark.parametrize("name", KINDS)
def test_what_is_changed_can_be_read(name: str, tmp_path) -> None:
    """So that a change is what is refused."""
    for content in KINDS[name].contents:
        for file, text in (("oval.toml", KINDS["specimen"].contents[0]),
                           ("dataset.toml", KINDS["dataset"].contents[0]),
                           ("static.csv", KINDS["static"].contents[0])):
            (tmp_path / file).write_bytes(text)
        (tmp_path / KINDS[name].file).parent.mkdir(exist_ok=True)
        (tmp_path / KINDS[name].file).write_bytes(content)
        kind = KINDS[name]
        with pytest.raises(kind.refusals) if kind.refused else nullcontext():
            kind.read(tmp_path)


@given(inputs("explorer"))
@settings(max_examples=30, derandomize=True, database=None, deadline=None,
          suppress_health_check=list(HealthCheck))
@pytest.mark.skipif("explorer frames" not in KINDS, reason="aiohttp is not installed")
def test_nothing_breaks_the_explorers_server(item: tuple[str, bytes]) -> None:
    """An answer that does not come is waited for, so that there are few."""
    survive(*item)


@given(inputs().filter(lambda item: "explorer" not in item[0]))
@settings(max_examples=300, derandomize=True, database=None, deadline=None,
          suppress_health_check=list(HealthCheck))
def test_no_file_breaks_its_reader(item: tuple[str, bytes]) -> None:
    survive(*item)


def test_hostile_commands_are_judged_by_status_words_and_time() -> None:
    case = next(case for case in all_cases()["options"] if case.name == "seed -1")
    assert run(case).fault(case) == ""
    version = Case("version", "--version", {})
    assert run(version).fault(version) == "status 0"
    message = "tympan: --seed: must be from 0\n"
    for answer, fault in ((Answer(2, message, 0.1), ""), (Answer(1, message, 0.1), "status 1"),
                          (Answer(2, "tympan: no\n", 0.1), "other words"),
                          (Answer(2, f"and\n{message}", 0.1), "not one line"),
                          (Answer(2, f"Traceback\n{message}", 0.1), "never words"),
                          (Answer(2, message, 0.1, "", "b.json changed"), "b.json changed"),
                          (Answer(2, message, 2.1), "late")):
        assert answer.fault(case) == fault
    assert Answer(2, message, 0.1).fault(replace(case, shows="mm")) == "other output"


def test_hostile_commands_see_what_is_in_the_folder() -> None:
    """Before the command and after it."""
    case = Case("version", "--version", {"a/b.txt": "b"}, status=0, shows="tympan",
                prepare=lambda folder: (folder / "a" / "b.txt").rename(folder / "c.txt"),
                check=lambda folder: "" if (folder / "c.txt").read_text() == "b" else "b is lost")
    assert run(case).fault(case) == ""
    script = Case("script", "a.py", {"a.py": "import os\nprint(os.listdir())"}, status=0,
                  shows=r"\['a.py'\]", program=(), check=lambda folder: "always")
    assert run(script).fault(script) == "always"
