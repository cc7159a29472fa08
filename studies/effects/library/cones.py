"""Effects on the lumped model's actuators."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.studies.circles import Lumped
from tympan.studies.effects.effect import EffectParameter, Setup, effect


@effect("The film between plate and frame is not the lumped model's straight cone but hollow, "
        "steepest at the plate.",
        finding="The film is hollow: {c} of the way from the lumped model's straight cone to a "
                "membrane",
        check="photograph the film from the side and lay a ruler on it from plate to frame",
        lumped=True)
def cone_kinematics(setup: Setup, c: Annotated[float, EffectParameter(
        "film from the straight cone (0) to a weightless membrane hardly deflected (1)", "",
        width=1.0, low=0.0, high=1.5, reason=(
            "equilibrium of a flat tense film makes it 1, bending stiffness would make it less: "
            "nothing between 0 and 1 is favoured much, and room beyond 1 lets data contradict "
            "both; no source"), told_in="%")]) -> Setup:
    def change(specimen: Specimen) -> Specimen:
        if not isinstance(specimen, Lumped):
            raise InputError("is an effect on the lumped model", key="cone_kinematics",
                             given=specimen.name)
        return replace(specimen, profile=specimen.profile + c)

    return setup.with_specimens(change)
