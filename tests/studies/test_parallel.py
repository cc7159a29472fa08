"""Pools of processes: they end with whoever opened them, and no process waits for its workers."""

from __future__ import annotations

import gc
import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Generator, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tympan.base.errors import InputError
from tympan.studies.parallel import NoValue, mapped, processes

#: How long a process may take to end in the suite, where others compete for the processors [s].
LOADED = 5.0
#: How long it may take in a study, which runs alone [s].
ALONE = 1.0

#: Work by name, as source: a function of the standard library, which workers import quickly, and
#: its items. The first item is soon done; the others are at work when the pool ends.
WORK = {
    "quick": "abs, [-1, -2, -3, -4]",
    "busy": "time.sleep, [0, 60, 60, 60, 60]",
    "much to send": "bytes, [1, *[5_000_000] * 5]",
    "much to receive": "len, [b'', *[bytes(5_000_000)] * 5]",
    "nested": "exec, ['pass', *['from tympan.studies.parallel import mapped; import time; "
              "values = mapped(time.sleep, [0, 60, 60], 2); next(values); time.sleep(60)'] * 2]",
}

#: A consumer that leaves its pool open, and how its process ends.
LEFT_OPEN = """
import gc, time
from tympan.__main__ import _leave
from tympan.studies.parallel import mapped

if __name__ == "__main__":
    gc.disable()
    values = mapped({work}, 2)
    next(values)
    time.sleep({wait})
    print("open", flush=True)
    {end}
"""

#: The explorer's process, left open in the same way.
EXPLORER = """
import asyncio
from functools import partial
from tympan.__main__ import _leave
from tympan.explore import latest

held = []

async def main():
    parts = asyncio.Queue()
    held.append(latest.Latest(partial(partial, iter), lambda *part: parts.put_nowait(part), None))
    held[0].ask([1])
    await parts.get()
    print("open", flush=True)

if __name__ == "__main__":
    latest._PRELOADED.clear()
    asyncio.run(main())
    {end}
"""

#: What ends a process: as a command does, as a script does, and by an error.
ENDS = ("_leave(0)", "pass", "raise SystemExit(0)")


def environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def left_open(work: str, end: str) -> str:
    """A script; nested pools have time to open."""
    return LEFT_OPEN.format(work=WORK[work], wait=1.0 if work == "nested" else 0.0, end=end)


def seconds_to_end(script: str, folder: Path) -> float:
    """Time from the line that a script prints to its end, and that of all its workers.

    Its workers have its standard output, which ends with the last of them.
    """
    (folder / "script.py").write_text(script)
    with subprocess.Popen([sys.executable, str(folder / "script.py")], stdout=subprocess.PIPE,
                          text=True, start_new_session=True,
                          env=environment()) as process:
        assert process.stdout is not None
        try:
            assert process.stdout.readline() == "open\n"
            began = time.monotonic()
            assert process.communicate(timeout=60) == ("", None)
            assert process.returncode == 0
            return time.monotonic() - began
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, 9)


@pytest.mark.parametrize(("work", "end"), [("quick", "_leave(0)"), ("quick", "pass"),
                                           ("busy", "_leave(0)"), ("busy", "pass")])
def test_a_process_leaves_with_a_pool_open(tmp_path: Path, work: str, end: str) -> None:
    assert seconds_to_end(left_open(work, end), tmp_path) < LOADED


@pytest.mark.parametrize("end", ENDS[:2])
def test_a_process_leaves_with_the_explorer_s_process_open(tmp_path: Path, end: str) -> None:
    assert seconds_to_end(EXPLORER.format(end=end), tmp_path) < LOADED


@pytest.mark.study
def test_hundreds_of_processes_leave_with_a_pool_open(tmp_path: Path) -> None:
    times = {(work, end): [seconds_to_end(left_open(work, end), tmp_path)
                           for _ in range(10 if work == "nested" else 40)]
             for work in WORK for end in ENDS}
    _print(times)
    assert max(map(max, times.values())) < ALONE


class Held:
    """Something that keeps itself and a generator, until cycles are collected."""

    def __init__(self, values: Iterator[Any]) -> None:
        self.values, self.itself = values, self


def stops(values: Iterator[Any]) -> None:
    next(values)


def holds(values: Iterator[Any]) -> None:
    next(Held(values).values)


def raises(values: Iterator[Any]) -> None:
    next(values)
    raise ArithmeticError


def is_interrupted(values: Iterator[Any]) -> None:
    next(values)
    raise KeyboardInterrupt


