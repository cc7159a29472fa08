"""Drawings from outside are read in a process of their own, with limits of time and memory.

The libraries that read them are made for files that CAD wrote. On others they may crash or never
end, and the process with them. Loading them takes as long as loading all else, so the process may
be started before it is known what to read.
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

#: Most memory of the process [bytes]: no drawing of an outline needs as much, a damaged one may
#: ask for any amount.
_MEMORY = 4 << 30
#: Most processor time of the process [s], twice that of 100,000 lines. A damaged drawing may keep a
#: library busy for ever.
_SECONDS = 60
#: Time on the clock until the process is ended [s], for one that waits instead of working. It is
#: longer than its processor time, as the machine may be busy.
_PATIENCE = 120

#: Mark of a specimen file that names a STEP drawing, searched in its first _HEAD [bytes].
_STEP = re.compile(rb"""\bshape["']?\s*=\s*["']step["']""")
_HEAD = 1 << 20

#: PR_SET_PDEATHSIG of Linux's prctl.
_DEATH_SIGNAL = 1

Process = subprocess.Popen[bytes]
_waiting: list[Process] = []


@contextmanager
def ready_for(files: Iterable[Path]) -> Iterator[None]:
    """Start a process, with its libraries loaded, if one of the files names a STEP drawing."""
    if any(map(_names_step, files)):
        _waiting.append(_started("step"))
    try:
        yield
    finally:
        while _waiting:
            _waiting[-1].kill()
            _waiting.pop().communicate()


def _names_step(file: Path) -> bool:
    with suppress(OSError, ValueError):  # an error is reported when the file is read
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
    """Read a ``dxf`` or ``step`` drawing in another process, as ``outlines.drawings`` records it.

    Raises
    ------
    InputError
        When the process ends without an answer.
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
    """Limit the process by resource, its time first: a hard limit cannot be raised."""
    import resource

    wanted = {resource.RLIMIT_CPU: _SECONDS, resource.RLIMIT_AS: _MEMORY}
    hard = {kind: resource.getrlimit(kind)[1] for kind in wanted}
    return {kind: most if hard[kind] == resource.RLIM_INFINITY else min(most, hard[kind])
            for kind, most in wanted.items()}


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    """End the process, even within a library, after this much processor time."""
    import signal

    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def _end_with_parent() -> None:
    """Let Linux kill this process when the one that asks dies, even within a library."""
    import ctypes
    import signal

    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_DEATH_SIGNAL, signal.SIGKILL)


def answer(load: Callable[[str], None], record: Callable[..., dict[str, Any]]) -> None:
    """Read the drawing named on standard input and print its record as JSON, in the process.

    The library for its kind is loaded before the drawing is known.
    """
    import gc
    import resource

    _end_with_parent()
    gc.disable()  # a short life leaves little garbage, and loading the libraries none
    # The output of the libraries must not be taken for the answer.
    with os.fdopen(os.dup(sys.stdout.fileno()), "w") as output:
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
        for limit, most in {**_limits(), resource.RLIMIT_CORE: 0}.items():
            resource.setrlimit(limit, (most, most))
        kind = sys.argv[1]
        with suppress(ImportError):  # the record reports it
            load(kind)
        file, keys = json.load(sys.stdin)
        json.dump(record(kind, file, keys), output)
    os._exit(0)  # unloading the libraries would take longer than reading
