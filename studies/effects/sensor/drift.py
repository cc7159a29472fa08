"""Readings wander with elapsed time."""

from __future__ import annotations

from dataclasses import replace

from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, rate: float) -> Setup:
    """The rig's rate raised."""
    return replace(setup, rig=replace(setup.rig, drift=setup.rig.drift + rate))


register(Effect(
    "drift",
    "Readings wander in proportion to the time since the run began: sensor and stand warm up.",
    (Parameter("rate", "readings are y + rate · elapsed time", "um/min", "speed", width=1e-7 / 60,
               low=-1e-6 / 60,
               high=1e-6 / 60, sign="signed", reason=(
                   "temperature drift of laser sensors: 0.03 %/°C of a range of 20 mm is 6 µm/°C (example of Omron's "
                   "technical guide to displacement sensors), in a room that changes by 1 °C an hour")),),
    edit,
    columns=("elapsed_s",),
))
