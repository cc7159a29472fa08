"""The sensor's scale is wrong."""

from __future__ import annotations

from dataclasses import replace

from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, gain: float) -> Setup:
    """Readings of a deflection are (1+k) times as large; the sensor's zero stays."""
    before = setup.rig.sensor_gain
    return replace(setup, rig=replace(setup.rig, sensor_gain=before + gain + before * gain))


register(Effect(
    "sensor_gain",
    "The displacement sensor shows a constant fraction too much or too little, as when its axis is tilted.",
    (Parameter("k", "readings are (1+k) y", "", "", width=0.01, low=-0.2, high=0.2, sign="signed",
               reason=(
        "an axis tilted by 8 degrees reads 1 % off (cosine); the scale of a calibrated sensor is better than that")),),
    edit,
))
