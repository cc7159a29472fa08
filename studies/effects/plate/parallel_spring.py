"""Something besides the film holds the plate."""

from __future__ import annotations

from dataclasses import replace

from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, stiffness: float) -> Setup:
    """k added to the rig's parallel spring."""
    return replace(setup, rig=replace(setup.rig, spring=setup.rig.spring + stiffness))


register(Effect(
    "parallel_spring",
    "A lead, a guide or a touching probe holds the plate like a spring.",
    (Parameter("k", "stiffness against the deflection", "N/m", "stiffness per length", width=5.0,
               low=0.0, high=100.0,
               sign="positive", reason=(
                   "a copper lead of 0.3 mm and 30 mm, built in at one end: 3 E I/L^3 = 5 N/m")),),
    edit,
))
