"""Files changed at random are read or refused; ``make fuzz`` tries many more, ``make hostile``
commands."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings

from benchmarks.trials.fuzz import KINDS, inputs, survive
from benchmarks.trials.hostile_commands import Answer, Command, commands, run


@pytest.mark.parametrize("name", KINDS)
def test_what_is_changed_can_be_read(name: str, tmp_path) -> None:
    """So that a change is what is refused."""
    for content in KINDS[name].contents:
        for file, text in (("oval.toml", KINDS["specimen"].contents[0]),
                           ("dataset.toml", KINDS["dataset"].contents[0]),
                           ("static.csv", KINDS["static"].contents[0])):
            (tmp_path / file).write_bytes(text)
        (tmp_path / KINDS[name].file).write_bytes(content)
        if name != "drawing":  # its curves lie apart
            KINDS[name].read(tmp_path)


@given(inputs())
@settings(max_examples=300, derandomize=True, database=None, deadline=None,
          suppress_health_check=list(HealthCheck))
def test_no_file_breaks_its_reader(item: tuple[str, bytes]) -> None:
    survive(*item)


def test_hostile_commands_are_judged_by_status_words_and_time() -> None:
    (kind, command), *_ = [pair for pair in commands() if pair[0] == "options"]
    assert run(command).fault(command) == "", kind
    assert run(Command("--version", {}, "")).fault(Command("--version", {}, "")) == "status 0"
    message = "tympan: --seed: must be from 0\n"
    for answer, fault in ((Answer(2, message, 0.1), ""), (Answer(1, message, 0.1), "status 1"),
                          (Answer(2, "tympan: no\n", 0.1), "other words"),
                          (Answer(2, f"Traceback\n{message}", 0.1), "not one line"),
                          (Answer(2, message, 2.1), "late")):
        assert answer.fault(command) == fault
