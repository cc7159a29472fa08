"""Hyperelastic laws: a strain energy and its derivatives in the principal stretches, registered once.

W is per virgin volume [J/m³ = Pa], of an incompressible solid: λ₃ = 1/(λ₁λ₂).
"""

from fem.laws.admissible import (
    STRETCH_RANGE,
    checked,
    ellipticity_margin,
    hill_margin,
    inadmissible_stretch,
    reachable_stretches,
)
from fem.laws.first_invariant import ArrudaBoyce, Gent, NeoHooke, Yeoh
from fem.laws.mooney import MooneyRivlin
from fem.laws.ogden import Ogden
from fem.laws.registry import REGISTRY, register
from fem.laws.separable import PrestretchedOgden, Separable
from fem.laws.stiffened import Stiffened

__all__ = [
    "REGISTRY", "STRETCH_RANGE", "ArrudaBoyce", "Gent", "MooneyRivlin", "NeoHooke", "Ogden", "PrestretchedOgden",
    "Separable", "Stiffened", "Yeoh", "checked", "ellipticity_margin", "hill_margin", "inadmissible_stretch",
    "reachable_stretches", "register",
]