def reads_nothing(values: Iterator[Any]) -> None:
    assert values


CONSUMERS = (stops, holds, raises, is_interrupted, reads_nothing)


@pytest.fixture
def no_collection() -> Iterator[None]:
    """No garbage collection that would close a pool by chance."""
    gc.disable()
    yield
    gc.enable()
    gc.collect()


@pytest.mark.usefixtures("no_collection")
@pytest.mark.parametrize(("times", "bound"),
                         [(6, LOADED), pytest.param(500, ALONE, marks=pytest.mark.study)])
def test_no_worker_is_left_after_the_with(times: int, bound: float) -> None:
    random = np.random.default_rng(11)
    children = set(multiprocessing.active_children())
    took: dict[tuple[str, str], list[float]] = {}
    for number in range(times):
        # The small version meets each consumer at least once.
        consumer = CONSUMERS[number if number < len(CONSUMERS) else random.integers(4)]
        work = random.choice(["quick", "busy", "much to send", "much to receive"])
        with (suppress(ArithmeticError, KeyboardInterrupt),
              closing(mapped(*eval(WORK[work]), int(random.choice([2, 2, 3])))) as values):
            try:
                consumer(values)
                time.sleep(random.choice([0.0, 0.0, 0.1]))
            finally:
                began = time.monotonic()
        took.setdefault((consumer.__name__, work), []).append(time.monotonic() - began)
        assert set(multiprocessing.active_children()) == children
    _print(took)
    assert max(map(max, took.values())) < bound


def test_values_that_are_all_read_leave_no_worker() -> None:
    children = multiprocessing.active_children()
    assert list(mapped(abs, [-1, -2, -3, -4], 2)) == [1, 2, 3, 4]
    assert multiprocessing.active_children() == children


def test_a_fork_that_drops_its_copy_leaves_the_pool_alone() -> None:
    with closing(mapped(abs, range(6), 2)) as values:
        assert next(values) == 0
        fork = os.fork()
        if fork == 0:
            values.close()
            os._exit(0)
        os.waitpid(fork, 0)
        assert list(values) == [1, 2, 3, 4, 5]


def ended(values: Generator[tuple[str, Any], None, None]) -> dict[str, Any]:
    with closing(values):
        return dict(values)


def test_an_item_that_kills_its_process_is_tried_alone_and_harms_no_other() -> None:
    answers = ended(processes(eval, {"kills": "__import__('os')._exit(1)", "one": "1", "two": "2"},
                              2))
    killed = answers.pop("kills")
    assert answers == {"one": 1, "two": 2}
    assert killed == NoValue("the process that solved it died, 3 times, at last alone: is there "
                             "enough memory?")


def test_an_error_has_the_traceback_of_its_worker() -> None:
    """Also one that cannot be sent, or an item that cannot; those that meet all are raised."""
    odd = "class Odd(Exception): pass\nraise Odd('of its own')"
    here = "def here(): raise LookupError('there')\nhere()"
    answers = ended(processes(exec, {"odd": odd, "here": here, "lambda": lambda: None}, 1))
    assert answers["odd"].reason == "RuntimeError: Odd: of its own"
    assert answers["here"].reason == "LookupError: there"
    assert "in here\nLookupError" in str(answers["here"].error.__cause__)
    assert "pickle" in answers["lambda"].reason
    with pytest.raises(InputError, match=r"^key: wrong$"):
        list(mapped(exec, ["from tympan.base.errors import InputError\n"
                           "raise InputError('wrong', key='key')"] * 2, 2))


def test_a_script_without_a_main_guard_ends_with_the_reason(tmp_path: Path) -> None:
    """A worker imports the script, which starts a pool there: as Python forbids, and explains."""
    (tmp_path / "script.py").write_text("from tympan.studies.parallel import processes\n"
                                        "print(dict(processes(abs, {'one': -1}, 2)))")
    done = subprocess.run([sys.executable, str(tmp_path / "script.py")], check=True, timeout=60,
                          capture_output=True, text=True, env=environment())
    assert "the process that solved it died, 3 times" in done.stdout
    assert "An attempt has been made to start a new process" in done.stderr
    assert done.stdout.count("\n") == 1  # no worker went on with the script


def _print(times: dict[tuple[str, str], list[float]]) -> None:
    for names, seconds in sorted(times.items()):
        print(*names, len(seconds), "times, s:",
              *(f"{value:.3f}" for value in np.quantile(seconds, [0.5, 0.95, 1.0])))
