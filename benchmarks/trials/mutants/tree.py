"""Copies of a tree of files, and pytest in them."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

INSIDE = Path(__file__).parent / "inside"
#: Set when no run of tests is to go on, as after Ctrl-C.
STOP = threading.Event()

#: Until the first test of a process begins [s]: imports and the collection.
_START = 300.0
#: A test hangs that takes so many times its own time, and this much more [s].
_TIMES, _MORE = 10.0, 60.0
#: Between two looks at a process [s].
_PAUSE = 0.5


def copy_tree(tree: Path, folder: Path) -> None:
    """Copy the files that git knows or does not ignore; links stay links."""
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                            cwd=tree, check=True, capture_output=True).stdout
    for name in filter(None, listed.decode().split("\0")):
        if (tree / name).is_symlink() or (tree / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(tree / name, folder / name, follow_symlinks=False)


def environment(tree: Path, **more: str) -> dict[str, str]:
    """Environment in which Python imports a tree's modules, and the plugin."""
    paths = [str(tree), str(INSIDE)]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1"} | more


def pytest_command(*options: str) -> list[str]:
    """Command that runs pytest with the plugin."""
    return [sys.executable, "-m", "pytest", "-p", "mutants_plugin", *options]


def collected(tree: Path, scratch: Path, *options: str) -> list[str]:
    """Tests that pytest finds in a tree.

    Raises
    ------
    ValueError
        When it fails.
    """
    file = scratch / "collected.json"
    file.unlink(missing_ok=True)
    done = subprocess.run(
        pytest_command("--collect-only", "-q", *options), cwd=tree, check=False, text=True,
        capture_output=True, env=environment(tree, TYMPAN_MUTANTS_COLLECTED=str(file),
                                             TYMPAN_MUTANTS_LOG=str(scratch / "log")))
    if done.returncode or not file.exists():
        raise ValueError(f"{tree}: pytest cannot collect its tests: {done.stdout[-2000:]}"
                         f"{done.stderr[-2000:]}")
    return list(json.loads(file.read_text(encoding="utf-8")))


@dataclass(frozen=True)
class End:
    """How a run of tests ended.

    ``status`` is that of pytest, ``test`` the first one that failed or hung, if any, ``ran`` are
    the tests that began, ``seconds`` is processor time with that of child processes.
    """

    status: int
    test: str
    hung: bool
    ran: tuple[str, ...]
    seconds: float
    said: str


def run_tests(tree: Path, tests: Sequence[str], expected: Callable[[str], float]) -> End:
    """Run tests of a tree in a process until one fails or hangs.

    ``expected`` is the processor time of a test [s]. What tests keep on disk is in a folder of
    this run alone.
    """
    with tempfile.TemporaryDirectory(prefix="mutant-") as name:
        scratch = Path(name)
        (scratch / "tests.txt").write_text("".join(f"{test}\n" for test in tests),
                                           encoding="utf-8")
        (scratch / "tmp").mkdir()
        command = pytest_command("-x", "-q", "-m", "", "--no-header", "--tb=line",
                                 f"--basetemp={scratch / 'pytest'}", f"@{scratch / 'tests.txt'}")
        with (scratch / "said").open("wb") as said:
            process = subprocess.Popen(
                command, cwd=tree, stdin=subprocess.DEVNULL, stdout=said, stderr=said,
                start_new_session=True,
                env=environment(tree, PYTHONDONTWRITEBYTECODE="1", TMPDIR=str(scratch / "tmp"),
                                TYMPAN_CACHE=str(scratch / "cache"),
                                HYPOTHESIS_STORAGE_DIRECTORY=str(scratch / "hypothesis"),
                                TYMPAN_MUTANTS_LOG=str(scratch / "log")))
            hung, seconds = _watch(process, scratch, expected)
        log = _log(scratch)
        begun = [entry["begin"] for entry in log if "begin" in entry]
        failed = [entry["failure"] for entry in log if "failure" in entry]
        test = (begun or [""])[-1] if hung else (failed or [""])[0]
        text = (scratch / "said").read_text(encoding="utf-8", errors="replace")
        return End(process.returncode, test, hung, tuple(begun), seconds, text[-2000:])


def _watch(process: subprocess.Popen[bytes], scratch: Path, expected: Callable[[str], float]
           ) -> tuple[bool, float]:
    """Wait for a process; whether it hung, and its processor time [s]."""
    last, since, hung = -1, time.monotonic(), False
    while True:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            _end(process.pid)
            return hung, usage.ru_utime + usage.ru_stime
        begun = [entry["begin"] for entry in _log(scratch) if "begin" in entry]
        if len(begun) != last:
            last, since = len(begun), time.monotonic()
        waited = time.monotonic() - since
        patience = _TIMES * expected(begun[-1]) + _MORE if begun else _START
        if waited > patience and not hung:
            hung = True
            _end(process.pid)
        if STOP.is_set():
            _end(process.pid)
            process.wait()
            raise InterruptedError("stopped")
        time.sleep(_PAUSE)


def _end(group: int) -> None:
    """End the processes of a group that this module began."""
    with suppress(ProcessLookupError):
        os.killpg(group, signal.SIGKILL)


def _log(scratch: Path) -> list[dict[str, Any]]:
    """Entries of the log so far; the last line may not be whole yet."""
    entries = []
    for file in scratch.glob("log-*"):
        if file.suffix != ".current" and file.is_file():
            for line in file.read_text(encoding="utf-8").split("\n")[:-1]:
                entries.append(json.loads(line))
    return entries
