"""Dielectric-elastomer membrane actuators; the library itself lives in the packages beside this file."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    """``__version__``, asked of the installed distribution only when somebody wants it."""
    if name == "__version__":
        from importlib.metadata import version

        return version("tympan")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
