"""The sensor's zero is not the flat film."""

from __future__ import annotations

from dataclasses import replace

from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, zero: float) -> Setup:
    """y₀ added to every reading."""
    return replace(setup, rig=replace(setup.rig, sensor_zero=setup.rig.sensor_zero + zero))


register(Effect(
    "sensor_zero",
    "All readings are shifted by the same length: the sensor was not zero at the flat film.",
    (Parameter("y_0", "readings are y + y_0", "um", "length", width=50e-6, low=-1e-3, high=1e-3,
               sign="signed", reason=(
        "the zero is set by hand on a plate that is not yet loaded; no source")),),
    edit,
))
