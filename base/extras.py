"""Optional packages: which extra of ``tympan[…]`` adds each, and the message where one is missing.

Nothing imports an optional package before :func:`needs` has found it.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec

from tympan.base.errors import InputError


@dataclass(frozen=True)
class Extra:
    """An optional ``package`` and what it is ``good_for``."""

    package: str
    good_for: str


#: Extras by their names in pyproject.toml: ``pip install 'tympan[cad]'``.
EXTRAS = {
    "cad": Extra("cadquery", "STEP drawings, parts to make, electrodes with an outline"),
    "cluster": Extra("distributed", "sweeps on several computers"),
    "completion": Extra("shtab", "completion of commands in the shell"),
    "control": Extra("control", "lumped models as objects of python-control"),
    "explore": Extra("aiohttp", "the explorer in the browser"),
    "fast": Extra("pypardiso", "faster solutions of more than 20,000 unknowns"),
    "sheets": Extra("openpyxl", "workbooks (.xlsx)"),
}


class MissingPackage(InputError):
    """An optional package is not installed; the message says how to install it."""


def installed(package: str) -> bool:
    """Find out whether an optional package can be imported; it is not loaded."""
    return find_spec(package) is not None


def needs(package: str, purpose: str) -> None:
    """Refuse a purpose if its optional package is not installed.

    Raises
    ------
    MissingPackage
        One line with the purpose, the package and the command that installs it.
    """
    if not installed(package):
        extra = next(name for name, extra in EXTRAS.items() if extra.package == package)
        raise MissingPackage(f"{purpose} needs {package}: pip install 'tympan[{extra}]'")


def version_of(distribution: str) -> str | None:
    """Find the version of an installed distribution; None if it is not installed."""
    from importlib.metadata import PackageNotFoundError, version  # slow, and rarely needed

    try:
        return version(distribution)
    except PackageNotFoundError:
        return None
