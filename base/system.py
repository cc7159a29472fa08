"""Parts of the system: memory, standard streams, libraries of gmsh, OpenCASCADE and VTK."""

from __future__ import annotations

import errno
import os
import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

from tympan.base.errors import Failure

#: Debian packages of the libraries.
DEBIAN = {
    "libGL.so.1": "libgl1",
    "libGLU.so.1": "libglu1-mesa",
    "libEGL.so.1": "libegl1",
    "libX11.so.6": "libx11-6",
    "libXcursor.so.1": "libxcursor1",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libXrender.so.1": "libxrender1",
    "libfontconfig.so.1": "libfontconfig1",
    "libgomp.so.1": "libgomp1",
}


#: Words of C and C++ libraries without memory: gmsh, OpenCASCADE, SuperLU, loaders.
_NO_MEMORY = re.compile(r"bad[ _]?alloc|OutOfMemory|"
                        r"(?:not enough|out of|insufficient|cannot allocate) memory|"
                        r"can't start new thread|SUPERLU_MALLOC|Can't expand MemType",
                        re.IGNORECASE)


class OutOfMemory(Failure):
    """A lack of memory, reported by any library."""


def out_of_memory(error: BaseException) -> OutOfMemory | None:
    """Make the message for an error that reports a lack of memory; None for any other.

    Examples
    --------
    >>> out_of_memory(ValueError("no number"))
    >>> print(out_of_memory(RuntimeError("std::bad_alloc")))
    memory is short (std::bad_alloc): use a smaller --refine, or fewer --workers
    """
    if isinstance(error, OutOfMemory):
        return error
    short = isinstance(error, MemoryError) or (isinstance(error, OSError)
                                               and error.errno == errno.ENOMEM)
    said = " ".join(str(error).split())
    if not short and not _NO_MEMORY.search(said):
        return None
    why = f" ({said})" if said else ""
    return OutOfMemory(f"memory is short{why}: use a smaller --refine, or fewer --workers")


@dataclass(eq=False)
class _Silence:
    """Saved standard output and error, while both lead nowhere."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    users: int = 0
    kept: dict[int, int] = field(default_factory=dict)

    def begin(self) -> None:
        with self.lock:
            self.users += 1
            if self.users == 1:
                nowhere = os.open(os.devnull, os.O_WRONLY)
                for stream in (1, 2):
                    with suppress(OSError):  # whoever started the process may have closed it
                        self.kept[stream] = os.dup(stream)
                        os.dup2(nowhere, stream)
                os.close(nowhere)

    def end(self) -> None:
        with self.lock:
            self.users -= 1
            while not self.users and self.kept:
                stream, kept = self.kept.popitem()
                os.dup2(kept, stream)
                os.close(kept)


_SILENCE = _Silence()


@contextmanager
def silent() -> Iterator[None]:
    """Drop what C libraries write to standard output and error; it takes 10 µs."""
    _SILENCE.begin()
    try:
        yield
    finally:
        _SILENCE.end()


class MissingLibrary(Failure):
    """A system library is not installed; the message names the Debian package."""


def missing_library(error: OSError | ImportError) -> MissingLibrary:
    """Advise what to install when loading a shared library failed.

    Examples
    --------
    >>> str(missing_library(OSError("libGLU.so.1: cannot open shared object file")))[:77]
    'the system library libGLU.so.1 is missing: install the Debian package libglu1'
    """
    name = str(error).split(":")[0].strip()
    if name not in DEBIAN:
        return MissingLibrary(f"a system library cannot be loaded: {error}")
    return MissingLibrary(f"the system library {name} is missing: install the Debian package "
                          f"{DEBIAN[name]} (or your system's counterpart)")


def _missing(library: str) -> bool:
    import ctypes  # not needed where a command starts

    try:
        ctypes.CDLL(library)
    except OSError:
        return True
    return False


def missing_packages() -> list[str]:
    """List the Debian packages of the libraries that cannot be loaded."""
    return [package for library, package in DEBIAN.items() if _missing(library)]


if __name__ == "__main__" and sys.platform == "linux":
    if packages := missing_packages():
        sys.exit("tympan: system libraries are missing; on Debian: sudo apt-get install "
                 f"{' '.join(packages)}")
