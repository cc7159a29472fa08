"""The electrode ends before the frame."""

from __future__ import annotations

from dataclasses import replace

from tympan.geometry.specimen import Specimen
from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, width: float) -> Setup:
    """The uncovered band along the frame widened by d."""
    def change(specimen: Specimen) -> Specimen:
        margin = specimen.electrode.margin_frame + width
        return replace(specimen, electrode=replace(specimen.electrode, margin_frame=margin))

    return setup.with_specimens(change)


register(Effect(
    "electrode_margin",
    "The electrode does not reach the frame: an uncovered band along it carries no field.",
    (Parameter("d", "width of the uncovered band along the frame", "mm", "length", width=2e-3,
               low=0.0, high=10e-3,
               sign="positive", least=0.5e-3, reason=(
                   "grease is brushed by hand and kept clear of a frame against flashover, about 1 mm per few kV; no "
                   "source. A specimen can have a band from 1 % of the gap between plate and frame on")),),
    edit,
))
