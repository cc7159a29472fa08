"""One thread for the dense matrices of NumPy and SciPy, whatever the environment says.

The dense matrices here are small: several threads only wait for one another, and three solves take
10 times longer. Both libraries bring a BLAS, which is called through their own extension modules; a
search among all libraries of the process would take milliseconds at every call.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

#: Variables that a BLAS reads when loaded, the first one that is set. PARDISO has MKL_NUM_THREADS.
VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS")

#: Extension modules that are linked with the BLAS of a package, of several versions.
_LINKED = {
    "numpy": ("numpy._core._multiarray_umath", "numpy.core._multiarray_umath"),
    "scipy": ("scipy.linalg._fblas", "scipy.sparse.linalg._dsolve._superlu"),
}

#: Functions that read and set the number of threads: OpenBLAS under the names that distributions
#: build it with, MKL, BLIS.
_FUNCTIONS = (
    *((f"{prefix}openblas_get_num_threads{suffix}", f"{prefix}openblas_set_num_threads{suffix}")
      for prefix in ("scipy_", "") for suffix in ("64_", "_64", "")),
    ("MKL_Get_Max_Threads", "MKL_Set_Num_Threads"),
    ("bli_thread_get_num_threads", "bli_thread_set_num_threads"),
)


@dataclass(frozen=True)
class Blas:
    """The BLAS of a package: the functions that read and set its number of threads."""

    ask: Callable[[], int]
    set: Callable[[int], object]


@dataclass
class _Limit:
    """Count of the callers in :func:`one_thread`, of all threads, and the settings before them."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    depth: int = 0
    numbers: dict[str, int] = field(default_factory=dict)
    environment: dict[str, str | None] = field(default_factory=dict)
    libraries: dict[str, Blas | None] = field(default_factory=dict)

    def loaded(self) -> dict[str, Blas]:
        """Find the loaded BLAS libraries that have threads, by package."""
        for package, modules in _LINKED.items():
            files = (getattr(sys.modules.get(module), "__file__", None) for module in modules)
            file = next(filter(None, files), None)
            if file is not None and package not in self.libraries:
                self.libraries[package] = _linked(file)
        return {package: blas for package, blas in self.libraries.items() if blas is not None}

    def enter(self) -> None:
        with self.lock:
            if self.depth == 0:
                self.environment = {name: os.environ.get(name) for name in VARIABLES}
                self.numbers = {package: blas.ask() for package, blas in self.loaded().items()}
                for blas in self.loaded().values():
                    blas.set(1)
                # Libraries that are loaded later read these, also in processes that are started.
                os.environ.update(dict.fromkeys(VARIABLES, "1"))
            self.depth += 1

    def leave(self) -> None:
        with self.lock:
            self.depth -= 1
            if self.depth == 0:
                for name, value in self.environment.items():
                    if value is None:
                        os.environ.pop(name, None)
                    else:
                        os.environ[name] = value
                for package, blas in self.loaded().items():
                    # A library that was loaded meanwhile gets the number it would have taken.
                    blas.set(self.numbers.get(package) or _default())


_LIMIT = _Limit()


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit NumPy's and SciPy's dense algebra to one thread, also where it is loaded later.

    It may be nested, and entered by several threads of the process at once; the last one to leave
    restores the caller's numbers. It is also a decorator.
    """
    _LIMIT.enter()
    try:
        yield
    finally:
        _LIMIT.leave()


def stay_single() -> None:
    """Limit this process to one thread as :func:`one_thread` does, until it ends."""
    _LIMIT.enter()


def blas_threads() -> dict[str, int]:
    """Count the threads of the dense algebra now, by package; only of those that are loaded."""
    return {package: blas.ask() for package, blas in _LIMIT.loaded().items()}


def outer_environment() -> dict[str, str | None]:
    """Read the caller's :data:`VARIABLES`, as they are outside of :func:`one_thread`."""
    return dict(_LIMIT.environment) if _LIMIT.depth else {
        name: os.environ.get(name) for name in VARIABLES}


def _linked(file: str) -> Blas | None:
    """Find the BLAS that an extension module is linked with; None if it has no such functions."""
    if not Path(file).exists():
        return None
    import ctypes  # not needed by commands that compute nothing

    module = ctypes.CDLL(file)
    for ask, set_number in _FUNCTIONS:
        if hasattr(module, ask) and hasattr(module, set_number):
            return Blas(getattr(module, ask), getattr(module, set_number))
    return None


def _default() -> int:
    """Count the threads of a BLAS that would be loaded now."""
    processors = (len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity")
                  else os.cpu_count() or 1)
    for name in VARIABLES:
        value = os.environ.get(name, "")
        if value.isdecimal() and int(value):
            return min(int(value), processors)
    return processors
