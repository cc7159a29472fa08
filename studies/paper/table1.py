"""Table 1 of the paper: its parameters as they are known, and what must be given to use them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tympan.fem.film.laws import Separable
from tympan.fem.film.library import EXAMINED
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.paper.actuators import actuators


@dataclass(frozen=True)
class Cell:
    """A row of Table 1: its name there, its value [SI], None where it is lost, and a note."""

    name: str
    symbol: str
    value: float | None
    unit: str
    note: str = ""


_LOST = "the cell did not survive in the text of the paper; never filled in silently"

#: Rows that hold for all three actuators; their sizes are in the specimen files of ``actuators``.
TABLE_1: tuple[Cell, ...] = (
    Cell("inner radius", "r", 1e-2, "m"),
    Cell("outer radius (short)", "r_1", 4.5e-2, "m"),
    Cell("membrane initial thickness", "z_ini", 1e-3, "m"),
    Cell("membrane final thickness", "z_0", 200e-6, "m"),
    Cell("standard gravity", "g", None, "m/s^2", _LOST),
    Cell("coefficient", "alpha_1", None, "1", _LOST),
    Cell("coefficient", "alpha_2", None, "1", _LOST + "; by Eq. (6) it is 1 - alpha_1"),
    Cell("vacuum permittivity", "epsilon_0", None, "F/m",
         "the cell is lost too; a constant of nature, CODATA's is used"),
    Cell("relative permittivity", "epsilon_r", None, "1", _LOST),
    Cell("coefficient of viscoelastic model", "k_1", 23.5e6, "Pa"),
    Cell("coefficient of viscoelastic model", "eta_1", 177.2e6, "Pa s"),
    Cell("damping coefficient", "eta_2", 62.4e3, "Pa s"),
    Cell("hyperelastic model coefficient", "beta_1", 13.4e3, "Pa"),
    Cell("hyperelastic model coefficient", "beta_2", 34.8e3, "Pa"),
    Cell("hyperelastic model coefficient", "beta_3", 35.8e3, "Pa"),
    Cell("hyperelastic model coefficient", "gamma_1", -0.41e3, "Pa"),
    Cell("hyperelastic model coefficient", "gamma_2", -113e3, "Pa"),
    Cell("hyperelastic model coefficient", "gamma_3", -34.2e3, "Pa"),
)


def known(symbol: str) -> float:
    """The value of a cell of Table 1 [SI].

    Raises
    ------
    InputError
        When it is lost: give it yourself.

    Examples
    --------
    >>> known("k_1")
    23500000.0
    """
    cell = next(cell for cell in TABLE_1 if cell.symbol == symbol)
    if cell.value is None:
        raise InputError(f"is lost in Table 1 ({cell.note}): it must be given", key=symbol)
    return cell.value


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
