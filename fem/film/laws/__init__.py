"""Hyperelastic laws: a strain energy and its derivatives in the principal stretches.

W is per virgin volume [J/m³ = Pa], of an incompressible solid: λ₃ = 1/(λ₁λ₂).
"""

from tympan.base.plugins import load_later
from tympan.fem.film.laws.invariants import ArrudaBoyce, Gent, MooneyRivlin, NeoHooke, Yeoh
from tympan.fem.film.laws.ogden import Ogden, PrestretchedOgden, Separable
from tympan.fem.film.laws.stiffened import MooneyShare, Stiffened
from tympan.geometry.specimen import LAWS

load_later("tympan.laws", LAWS)

__all__ = [
    "LAWS", "ArrudaBoyce", "Gent", "MooneyRivlin", "MooneyShare", "NeoHooke", "Ogden",
    "PrestretchedOgden", "Separable", "Stiffened", "Yeoh",
]
