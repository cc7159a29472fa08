"""Table 1 of the paper: its parameters as they are known, and what must be given to use them."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from importlib import resources
from typing import Any

from tympan.base.errors import InputError
from tympan.fem.film.laws import Separable
from tympan.fem.film.library import EXAMINED
from tympan.geometry.specimen import Specimen
from tympan.studies.paper.actuators import actuators

#: The cells of ``table-1.toml`` by symbol: name, value [SI] unless lost, unit and note.
TABLE_1: dict[str, dict[str, Any]] = tomllib.loads(
    resources.files("tympan.studies.paper").joinpath("table-1.toml").read_text(encoding="utf-8"))


def known(symbol: str) -> float:
    """The value of a cell of Table 1, such as "k_1" [SI]; one that is lost is an InputError."""
    cell = TABLE_1[symbol]
    if "value" not in cell:
        raise InputError(f"is lost in Table 1 ({cell['note']}): it must be given", key=symbol)
    return float(cell["value"])


def eq8(specimen: Specimen, relative_permittivity: float) -> Specimen:
    """A specimen whose film follows Eq. (8) with Table 1's constants; ε_r, lost, must be given.

    Good for the lumped model alone: as a membrane the law has no stable shape
    (``tympan.fem.film.library.REFUSED``).
    """
    law = EXAMINED["paper-table-1"]
    assert isinstance(law, Separable)
    reference = specimen.membrane.area_prestretch**0.5
    film = replace(specimen.membrane, material=replace(law, reference=reference),
                   relative_permittivity=relative_permittivity)
    return replace(specimen, membrane=film)


def paper_actuators(relative_permittivity: float) -> tuple[Specimen, ...]:
    """The three actuators of the paper with Table 1's law; ε_r must be given."""
    return tuple(eq8(specimen, relative_permittivity) for specimen in actuators())
