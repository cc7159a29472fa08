"""The supply gives way at high voltage."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isinf, sqrt

from tympan.studies.effects.effect import INVERSE_SQUARE, Effect, Parameter, Setup, register


def edit(setup: Setup, voltage: float) -> Setup:
    """U/(1+(U/U_s)²), together with the sag the rig has already: 1/U_s² add up."""
    small, large = sorted((voltage, setup.rig.sag_voltage))
    both = small if isinf(large) else small / sqrt(1 + (small / large) ** 2)
    return replace(setup, rig=replace(setup.rig, sag_voltage=both))


register(Effect(
    "voltage_sag",
    "The high-voltage supply sags under the film's leakage: the higher the voltage, the more of it is missing.",
    (Parameter("U_s", "the film sees U/(1+(U/U_s)^2); infinite where there is no sag", "kV",
               "voltage", width=25e3,
               low=5e3, high=inf, sign="positive", scale=INVERSE_SQUARE, reason=(
                   "25 kV is 7 % less at 7 kV: what a leaking film takes from a small unregulated converter; no source"
               )),),
    edit,
))
