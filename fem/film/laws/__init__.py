"""Hyperelastic laws.

A strain energy and its derivatives in the principal stretches, registered once.

W is per virgin volume [J/m³ = Pa], of an incompressible solid: λ₃ = 1/(λ₁λ₂).
"""

from tympan.fem.film.laws.admissible import (
    STRETCH_RANGE,
    checked,
    ellipticity_margin,
    hill_margin,
    inadmissible_stretch,
    reachable_stretches,
)
from tympan.fem.film.laws.first_invariant import ArrudaBoyce, Gent, NeoHooke, Yeoh
from tympan.fem.film.laws.mooney import MooneyRivlin
from tympan.fem.film.laws.ogden import Ogden
from tympan.fem.film.laws.separable import PrestretchedOgden, Separable
from tympan.fem.film.laws.stiffened import Stiffened
from tympan.geometry.specimen import LAWS

__all__ = [
    "LAWS", "STRETCH_RANGE", "ArrudaBoyce", "Gent", "MooneyRivlin", "NeoHooke", "Ogden",
    "PrestretchedOgden", "Separable", "Stiffened", "Yeoh", "checked", "ellipticity_margin",
    "hill_margin", "inadmissible_stretch", "reachable_stretches",
]
