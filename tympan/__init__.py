"""Dielectric-elastomer membrane actuators: film, plate, weight and voltage.

The names that scripts need are here; each is loaded on first use::

    import tympan

    oval = tympan.load("oval.toml")
    result = tympan.solve(oval, mass="17.9 g", voltage="3.5 kV")
    print(result.status, result.deflection_m)

Quantities are SI numbers or texts with their unit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tympan.door import *
    from tympan.families import FilmFamily as FilmFamily
    from tympan.lumped_door import lumped as lumped
    from tympan.parts import *

    __version__: str

__all__ = [
    "Actuator",
    "ArrudaBoyce",
    "Bistable",
    "BuckledBeam",
    "Case",
    "Circle",
    "ClosedSpline",
    "Constant",
    "ConstantStrength",
    "Electrode",
    "Ellipse",
    "Film",
    "FilmFamily",
    "ForceTable",
    "Gent",
    "InputError",
    "JoinedFilm",
    "LengthScatter",
    "Magnet",
    "MeshSettings",
    "MooneyRivlin",
    "NeoHooke",
    "Ogden",
    "Patch",
    "Plate",
    "Polygon",
    "PowerStrength",
    "Region",
    "RegularPolygon",
    "Requirements",
    "Result",
    "Rig",
    "Rotated",
    "RoundedRectangle",
    "Scatter",
    "Segment",
    "Settings",
    "ShearThinning",
    "Specimen",
    "Spring",
    "Stadium",
    "StrengthScatter",
    "Superellipse",
    "Tolerances",
    "ViscousBranch",
    "Yeoh",
    "__version__",
    "alpha",
    "compare",
    "curve",
    "data",
    "design",
    "diagnose",
    "draft",
    "draw",
    "effects",
    "export",
    "films_within",
    "fit_material",
    "force",
    "limits",
    "load",
    "lumped",
    "material",
    "materials",
    "modes",
    "optimise",
    "path",
    "plan",
    "report",
    "response",
    "sense",
    "sensitivity",
    "show_material",
    "solve",
    "steer",
    "study",
    "sweep",
    "tolerance",
    "transient",
]


if not TYPE_CHECKING:  # type checkers know all names, and should object to others
    def __getattr__(name: str) -> Any:
        """Find a public object by name, wherever it is; the version is the installed one."""
        if name == "__version__":
            from importlib.metadata import version

            return version("tympan")
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from importlib import import_module

        # The last place is slow to load and rarely needed.
        places = (import_module(f"tympan.{place}") for place in (
            "parts", "door", "lumped_door", "families"))
        return next(getattr(place, name) for place in places if hasattr(place, name))


def __dir__() -> list[str]:
    return __all__
