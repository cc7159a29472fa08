"""A law as stiff as another one times a factor."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from tympan.geometry.specimen import Material

#: Constants of laws that are stresses [Pa]; all others are plain numbers.
STRESSES = frozenset({"mu", "c", "c10", "c01", "beta", "gamma"})


def scaled(material: Material, factor: float) -> Material:
    """The law with every stress, and so the energy, times a factor.

    Examples
    --------
    >>> from tympan.fem.film.laws import Ogden
    >>> scaled(Ogden((20e3, 100.0), (2.0, 4.0)), 1.5)
    Ogden(mu=(30000.0, 150.0), alpha=(2.0, 4.0))
    """
    law: Any = material
    changed: dict[str, Any] = {}
    for item in fields(law):
        value = getattr(law, item.name)
        if hasattr(value, "law"):
            changed[item.name] = scaled(value, factor)
        elif item.name in STRESSES:
            changed[item.name] = tuple(factor * one for one in value) if isinstance(value,
                                                                                    tuple) else factor * value
    found: Material = replace(law, **changed)
    return found
