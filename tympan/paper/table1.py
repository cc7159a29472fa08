"""Table 1 of the paper: its cells, and its actuators with the constants that survived."""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any

from tympan.base.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.lumped.actuator import Viscous
from tympan.studies.lumped.eq8 import eq8
from tympan.studies.shipped import actuators

#: The cells of ``table-1.toml`` by symbol: name, value [SI] unless lost, unit and note.
TABLE_1: dict[str, dict[str, Any]] = tomllib.loads(
    resources.files("tympan.paper").joinpath("table-1.toml").read_text(encoding="utf-8"))


def known(symbol: str) -> float:
    """Read a cell of Table 1, such as "k_1" [SI]; raise an InputError for a lost cell."""
    cell = TABLE_1[symbol]
    if "value" not in cell:
        raise InputError(f"is lost in Table 1 ({cell['note']}): it must be given", key=symbol)
    return float(cell["value"])


#: The viscous constants of Table 1.
VISCOUS = Viscous(known("k_1"), known("eta_1"), known("eta_2"))


def paper_actuators(relative_permittivity: float) -> tuple[Specimen, ...]:
    """Build the three actuators of the paper with Table 1's law; ε_r must be given."""
    return tuple(eq8(specimen, relative_permittivity) for specimen in actuators())
