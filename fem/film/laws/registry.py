"""The laws known to specimen files, and what their constants have in common."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Material
from tympan.geometry.toml_reader import Table

REGISTRY: dict[str, Callable[[Table], Material]] = {}


def register(cls: type[Any]) -> type[Any]:
    """Make a law known to specimen files under its ``law`` name."""
    REGISTRY[cls.law] = cls.from_table
    return cls


def require_above(bound: float, **constants: float) -> None:
    """Refuse constants that are not above a bound.

    They may carry an imaginary step (:mod:`tympan.fem.derivatives.sensitivity`), which does not
    count.

    Examples
    --------
    >>> require_above(0, mu=-1.0)
    Traceback (most recent call last):
    tympan.geometry.errors.InputError: mu: given -1.0: must be above 0
    """
    for name, value in constants.items():
        if not value.real > bound:
            raise InputError(f"must be above {bound:g}", key=name, given=value)
