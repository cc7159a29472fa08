"""Threads of the numerical libraries, counted in the libraries themselves, which /proc lists."""

from __future__ import annotations

import ctypes
import re
from pathlib import Path

MAPS = Path("/proc/self/maps")
_NAMES = ("scipy_openblas_get_num_threads64_", "scipy_openblas_get_num_threads",
          "openblas_get_num_threads")


def counted(_: object = None) -> list[int]:
    """Threads of every OpenBLAS in this process."""
    files = sorted(set(re.findall(r"/\S*/lib\S*blas\S*\.so\S*", MAPS.read_text())))
    libraries = [ctypes.CDLL(file) for file in files]
    return [int(getattr(library, name)()) for library in libraries
            for name in [name for name in _NAMES if hasattr(library, name)][:1]]
