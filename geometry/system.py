"""System libraries that gmsh, OpenCASCADE and VTK load, and what to install when one lacks."""

from __future__ import annotations

import ctypes
import sys

from tympan.geometry.errors import Failure

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


class MissingLibrary(Failure):
    """A system library is not installed; the message names the Debian package."""


def missing_library(error: OSError | ImportError) -> MissingLibrary:
    """What to install when loading a shared library failed.

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
    try:
        ctypes.CDLL(library)
    except OSError:
        return True
    return False


def missing_packages() -> list[str]:
    """Debian packages of the libraries that cannot be loaded."""
    return [package for library, package in DEBIAN.items() if _missing(library)]


if __name__ == "__main__" and sys.platform == "linux":
    if packages := missing_packages():
        sys.exit("tympan: system libraries are missing; on Debian: sudo apt-get install "
                 f"{' '.join(packages)}")
