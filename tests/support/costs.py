"""Processor seconds of each test, and a tenth of the dear ones, drawn anew for every commit.

A plugin of pytest. What a test may cost, and what to do where it costs more, is in CONTRIBUTING.md.
"""

from __future__ import annotations

import os
import subprocess
from collections import defaultdict
from collections.abc import Iterator
from hashlib import sha256
from math import inf
from pathlib import Path
from typing import Any

import pytest
from _pytest.mark.structures import ParameterSet

#: A test in the suite costs at most so many processor seconds, with the fixtures it is first to ask
#: for. At 10 s a hundred such tests would take the suite's whole time.
ALLOWED = 10.0
#: How many of the dearest tests are printed.
PRINTED = 10
#: Share of the dear tests that every run of the suite has.
SHARE = 0.1
#: Dear tests above are never drawn: few of them would take as long as all others of a chapter.
MOST = 15.0

_SECONDS = "processor_s"


def processor_seconds() -> float:
    """Processor time of this process and of its ended children, in seconds."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def commits() -> int:
    """Count of commits of this checkout, 0 where it has no history."""
    counted = subprocess.run(["git", "rev-list", "--count", "HEAD"], cwd=Path(__file__).parent,
                             capture_output=True, text=True, check=False)
    return int(counted.stdout) if counted.returncode == 0 else 0


def is_drawn(name: str, seed: int) -> bool:
    """Whether a dear test of this name runs with the suite at this seed."""
    return int(sha256(f"{seed} {name}".encode()).hexdigest()[:8], 16) < SHARE * 2**32


def dear(*values: Any, seconds: float, name: str | None = None) -> ParameterSet:
    """Values of a parametrised test that alone costs so many processor seconds.

    It is run by ``make study-tests``; the suite runs a tenth of such tests, drawn anew for every
    commit.
    """
    return pytest.param(*values, marks=pytest.mark.study(seconds=seconds), id=name)


def draws(config: pytest.Config) -> bool:
    """Whether a run is that of the whole suite, without the dear tests."""
    return (config.args_source == pytest.Config.ArgsSource.TESTPATHS
            and "not study" in config.option.markexpr)


def pytest_report_header(config: pytest.Config) -> list[str]:
    if not draws(config):
        return []
    return [f"dear tests: {SHARE:.0%} of those of at most {MOST:g} s, drawn by seed {commits()} "
            "(count of commits)"]


def is_of(item: pytest.Item, marker: pytest.Mark) -> bool:
    """Whether a mark of a parametrised test is of this one of its values."""
    only = marker.kwargs.get("only")
    return only is None or item.name.partition("[")[2].removesuffix("]") in only


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Let the dear tests that are drawn run as all others do, and cheap values of dear tests.

    The files on top, which are long, come first: one of them at the end would run alone.
    """
    items.sort(key=lambda item: item.path.parent.name != "tests")
    seed = commits() if draws(config) else None
    for item in items:
        every = list(item.iter_markers("study"))
        markers = [marker for marker in every if is_of(item, marker)]
        seconds = [marker.kwargs.get("seconds", inf) for marker in markers]
        drawn = (seed is not None and max(seconds, default=0.0) <= MOST
                 and is_drawn(item.nodeid, seed))
        if every and (drawn or not markers):
            item.own_markers[:] = [mark for mark in item.own_markers if mark.name != "study"]


class Clock:
    """Processor time at the last report of this process."""

    def __init__(self) -> None:
        self.last = processor_seconds()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self) -> Iterator[None]:
        report = yield
        now = processor_seconds()
        report.user_properties.append((_SECONDS, now - self.last))
        self.last = now
        return report


def pytest_sessionstart(session: pytest.Session) -> None:
    session.config.pluginmanager.register(Clock())


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the dearest tests, and the seconds of all."""
    costs: dict[str, float] = defaultdict(float)
    for reports in terminalreporter.stats.values():
        for report in reports:
            costs[getattr(report, "nodeid", "")] += dict(
                getattr(report, "user_properties", ())).get(_SECONDS, 0.0)
    dearest = sorted(costs.items(), key=lambda pair: -pair[1])[:PRINTED]
    terminalreporter.write_sep("=", f"dearest {len(dearest)} of {len(costs)} tests, "
                                    f"{sum(costs.values()):.0f} processor seconds in all")
    for name, seconds in dearest:
        above = f"  above {ALLOWED:g} s: see CONTRIBUTING.md" if seconds > ALLOWED else ""
        terminalreporter.write_line(f"{seconds:7.2f} s  {name}{above}")
