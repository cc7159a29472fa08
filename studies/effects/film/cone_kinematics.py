"""The film of the lumped model is no straight cone."""

from __future__ import annotations

from dataclasses import replace

from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.circles.cone import Lumped
from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, share: float) -> Setup:
    """Every film's profile moved by c towards the membrane's."""
    def change(one: Specimen) -> Specimen:
        if not isinstance(one, Lumped):
            raise InputError("is an effect on the lumped model", key="cone_kinematics",
                             given=one.name)
        return replace(one, profile=one.profile + share)

    return setup.with_specimens(change)


register(Effect(
    "cone_kinematics",
    "The film between plate and frame is not the lumped model's straight cone but hollow, steepest at the plate.",
    (Parameter("c", "film from the straight cone (0) to a weightless membrane hardly deflected (1)",
               "", "", width=1.0,
               low=0.0, high=1.5, sign="positive", reason=(
                   "equilibrium of a flat tense film makes it 1, bending stiffness would make it less: nothing between "
                   "0 and 1 is favoured much, and room beyond 1 lets data contradict both; no source")),),
    edit, lumped=True,
))
