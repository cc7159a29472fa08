"""The film follows the voltage late, so up and down ramps differ."""

from __future__ import annotations

from dataclasses import replace

from tympan.studies.effects.effect import Effect, Parameter, Setup, register


def edit(setup: Setup, lag: float) -> Setup:
    """The rig's lag raised."""
    return replace(setup, rig=replace(setup.rig, lag_voltage=setup.rig.lag_voltage + lag))


# One play operator between turns of the voltage; Zou and Gu (Polymers 10, 2018, 525; abstract read)
# fit actuators of this kind with a sum of such operators.
register(Effect(
    "hysteresis",
    "The film follows the voltage late: on the way up it stands where a lower voltage would hold it, on the way down "
    "where a higher one would.",
    (Parameter("H",
               "the film responds as to U - H (at least 0) on the way up, to U + H on the way down",
               "kV",
               "voltage", width=0.1e3, low=0.0, high=1e3, sign="positive", reason=(
                   "a film with a share g of its response delayed by τ lags a slow ramp by g τ dU/dt: with 0.1, 100 s "
                   "and 10 V/s, 5 kV in 8 min, 0.1 kV; no source")),),
    edit,
    columns=("direction",),
))
