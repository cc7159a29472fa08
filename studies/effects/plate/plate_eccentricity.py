"""The plate sits off the centre."""

from __future__ import annotations

from dataclasses import replace

from tympan.geometry.specimen import Specimen
from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, dx: float, dy: float) -> Setup:
    """Every plate's centre moved."""
    def change(specimen: Specimen) -> Specimen:
        x, y = specimen.plate.offset
        return replace(specimen, plate=replace(specimen.plate, offset=(x + dx, y + dy)))

    return setup.with_specimens(change)


def _offset(axis: str) -> Parameter:
    return Parameter(f"d{axis}", f"offset along {axis}", "mm", "length", width=1e-3, low=-5e-3,
                     high=5e-3, sign="even",
                     reason="a plate placed by eye on marks or in a loose jig; no source")


register(Effect(
    "plate_eccentricity",
    "The plates were glued off the centre of their frames, and may tilt.",
    (_offset("x"), _offset("y")),
    edit,
))
