"""Interruptions at bad moments, with the handlers of whoever calls."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import FrameType

import numpy as np
import pytest

from tympan.base.points import drawn_points
from tympan.base.process.interruption import signals_wait
from tympan.studies.files import write_text


@pytest.fixture(autouse=True)
def handlers() -> Iterator[None]:
    """Those of before, whatever a test leaves."""
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGALRM)}
    yield
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number, handler in before.items():
        signal.signal(number, handler)


def interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def interrupted(moment: float, act: Callable[[], object]) -> bool:
    """Whether an interruption so long after the start [s] ended an act."""
    signal.signal(signal.SIGALRM, interrupt)
    try:
        try:
            signal.setitimer(signal.ITIMER_REAL, max(moment, 1e-6))
            act()
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    except KeyboardInterrupt:
        return True
    return False


def test_samples_are_whole_or_not_there_whenever_a_signal_comes() -> None:
    """An exception within scipy's Sobol sequence is swallowed, and its points are then equal."""
    drawn_points(1, 1, 1)  # imports what takes longer than to draw
    points: list[np.ndarray] = []
    moments, count = np.random.default_rng(2), 0
    for method in ("sobol", "latin_hypercube"):
        began = time.perf_counter()
        right = drawn_points(300, 16, 3, method)
        seconds = time.perf_counter() - began
        for moment in moments.uniform(0.0, seconds, 20):
            count += interrupted(moment, partial(drawn, points, method))
        assert all((drawing == right).all() for drawing in points)
        points.clear()
    assert count > 10


def drawn(points: list[np.ndarray], method: str) -> None:
    points.append(drawn_points(300, 16, 3, method))


def test_a_signal_waits_and_then_does_what_it_does() -> None:
    came: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, frame: came.append(number))
    with signals_wait():
        with signals_wait():
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.01)
        assert came == []
    assert came == [signal.SIGTERM]
    signal.signal(signal.SIGTERM, interrupt)
    with pytest.raises(KeyboardInterrupt), signals_wait():
        os.kill(os.getpid(), signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is interrupt


def test_another_thread_goes_on_without_handlers() -> None:
    entered = []

    def enter() -> None:
        with signals_wait():
            entered.append(True)

    thread = threading.Thread(target=enter)
    thread.start()
    thread.join()
    assert entered == [True]


# An interrupted open() leaves its file to the garbage collector, which says so.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_files_that_are_written_while_a_signal_comes_are_listed_or_not_there(tmp_path) -> None:
    """Never a file that its own folder does not know: the next run would refuse it."""
    def write(number: int) -> None:
        for text in "abc":
            write_text(tmp_path / f"{number}.json", text)

    count = 0
    for number, moment in enumerate(np.random.default_rng(1).uniform(0.0, 3e-3, 60)):
        count += interrupted(moment, partial(write, number))
        write_text(tmp_path / f"{number}.json", "again")
    assert count > 5
    assert {file.read_text() for file in tmp_path.glob("*.json")} == {"again"}
    assert not list(tmp_path.glob(".tympan-*"))


#: Starts a reader of drawings and, so that its input stays open, a process that has the pipe too.
READER = """
import subprocess, sys
from tympan.base.reader_process import _started
reader = _started("dxf")
other = subprocess.Popen(["sleep", "60"], pass_fds=[reader.stdin.fileno()],
                         stdout=subprocess.DEVNULL)
print(reader.pid, other.pid, flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="prctl is Linux's")
def test_a_reader_of_drawings_dies_with_who_asked() -> None:
    with subprocess.Popen([sys.executable, "-c", READER], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, env=os.environ | {
                              "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}) as process:
        assert process.stdout is not None
        reader, other = map(int, process.stdout.readline().split())
        end = time.monotonic() + 60.0
        while not limited(reader) and time.monotonic() < end:
            time.sleep(0.02)
        process.kill()
    try:
        while alive(reader) and time.monotonic() < end:
            time.sleep(0.02)
        assert not alive(reader)
    finally:
        os.kill(other, signal.SIGKILL)


def limited(process: int) -> bool:
    """Whether a reader has bounded its own time, and so knows of its parent."""
    line, = (line for line in Path(f"/proc/{process}/limits").read_text().splitlines()
             if line.startswith("Max cpu time"))
    return "unlimited" not in line


def alive(process: int) -> bool:
    """Whether it runs, and is no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


#: Meshes a film, then asks the kernel which signals the process still catches.
MESHED = """
import re, signal
from pathlib import Path
from tests.support.specimens import circular
from tympan.geometry.mesher import MeshSettings, mesh_film
from tympan.base.process.interruption import Interruption

def caught():
    status = Path("/proc/self/status").read_text()
    return re.findall(r"Sig(?:Cgt|Ign|Blk):\\s*(\\w+)", status)

Interruption()
import gmsh
before = caught()
mesh_film(circular(), MeshSettings(order=2), frozenset())
print(before == caught(), before, caught())
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc")
def test_a_mesher_leaves_the_handlers_of_signals_alone() -> None:
    """gmsh's start would have SIGTERM and SIGHUP end the process without a word."""
    done = subprocess.run([sys.executable, "-c", MESHED], check=True, capture_output=True,
                          text=True, env=os.environ | {
                              "PYTHONPATH": os.pathsep.join(filter(None, sys.path))})
    assert done.stdout.startswith("True"), done.stdout
