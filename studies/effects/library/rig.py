"""Effects of plate, loads, contacts, supply and sensor."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isinf, sqrt
from typing import Annotated

from tympan.geometry.specimen import Specimen
from tympan.studies.effects.effect import EffectParameter, Observable, Setup, effect
from tympan.studies.effects.library.families import CARRIED_LOAD


def _offset(axis: str) -> EffectParameter:
    return EffectParameter(
        f"offset along {axis}", "mm", width=1e-3, low=-1.0, high=1.0, even=True,
        reason="a plate placed by eye on marks or in a loose jig; no source")


@effect("The plates were glued off the centre of their frames, and may tilt.",
        finding="The plates sit off the centres of their frames, {dx} along x and {dy} along y",
        check="measure the gaps between plate and frame on all four sides with a calliper")
def plate_eccentricity(setup: Setup, dx: Annotated[float, _offset("x")],
                       dy: Annotated[float, _offset("y")]) -> Setup:
    """Move the plates off the centre of their frames."""
    def change(specimen: Specimen) -> Specimen:
        x, y = specimen.needed_plate().offset
        return replace(specimen, plate=replace(specimen.needed_plate(), offset=(x + dx, y + dy)))

    return setup.with_specimens(change)


@effect("Every load is heavier (or lighter) by the same mass than its label says: a plate, hook or "
        "lead was not weighed.",
        finding="Every load is {m_0} {m_0:heavier/lighter} than its label",
        check="weigh plate, screw, hook and lead, and every load, on one balance",
        family=CARRIED_LOAD)
def unaccounted_mass(setup: Setup, m_0: Annotated[float, EffectParameter(
        "every load is m + m_0", "g", width=1e-3, low=-10.0, high=10.0, reason=(
            "plate, screw, hook and glue weigh 0.5 to 3 g and leads carry some of it; no "
            "source"))]) -> Setup:
    """Add a mass to every load."""
    return setup.with_rig(unaccounted_mass=setup.rig.unaccounted_mass + m_0)


@effect("A lead, a guide or a touching probe holds the plate like a spring.",
        finding="Something holds the plate back like a spring of {k}",
        check="take away what touches the plate (lead, guide, probe) and read one state again")
def parallel_spring(setup: Setup, k: Annotated[float, EffectParameter(
        "stiffness against the deflection", "N/m", width=5.0, low=0.0, high=1e6,
        reason="a copper lead of 0.3 mm and 30 mm, built in at one end: 3 E I/L^3 = 5 N/m"
        )]) -> Setup:
    """Add a spring between plate and ground."""
    return setup.with_rig(spring=setup.rig.spring + k)


def _compounded(first: float, second: float) -> float:
    return first + second + first * second


@effect("The voltage across the film is a constant fraction larger or smaller than the one written "
        "down.",
        finding="The film gets {k} {k:more/less} voltage than is written down",
        check="measure the supply's voltage with a high-voltage probe at two settings")
def amplifier_gain(setup: Setup, k: Annotated[float, EffectParameter(
        "the film sees (1+k) U", "", width=0.02, low=-0.9, high=9.0, reason=(
            "converter modules set by a control voltage, without calibration, to a few per cent; "
            "no source"), told_in="%")]) -> Setup:
    """Multiply every voltage by a constant factor."""
    return setup.with_rig(amplifier_gain=_compounded(setup.rig.amplifier_gain, k))


@effect("The high-voltage supply sags under the film's leakage: the higher the voltage, the more "
        "of it is missing.",
        finding="The supply sags: at 5 kV, {U_s} of the voltage does not reach the film",
        check="measure the voltage on the film itself with a high-voltage probe, at the highest "
              "voltage")
def voltage_sag(setup: Setup, U_s: Annotated[float, EffectParameter(
        "the film sees U/(1+(U/U_s)^2); infinite where there is no sag", "kV",
        width=25e3, low=100.0, high=inf, power=-2, reason=(
            "25 kV is 7 % less at 7 kV: what a leaking film takes from a small unregulated "
            "converter; no source"),
        told_in="%", tell=lambda U_s: 1 - 1 / (1 + (5e3 / U_s) ** 2))]) -> Setup:
    """Reduce high voltages by the sag of the supply."""
    small, large = sorted((U_s, setup.rig.sag_voltage))  # 1/U_s² of both are added
    both = small if isinf(large) else small / sqrt(1 + (small / large) ** 2)
    return setup.with_rig(sag_voltage=both)


# One play operator between turns of the voltage; Zou and Gu (Polymers 10, 2018, 525; abstract read)
# fit actuators of this kind with a sum of such operators.
@effect("The film follows the voltage late: on the way up it stands where a lower voltage would "
        "hold it, on the way down where a higher one would.",
        finding="The film follows the voltage late, by {H} on the way up and on the way down",
        check="stop at one voltage on the way up for ten minutes and see whether the reading "
              "still moves",
        shows_in=(Observable.DIRECTION,))
def hysteresis(setup: Setup, H: Annotated[float, EffectParameter(
        "the film responds as to U - H (at least 0) on the way up, to U + H on the way down", "kV",
        width=0.1e3, low=0.0, high=1e6, reason=(
            "a film with a share g of its response delayed by τ lags a slow ramp by g τ dU/dt: "
            "with 0.1, 100 s and 10 V/s, 5 kV in 8 min, 0.1 kV; no source"))]) -> Setup:
    """Let the film lag behind the voltage, up and down."""
    return setup.with_rig(lag_voltage=setup.rig.lag_voltage + H)


@effect("The plate rubs on a guide or a probe: it stays where it is until the force that is "
        "missing is larger than the friction, and comes to rest short of where it would go.",
        finding="The plate rubs: it moves only where more than {F} is missing",
        check="tap the stand lightly at one voltage on the way up and see whether the reading "
              "moves on, and look where guide, probe or leads touch the plate",
        family=CARRIED_LOAD)
def friction(setup: Setup, F: Annotated[float, EffectParameter(
        "force against the way the plate came, on the way down first", "mN", width=5e-3, low=0.0,
        high=10.0, reason=(
            "a guide or probe pressed against the plate by a tenth of a load of 0.2 N, with a "
            "coefficient of friction of 0.2, rubs with 4 mN; no source"))]) -> Setup:
    """Add friction at the plate."""
    return setup.with_rig(friction=setup.rig.friction + F)


@effect("The displacement sensor shows a constant fraction too much or too little, as when its "
        "axis is tilted.",
        finding="The sensor shows {k} {k:more/less} than the plate moves",
        check="move the sensor's target by a gauge block of known thickness, and look whether its "
              "axis is upright")
def sensor_gain(setup: Setup, k: Annotated[float, EffectParameter(
        "readings are (1+k) y", "", width=0.01, low=-0.9, high=9.0, reason=(
            "an axis tilted by 8 degrees reads 1 % off (cosine); the scale of a calibrated sensor "
            "is better than that"), told_in="%")]) -> Setup:
    """Multiply all readings of the sensor by a constant factor."""
    return setup.with_rig(sensor_gain=_compounded(setup.rig.sensor_gain, k))


@effect("All readings are shifted by the same length: the sensor was not zero at the flat film.",
        finding="Every reading is {y_0} too {y_0:large/small}: the sensor was not zero at the "
                "flat film",
        check="read the sensor with the film flat and unloaded")
def sensor_zero(setup: Setup, y_0: Annotated[float, EffectParameter(
        "readings are y + y_0", "um", width=50e-6, low=-1.0, high=1.0,
        reason="the zero is set by hand on a plate that is not yet loaded; no source")]) -> Setup:
    """Shift all readings of the sensor by a length."""
    return setup.with_rig(sensor_zero=setup.rig.sensor_zero + y_0)


@effect("Readings wander in proportion to the time since the run began: sensor and stand warm up.",
        finding="Readings {rate:rise/fall} by {rate} as time goes by",
        check="read the first state once more at the end of the run",
        shows_in=(Observable.ELAPSED,))
def drift(setup: Setup, rate: Annotated[float, EffectParameter(
        "readings are y + rate · elapsed time", "um/min", width=1e-7 / 60, low=-1e-2 / 60,
        high=1e-2 / 60, reason=(
            "temperature drift of laser sensors: 0.03 %/°C of a range of 20 mm is 6 µm/°C (example "
            "of Omron's technical guide to displacement sensors), in a room that changes by 1 °C "
            "an hour"))]) -> Setup:
    """Shift readings in proportion to the time since the run began."""
    return setup.with_rig(drift=setup.rig.drift + rate)


@effect("A tester's gauge was not zero when nothing pulled at it.",
        finding="The tester's gauge shows {F_0} too {F_0:much/little} everywhere",
        check="read the gauge with the plate free, before and after the run",
        shows_in=(Observable.FORCE,))
def gauge_zero(setup: Setup, F_0: Annotated[float, EffectParameter(
        "readings are F + F_0", "mN", width=5e-3, low=-100.0, high=100.0,
        reason="0.1 % of a gauge for 5 N, by which such gauges drift; no source")]) -> Setup:
    """Shift all forces of a tester's gauge."""
    return setup.with_rig(gauge_zero=setup.rig.gauge_zero + F_0)


