"""A load that is not in the nominal mass."""

from __future__ import annotations

from dataclasses import replace

from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, mass: float) -> Setup:
    """m₀ added to the rig's."""
    return replace(setup,
                   rig=replace(setup.rig, unaccounted_mass=setup.rig.unaccounted_mass + mass))


register(Effect(
    "unaccounted_mass",
    "Every load is heavier (or lighter) by the same mass than its label says: a plate, hook or lead was not weighed.",
    (Parameter("m_0", "every load is m + m_0", "g", "mass", width=1e-3, low=-5e-3, high=15e-3,
               sign="signed", reason=(
        "plate, screw, hook and glue weigh 0.5 to 3 g and leads carry some of it; no source")),),
    edit,
))
