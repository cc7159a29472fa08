"""The paper's three actuators: a specimen file each, beside this one."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

from tympan.fem.film.library import DEFAULT, MATERIALS, load_specimen
from tympan.geometry.specimen import Film, Specimen

#: The file of each by its name, the circle first, the large ellipse last.
FILES = {name: Path(__file__).with_name(f"{name}.toml")
         for name in ("circular", "elliptical-small", "elliptical-large")}


@cache
def actuators() -> tuple[Specimen, ...]:
    """All three, the circle first."""
    return tuple(map(load_specimen, FILES.values()))


def paper_film(material: str = DEFAULT) -> Film:
    """Their film, of a material of the library."""
    return replace(actuators()[0].membrane, material=MATERIALS[material].material)
