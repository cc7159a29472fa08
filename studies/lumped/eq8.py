"""Eq. (8) of the source paper with the constants of its Table 1, as a film of lumped models.

Only lumped models can have such a film: as a membrane it has no stable shape
(``tympan.fem.film.library.REFUSED``).
"""

from __future__ import annotations

from dataclasses import replace

from tympan.fem.film.laws import Separable
from tympan.fem.film.library import EXAMINED
from tympan.geometry.specimen import Specimen


def table_1_law() -> Separable:
    """Take Eq. (8) with Table 1's constants from the library of materials."""
    law = EXAMINED["paper-table-1"]
    assert isinstance(law, Separable)
    return law


def eq8(specimen: Specimen, relative_permittivity: float) -> Specimen:
    """Make a specimen's film follow Eq. (8) with Table 1's constants; the lost ε_r is given."""
    reference = specimen.membrane.area_prestretch**0.5
    film = replace(specimen.membrane, material=replace(table_1_law(), reference=reference),
                   relative_permittivity=relative_permittivity)
    return replace(specimen, membrane=film)
