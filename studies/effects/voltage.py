"""Effects between supply and film."""

from __future__ import annotations

from math import inf, isinf, sqrt
from typing import Annotated

from tympan.studies.effects.effect import EffectParameter, Setup, effect


@effect("The voltage across the film is a constant fraction larger or smaller than the one written "
        "down.")
def amplifier_gain(setup: Setup, k: Annotated[float, EffectParameter(
        "the film sees (1+k) U", "", width=0.02, low=-0.3, high=0.3, sign="signed", reason=(
            "converter modules set by a control voltage, without calibration, to a few per cent; "
            "no source"))]) -> Setup:
    """The film sees (1+k) times the voltage it saw."""
    before = setup.rig.amplifier_gain
    return setup.with_rig(amplifier_gain=before + k + before * k)


@effect("The high-voltage supply sags under the film's leakage: the higher the voltage, the more "
        "of it is missing.")
def voltage_sag(setup: Setup, U_s: Annotated[float, EffectParameter(
        "the film sees U/(1+(U/U_s)^2); infinite where there is no sag", "kV",
        width=25e3, low=5e3, high=inf, sign="positive", power=-2, reason=(
            "25 kV is 7 % less at 7 kV: what a leaking film takes from a small unregulated "
            "converter; no source"))]) -> Setup:
    """U/(1+(U/U_s)²), together with the sag the rig has already: 1/U_s² add up."""
    small, large = sorted((U_s, setup.rig.sag_voltage))
    both = small if isinf(large) else small / sqrt(1 + (small / large) ** 2)
    return setup.with_rig(sag_voltage=both)


# One play operator between turns of the voltage; Zou and Gu (Polymers 10, 2018, 525; abstract read)
# fit actuators of this kind with a sum of such operators.
@effect("The film follows the voltage late: on the way up it stands where a lower voltage would "
        "hold it, on the way down where a higher one would.", columns=("direction",))
def hysteresis(setup: Setup, H: Annotated[float, EffectParameter(
        "the film responds as to U - H (at least 0) on the way up, to U + H on the way down", "kV",
        width=0.1e3, low=0.0, high=1e3, sign="positive", reason=(
            "a film with a share g of its response delayed by τ lags a slow ramp by g τ dU/dt: "
            "with 0.1, 100 s and 10 V/s, 5 kV in 8 min, 0.1 kV; no source"))]) -> Setup:
    """The rig's lag raised."""
    return setup.with_rig(lag_voltage=setup.rig.lag_voltage + H)
