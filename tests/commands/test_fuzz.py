"""Files changed at random are read or refused; ``make fuzz`` tries many more."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings

from benchmarks.trials.fuzz import KINDS, inputs, survive


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
