"""The amplifier's gain is not the nominal one."""

from __future__ import annotations

from dataclasses import replace

from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, gain: float) -> Setup:
    """The film sees (1+k) times the voltage it saw."""
    before = setup.rig.amplifier_gain
    return replace(setup, rig=replace(setup.rig, amplifier_gain=before + gain + before * gain))


register(Effect(
    "amplifier_gain",
    "The voltage across the film is a constant fraction larger or smaller than the one written down.",
    (Parameter("k", "the film sees (1+k) U", "", "", width=0.02, low=-0.3, high=0.3, sign="signed",
               reason=(
        "converter modules set by a control voltage, without calibration, to a few per cent; no source")),),
    edit,
))
