"""Drawings from outside are read in a process of their own, with limits of time and memory.

The libraries that read them are made for files that CAD wrote: of others they may crash, or never
end, and the process they are in with them. To load them takes as long as to load all else, so the
process may be started before it is known what to read.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tympan.base.errors import InputError

#: Memory that the process may take [bytes]: no drawing of an outline needs so much, a damaged one
#: may ask for any.
_MEMORY = 4 << 30
#: Time of the processor that the process may take [s], twice what 100,000 lines take. A damaged
#: drawing may keep a library busy for ever.
_SECONDS = 60
#: Time on the clock until the process is ended [s], for one that waits instead of working. Longer
#: than its own time, as the machine may be busy.
_PATIENCE = 120

#: Where a specimen file names a STEP drawing; no more of a file is looked at than _HEAD [bytes].
_STEP = re.compile(rb"""\bshape["']?\s*=\s*["']step["']""")
_HEAD = 1 << 20

#: PR_SET_PDEATHSIG of Linux's prctl.
_DEATH_SIGNAL = 1

Process = subprocess.Popen[bytes]
_waiting: list[Process] = []


@contextmanager
def ready_for(files: Iterable[Path]) -> Iterator[None]:
    """A process waits, its libraries loaded, where one of the files names a STEP drawing."""
    if any(map(_names_step, files)):
        _waiting.append(_started("step"))
    try:
        yield
    finally:
        while _waiting:
            _waiting[-1].kill()
            _waiting.pop().communicate()


def _names_step(file: Path) -> bool:
    with suppress(OSError, ValueError):  # whatever is wrong with it is said when it is read
        if file.suffix == ".toml" and file.is_file():
            with file.open("rb") as content:
                return _STEP.search(content.read(_HEAD)) is not None
    return False


def _started(kind: str) -> Process:
    code = (f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import answer; "
            "from tympan.geometry.outlines.drawings import load_reader, record; "
            "answer(load_reader, record)")
    return subprocess.Popen([sys.executable, "-c", code, kind], stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def read_apart(kind: str, file: str, keys: dict[str, Any]) -> dict[str, Any]:
    """The record of a ``dxf`` or ``step`` drawing, as ``outlines.drawings`` makes it.

    Raises
    ------
    InputError
        When the process ends without one.
    """
    process = _waiting.pop() if kind == "step" and _waiting else _started(kind)
    with process:
        try:
            output, _ = process.communicate(json.dumps([file, keys]).encode(), _PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            raise InputError(f"cannot be read within {_PATIENCE} s") from None
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        seconds, memory = _limits().values()
        less = (f"; a limit of this process (ulimit) leaves it {seconds} s: raise that"
                * (seconds < _SECONDS or memory < _MEMORY))
        raise InputError("cannot be read: it is damaged, or takes far more time than others of its "
                         f"size or more than {memory / 2**30:.3g} GB to read{less}")
    record: dict[str, Any] = json.loads(output)
    return record


def _limits() -> dict[int, int]:
    """Limits of the process by resource, its time first: a hard limit cannot be raised."""
    import resource

    wanted = {resource.RLIMIT_CPU: _SECONDS, resource.RLIMIT_AS: _MEMORY}
    hard = {kind: resource.getrlimit(kind)[1] for kind in wanted}
    return {kind: most if hard[kind] == resource.RLIM_INFINITY else min(most, hard[kind])
            for kind, most in wanted.items()}


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """Ends the process, even within a library, after so much of its own time."""
    import signal

    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def _end_with_parent() -> None:
    """Be killed when the process that asks dies, even within a library; on Linux."""
    import ctypes
    import signal

    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)


def answer(load: Callable[[str], None], record: Callable[..., dict[str, Any]]) -> None:
    """Answer in the process: read the drawing on standard input and print its record as JSON.

    What reads drawings of a kind is loaded before it is known which.
    """
    import gc
    import resource

    _end_with_parent()
    gc.disable()  # of a short life's garbage; loading the libraries leaves none
    # What the libraries print must not be taken for the answer.
    with os.fdopen(os.dup(sys.stdout.fileno()), "w") as output:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        for limit, most in {**_limits(), resource.RLIMIT_CORE: 0}.items():
            resource.setrlimit(limit, (most, most))
        kind = sys.argv[1]
        with suppress(ImportError):  # said in the record
            load(kind)
        file, keys = json.load(sys.stdin)
        json.dump(record(kind, file, keys), output)
    os._exit(0)  # to take apart what was loaded would take longer than to read
