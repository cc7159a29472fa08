"""Effects at the plate."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from tympan.geometry.specimen import Specimen
from tympan.studies.effects.effect import EffectParameter, Setup, effect


def _offset(axis: str) -> EffectParameter:
    return EffectParameter(f"offset along {axis}", "mm", width=1e-3, low=-5e-3, high=5e-3,
                           sign="even",
                           reason="a plate placed by eye on marks or in a loose jig; no source")


@effect("The plates were glued off the centre of their frames, and may tilt.")
def plate_eccentricity(setup: Setup, dx: Annotated[float, _offset("x")],
                       dy: Annotated[float, _offset("y")]) -> Setup:
    """Every plate's centre moved."""
    def change(specimen: Specimen) -> Specimen:
        x, y = specimen.plate.offset
        return replace(specimen, plate=replace(specimen.plate, offset=(x + dx, y + dy)))

    return setup.with_specimens(change)


@effect("Every load is heavier (or lighter) by the same mass than its label says: a plate, hook or "
        "lead was not weighed.")
def unaccounted_mass(setup: Setup, m_0: Annotated[float, EffectParameter(
        "every load is m + m_0", "g", width=1e-3, low=-5e-3, high=15e-3, sign="signed", reason=(
            "plate, screw, hook and glue weigh 0.5 to 3 g and leads carry some of it; no "
            "source"))]) -> Setup:
    """m₀ added to the rig's."""
    return setup.with_rig(unaccounted_mass=setup.rig.unaccounted_mass + m_0)


@effect("A lead, a guide or a touching probe holds the plate like a spring.")
def parallel_spring(setup: Setup, k: Annotated[float, EffectParameter(
        "stiffness against the deflection", "N/m", width=5.0, low=0.0, high=100.0, sign="positive",
        reason="a copper lead of 0.3 mm and 30 mm, built in at one end: 3 E I/L^3 = 5 "
               "N/m")]) -> Setup:
    """k added to the rig's parallel spring."""
    return setup.with_rig(spring=setup.rig.spring + k)
