"""A law as stiff as another one times a factor."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tympan.geometry.fields import fields_of
from tympan.geometry.specimen import Material


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
    for field in fields_of(type(law)):
        value = getattr(law, field.name)
        if field.says.kinds is not None:
            changed[field.name] = scaled(value, factor)
        elif field.says.dimension == "stress":
            changed[field.name] = (tuple(factor * stress for stress in value) if field.several
                                   else factor * value)
    stiffer: Material = replace(law, **changed)
    return stiffer
