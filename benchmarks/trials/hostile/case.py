"""A command with bad input, how it has to end, and how it ends."""

from __future__ import annotations

import os
import re
import resource
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.trials.python_words import words_of_python

#: Seconds to a message.
SECONDS = 2.0
#: Seconds to an answer where the input is right.
PATIENCE = 30.0
#: Seconds until a command counts as one without end.
NO_END = 300.0
#: On a busy machine, the most times as long on the clock as a command may take.
MOST_WAITING = 30.0


@dataclass(frozen=True)
class Case:
    """What is typed, the files it finds, and how it has to end.

    Parameters
    ----------
    name
        Two or three words, unique in its group.
    arguments
        Words of a command line, as a shell splits them.
    files
        Contents by name; None is a pipe to which nobody writes.
    words
        Pattern that the message (standard error) contains.
    status
        Exit status. With 1 or 2 there has to be one line of message, soon.
    shows, never
        Patterns: the output contains the first, neither output nor message the second.
    seconds
        On the clock (default: 2 to a message, 30 to an answer).
    prepare
        Called with the folder before the command, for links, old folders and the like.
    check
        Called with the folder after the command; returns in a word what is wrong there, or "".
    plain
        Whether the message must have no words of Python; a package's own error has some.
    program
        Arguments of Python before ``arguments``; empty where these begin with a script.
    """

    name: str
    arguments: str
    files: Mapping[str, str | bytes | None]
    words: str = ""
    status: int = 2
    shows: str = ""
    never: str = "Traceback"
    seconds: float | None = None
    environment: Mapping[str, str] = field(default_factory=dict)
    largest_file: int | None = None
    prepare: Callable[[Path], object] | None = None
    check: Callable[[Path], str] | None = None
    plain: bool = True
    program: tuple[str, ...] = ("-m", "tympan")

    @property
    def refused(self) -> bool:
        """Whether a message is the right answer."""
        return self.status in (1, 2)


Cases = Iterator[Case]
#: What writes the cases of a group, by its name.
GROUPS: dict[str, Callable[[], Cases]] = {}


def group(name: str) -> Callable[[Callable[[], Cases]], Callable[[], Cases]]:
    """Register a function that yields the cases of a group."""
    def register(write: Callable[[], Cases]) -> Callable[[], Cases]:
        if name in GROUPS:
            raise ValueError(f"two functions write the cases of {name}")
        GROUPS[name] = write
        return write

    return register


@dataclass(frozen=True)
class Answer:
    """Exit status, standard error, seconds on the clock, standard output.

    ``fault_of_files`` is what the case's check found in the folder. ``processor`` is the processor
    time of all its processes [s], where the machine had other work, otherwise None.
    """

    status: int
    error: str
    seconds: float
    output: str = ""
    fault_of_files: str = ""
    processor: float | None = None

    @property
    def taken(self) -> float:
        """Seconds that count; on a busy machine those of the processor, unless it waited long."""
        if self.processor is None:
            return self.seconds
        return max(self.processor, self.seconds / MOST_WAITING)

    def fault(self, case: Case) -> str:
        """In a word what is wrong with it; empty if nothing."""
        if self.status != case.status:
            return f"status {self.status}"
        if case.never and re.search(case.never, self.error + self.output):
            return "never words"
        if re.search(case.words, self.error) is None:
            return "other words"
        if re.search(case.shows, self.output) is None:
            return "other output"
        if case.refused and self.error.count("\n") != 1:
            return "not one line"
        if case.refused and case.plain and words_of_python(self.error):
            return "Python's words"
        if self.fault_of_files:
            return self.fault_of_files
        allowed = case.seconds or (SECONDS if case.refused else PATIENCE)
        return "late" if self.taken > allowed else ""


def run(case: Case) -> Answer:
    """The answer of a command in a folder of its own, without a cache of earlier commands."""
    def limit() -> None:
        if case.largest_file is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, 2 * (case.largest_file,))

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _write(case.files, folder)
        if case.prepare is not None:
            case.prepare(folder)
        began, spent = time.perf_counter(), _processor()
        busy = os.getloadavg()[0] > (os.cpu_count() or 1)
        try:
            done = subprocess.run(
                [sys.executable, *case.program, *shlex.split(case.arguments)], cwd=folder,
                env=os.environ | {"TYMPAN_CACHE": "", **case.environment}, check=False,
                stdin=subprocess.DEVNULL, capture_output=True, timeout=NO_END, preexec_fn=limit)
        except subprocess.TimeoutExpired:
            return Answer(-1, "no end\n", time.perf_counter() - began)
        seconds = time.perf_counter() - began
        return Answer(done.returncode, done.stderr.decode(errors="replace"), seconds,
                      done.stdout.decode(errors="replace"),
                      case.check(folder) if case.check is not None else "",
                      _processor() - spent if busy else None)


def _processor() -> float:
    """Processor time of all processes that were waited for [s]."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def _write(files: Mapping[str, str | bytes | None], folder: Path) -> None:
    for file, content in files.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        if content is None:
            os.mkfifo(folder / file)
        else:
            (folder / file).write_bytes(
                content if isinstance(content, bytes) else content.encode())
