"""Effects in the readings."""

from __future__ import annotations

from typing import Annotated

from tympan.studies.effects.effect import EffectParameter, Setup, effect


@effect("The displacement sensor shows a constant fraction too much or too little, as when its "
        "axis is tilted.")
def sensor_gain(setup: Setup, k: Annotated[float, EffectParameter(
        "readings are (1+k) y", "", width=0.01, low=-0.2, high=0.2, sign="signed", reason=(
            "an axis tilted by 8 degrees reads 1 % off (cosine); the scale of a calibrated sensor "
            "is better than that"))]) -> Setup:
    """Readings of a deflection are (1+k) times as large; the sensor's zero stays."""
    before = setup.rig.sensor_gain
    return setup.with_rig(sensor_gain=before + k + before * k)


@effect("All readings are shifted by the same length: the sensor was not zero at the flat film.")
def sensor_zero(setup: Setup, y_0: Annotated[float, EffectParameter(
        "readings are y + y_0", "um", width=50e-6, low=-1e-3, high=1e-3, sign="signed",
        reason="the zero is set by hand on a plate that is not yet loaded; no source")]) -> Setup:
    """y₀ added to every reading."""
    return setup.with_rig(sensor_zero=setup.rig.sensor_zero + y_0)


@effect("Readings wander in proportion to the time since the run began: sensor and stand warm up.",
        columns=("elapsed_s",))
def drift(setup: Setup, rate: Annotated[float, EffectParameter(
        "readings are y + rate · elapsed time", "um/min", width=1e-7 / 60, low=-1e-6 / 60,
        high=1e-6 / 60, sign="signed", reason=(
            "temperature drift of laser sensors: 0.03 %/°C of a range of 20 mm is 6 µm/°C (example "
            "of Omron's technical guide to displacement sensors), in a room that changes by 1 °C "
            "an hour"))]) -> Setup:
    """The rig's rate raised."""
    return setup.with_rig(drift=setup.rig.drift + rate)
