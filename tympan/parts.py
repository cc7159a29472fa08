"""The parts of an actuator, each loaded when it is first asked for.

Type checkers read parts.pyi, which also allows texts with units.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

#: Names of the parts by the modules that they come from.
PLACES = {
    "tympan.fem.film.breakdown": ("ConstantStrength", "PowerStrength"),
    "tympan.fem.film.flows": ("ShearThinning",),
    "tympan.fem.film.laws": ("ArrudaBoyce", "Gent", "MooneyRivlin", "NeoHooke", "Ogden", "Yeoh"),
    "tympan.fem.membrane.biases": (
        "Bistable", "BuckledBeam", "Constant", "ForceTable", "JoinedFilm", "Magnet", "Spring"),
    "tympan.fem.rig": ("Actuator", "Rig"),
    "tympan.geometry.outlines": (
        "Circle", "ClosedSpline", "Ellipse", "Polygon", "RegularPolygon", "Rotated",
        "RoundedRectangle", "Stadium", "Superellipse"),
    "tympan.geometry.specimen": (
        "Electrode", "Film", "Patch", "Plate", "Region", "Segment", "Specimen",
        "ViscousBranch"),
    "tympan.studies.design.requirements": ("Requirements",),
    "tympan.studies.tolerance.given": ("LengthScatter", "Scatter", "StrengthScatter", "Tolerances"),
}
_MODULES = {name: module for module, names in PLACES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a part from its module."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return [*_MODULES]
