"""Files that come with tympan: the source paper's three actuators, and a study of them.

Their sizes and loads are the paper's. Their material is from the library: the paper's own
constants give no stable membrane (``fem/film/library.toml``).
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from tympan.fem.film.library import load_specimen
from tympan.geometry.specimen import Specimen

#: File of each actuator by its name, the circle first, the large ellipse last.
FILES = {name: Path(__file__).with_name(f"{name}.toml")
         for name in ("circular", "elliptical-small", "elliptical-large")}

#: Study of the three actuators under the paper's loads.
STUDY = Path(__file__).with_name("study.toml")


@cache
def actuators() -> tuple[Specimen, ...]:
    """Load the three actuators, the circle first."""
    return tuple(map(load_specimen, FILES.values()))