@effect("A tester's gauge shows a constant fraction too much or too little.",
        finding="The tester's gauge shows {k} {k:more/less} than the force",
        check="hang a known weight on the gauge",
        shows_in=(Observable.FORCE,))
def gauge_gain(setup: Setup, k: Annotated[float, EffectParameter(
        "readings are (1+k) F", "", width=0.01, low=-0.9, high=9.0,
        reason="gauges are calibrated to 1 % or better; no source", told_in="%")]) -> Setup:
    """Multiply all forces of a tester's gauge by a constant factor."""
    return setup.with_rig(gauge_gain=_compounded(setup.rig.gauge_gain, k))


@effect("A tester's displacement was not zero at the flat film: where it touches the plate was "
        "found by eye.",
        finding="The tester's displacement is {w_0} too {w_0:large/small} everywhere",
        check="approach the plate slowly and note the displacement at which the gauge begins to "
              "move",
        shows_in=(Observable.FORCE,))
def displacement_zero(setup: Setup, w_0: Annotated[float, EffectParameter(
        "readings are w + w_0", "um", width=100e-6, low=-1.0, high=1.0,
        reason="contact is found by eye, or by a force of some mN on a soft film; no source")]
                      ) -> Setup:
    """Shift all displacements of a tester."""
    return setup.with_rig(displacement_zero=setup.rig.displacement_zero + w_0)


@effect("Tester, gauge and clamps yield under the force, so that the plate moves less than the "
        "tester shows.",
        finding="The tester yields by {c}: the plate moves less than it shows",
        check="clamp the gauge to a rigid plate and read displacement against force",
        shows_in=(Observable.FORCE,))
def tester_compliance(setup: Setup, c: Annotated[float, EffectParameter(
        "the tester yields by c F between its displacement and the plate", "um/N", width=50e-6,
        low=0.0, high=1.0,
        reason="a gauge for 5 N yields by 0.1 to 0.3 mm at its full load; no source")]) -> Setup:
    """Let the tester yield under the force."""
    return setup.with_rig(tester_compliance=setup.rig.tester_compliance + c)
