"""Record of the product's blocks that a process runs, a line for each block's first run.

It imports nothing of the project, and little else: every process of a recorded run loads it. The
folder ``$TYMPAN_MUTANTS_MAP`` holds the product's code with recording lines in it.
"""

from __future__ import annotations

import builtins
import json
import marshal
import os
import sys
import time
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType


class Trace:
    """The blocks of this process that are still to be recorded, and the file of the others."""

    def __init__(self, folder: Path) -> None:
        index = json.loads((folder / "index.json").read_text(encoding="utf-8"))
        self.folder = folder
        self.tops: list[str] = index["tops"]
        self.codes: dict[str, int] = index["codes"]
        self._blank = b"\1" * index["blocks"]
        self.blocks = bytearray(self._blank)
        self._begun: dict[str, bytes] = {}
        self._context: str | None = None
        self._written: str | None = None
        self._file: int | None = None
        self._unwritten = b""

    def begin(self, context: str) -> None:
        """Record what runs from now on under the name of a context, which may go on."""
        if self._context is not None:
            self._begun[self._context] = bytes(self.blocks)
        self._context = context
        if self._unwritten:
            self._write()
        self.blocks[:] = self._begun.pop(context, self._blank)

    def end(self, context: str) -> None:
        """Forget a context that does not go on."""
        self._begun.pop(context, None)

    def record(self, number: int) -> None:
        """Record the first run of a block in this context."""
        self.blocks[number] = 0
        context = current() if self._context is None else self._context
        if context != self._written:
            self._written = context
            self._unwritten += f"={context}\n".encode()
        self._unwritten += f"{number}\n".encode()
        self._write()

    def _write(self) -> None:
        """Write what is to be written, or later where a test leaves no room on the disk."""
        try:
            if self._file is None:
                self._file = os.open(
                    self.folder / "traces" / f"{os.getpid()}-{time.time_ns()}.trace",
                    os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            written = os.write(self._file, self._unwritten)
        except OSError:
            return
        self._unwritten = self._unwritten[written:]

    def forked(self) -> None:
        """Go on in a child, in a file of its own; the parent says in which context."""
        self.blocks[:] = self._blank
        self._begun.clear()
        self._unwritten = b""
        self._context = self._written = self._file = None


def current() -> str:
    """The present context of the process that began this one."""
    try:
        return Path(os.environ["TYMPAN_MUTANTS_CURRENT"]).read_text(encoding="utf-8")
    except (KeyError, OSError):
        return ""


class _Loader(SourceFileLoader):
    def __init__(self, name: str, path: str, code: Path) -> None:
        super().__init__(name, path)
        self._code = code

    def get_code(self, fullname: str) -> CodeType:
        return marshal.loads(self._code.read_bytes())  # type: ignore[no-any-return]


class _Finder:
    def __init__(self, trace: Trace) -> None:
        self._trace = trace

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
                  ) -> ModuleSpec | None:
        if name.partition(".")[0] not in self._trace.tops:
            return None
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.origin is not None:
            number = self._trace.codes.get(os.path.realpath(spec.origin))
            if number is not None:
                spec.loader = _Loader(name, spec.origin,
                                      self._trace.folder / "codes" / str(number))
        return spec


#: The record of this process, where it is one of a recorded run.
TRACE: Trace | None = None


def install() -> None:
    """Load the product's modules with their recording lines from now on."""
    global TRACE
    TRACE = Trace(Path(os.environ["TYMPAN_MUTANTS_MAP"]))
    builtins.__blocks__ = TRACE.blocks  # type: ignore[attr-defined]
    builtins.__block__ = TRACE.record  # type: ignore[attr-defined]
    sys.meta_path.insert(0, _Finder(TRACE))
    os.register_at_fork(after_in_child=TRACE.forked)
