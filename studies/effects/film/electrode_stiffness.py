"""The electrodes are stiff themselves."""

from __future__ import annotations

from dataclasses import replace

from tympan.geometry.specimen import Specimen
from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, modulus: float) -> Setup:
    """μ_e added to every electrode."""
    def change(specimen: Specimen) -> Specimen:
        stiffness = specimen.electrode.stiffness + modulus
        return replace(specimen, electrode=replace(specimen.electrode, stiffness=stiffness))

    return setup.with_specimens(change)


register(Effect(
    "electrode_stiffness",
    "The electrodes add stiffness of their own, without stress in the flat mounted film.",
    (Parameter("mu_e", "neo-Hookean modulus per virgin volume, without stress when mounted", "kPa",
               "stress",
               width=1e3, low=0.0, high=10e3, sign="positive", reason=(
                   "dried grease of 20 kPa, 25 µm on both sides of a virgin film of 1 mm, is 1 kPa; no source")),),
    edit,
))
