"""All effects, in the order in which several are applied.

What an effect says of itself stands in its decorator and in its parameters.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, isinf, log, sqrt
from typing import Annotated

import numpy as np

from tympan.fem.film.laws import MooneyShare, Stiffened
from tympan.fem.film.laws.invariants import first_invariant
from tympan.geometry.errors import InputError
from tympan.geometry.paths import with_change
from tympan.geometry.specimen import NARROWEST, Film, Patch, Specimen, ViscousBranch
from tympan.studies.circles import Lumped
from tympan.studies.effects.effect import EffectParameter, Setup, effect

#: What tells how readings go on in time: a transient's times, or how long states were held.
IN_TIME = "t_s or dwell_s"
#: What coupon tests are read by.
OF_STRIPS, WARMTH = "nominal_stress_kPa", "temperature_C"
#: Columns that only coupons have.
COUPONS_ALONE = frozenset({OF_STRIPS, WARMTH})


@effect("The film hardens with stretch more (h > 0) or less than the nominal law, with the same "
        "stress when mounted.",
        finding="The film hardens {h:more/less} with stretch than the stated law, by an exponent "
                "of {h}",
        check="stretch a strip of the same film beyond its mounted stretch and compare its curve "
              "with the stated law")
def strain_stiffening(setup: Setup, h: Annotated[float, EffectParameter(
        "power of the first invariant by which the slope of the energy grows", "",
        width=0.2, low=-0.95, high=8.0, reason=(
            "Gent's law with J_lim has h = I_m/(J_lim + 3 - I_m) about the mounted I_m = 10: 0.1 "
            "for the 110 of the library's VHB 4910, 0.3 for 40, against 0 for neo-Hooke: sources "
            "on one tape differ so"))]) -> Setup:
    def change(film: Film) -> Film:
        mounted = float(np.real(first_invariant(*film.prestretch)[0])) + 3
        return replace(film, material=Stiffened(film.material, h, mounted))

    return setup.with_films(change)


@effect("A share of the film's stress comes from the second invariant, as in Mooney's law: "
        "stretched both ways it pulls more (s > 0) than tests of narrow strips tell, or less, with "
        "the same stress when mounted.",
        finding="A share of {s} of the film's stress comes from the second invariant, which the "
                "stated law lacks",
        check="stretch the same film both ways, by a bulge test, beside a strip of it, and compare "
              "both with the stated law")
def second_invariant(setup: Setup, s: Annotated[float, EffectParameter(
        "share of a neo-Hookean stress that ∂W/∂I₂ has and ∂W/∂I₁ gives up", "",
        width=0.1, low=-1.0, high=1.0, reason=(
            "of vulcanised rubber ∂W/∂I₂ is about 1/8 of ∂W/∂I₁ at small stretches, a share of "
            "0.11, and falls from there (Rivlin, Saunders, Phil. Trans. R. Soc. A 243, 251, 1951, "
            "as commonly quoted, not read again)"), told_in="%")]) -> Setup:
    return setup.with_films(lambda film: replace(
        film, material=MooneyShare(film.material, s, film.area_prestretch)))


@effect("The permittivity of the film falls (n > 0) or rises as its area grows beyond the mounted "
        "one.",
        finding="The film's permittivity {n:falls/rises} by {n} for every tenth that its area "
                "grows beyond the mounted one",
        check="measure the film's capacitance unloaded and under the largest load")
def permittivity_stretch(setup: Setup, n: Annotated[float, EffectParameter(
        "exponent of ε_r (J/J_p)^(-n)", "", width=0.15, low=-5.0, high=5.0, reason=(
            "VHB 4910: ε_r 4.7 unstretched and 2.6 at a stretch of 5 (Wissler, Mazza, Sens. "
            "Actuators A 138, 2007, as commonly quoted, not read again) make n = "
            "ln(4.7/2.6)/ln(25) = 0.18; others find no dependence"),
        told_in="%", tell=lambda n: 1 - 1.1**-n)]) -> Setup:
    return setup.with_films(
        lambda film: replace(film, permittivity_exponent=film.permittivity_exponent + n))


@effect("All films were stretched a little more along one axis of the frame than along the other, "
        "at the same area.",
        finding="All films are stretched {a} more than stated along {a:x/y} and as much less "
                "along {a:y/x}",
        check="measure the marks drawn on the films before stretching, along x and along y")
def prestretch_anisotropy(setup: Setup, a: Annotated[float, EffectParameter(
        "stretch λ(1+a) along x and λ/(1+a) along y", "", width=0.02, low=-0.5, high=1.0,
        reason="a grid drawn on the film and read with a ruler, 1 mm in 50 mm; no source",
        told_in="%")]) -> Setup:
    def change(film: Film) -> Film:
        x, y = film.prestretch
        return replace(film, prestretch=(x * (1 + a), y / (1 + a)))

    return setup.with_films(change)


@effect("The film of one specimen slipped in its frame or was stretched less than the others.",
        finding="The film of {which} slipped: it is {delta} less stretched than stated",
        check="look for slip where the film of {which} is clamped, and measure the marks drawn on "
              "it before stretching")
def prestretch_loss(setup: Setup, delta: Annotated[float, EffectParameter(
        "the specimen's stretches are λ(1-delta)", "", width=0.02, low=0.0, high=0.9, reason=(
            "film slipping by 1 mm under a clamp of a 45 mm frame loses 2 % of its stretch; no "
            "source"), told_in="%")], which: str) -> Setup:
    def change(film: Film) -> Film:
        x, y = film.prestretch
        return replace(film, prestretch=(x * (1 - delta), y * (1 - delta)))

    return setup.with_films(change, which)


def _uneven(axis: str) -> EffectParameter:
    return EffectParameter(
        f"share by which films are thicker where {axis} ends at the frame than in the middle", "",
        width=0.03, low=-0.9, high=0.9, even=True, reason=(
            "makers of cast films and tapes state their thickness to 5 to 10 %, over the whole "
            "roll; no source for a frame's width"), told_in="%")


@effect("The virgin films are thicker on one side of the frames than on the other.",
        finding="The films are thicker on one side than in the middle, by {gx} where x ends at the "
                "frame and by {gy} where y does",
        check="measure the film's thickness at both ends of the frame, or weigh pieces cut there",
        columns=("x_mm",))
def thickness_gradient(setup: Setup, gx: Annotated[float, _uneven("x")],
                       gy: Annotated[float, _uneven("y")]) -> Setup:
    def change(film: Film) -> Film:
        x, y = film.thickness_gradient
        return replace(film, thickness_gradient=(x + gx, y + gy))

    return setup.with_films(change)


@effect("The electrode does not reach the frame: an uncovered band along it carries no field.",
        finding="The electrodes end {d} short of the frame",
        check="measure with a ruler how far from the frame the electrodes end")
def electrode_margin(setup: Setup, d: Annotated[float, EffectParameter(
        "width of the uncovered band along the frame", "mm", width=2e-3, low=0.0, high=1.0,
        least=0.5e-3, reason=(
            "grease is brushed by hand and kept clear of a frame against flashover, about 1 mm per "
            "few kV; no source. A specimen can have a band from 1 % of the gap between plate and "
            "frame on"))]) -> Setup:
    def banded(specimen: Specimen) -> Specimen:
        # A band too narrow to be built is none, or the narrowest, whichever is nearer.
        least = NARROWEST * specimen.gap
        width = d if d >= least or d <= 0 else least if d > least / 2 else 0.0
        changed: Specimen = with_change(specimen, ("electrode", "margin_frame"), width)
        return changed

    return setup.with_specimens(banded)


def _wide(axis: str) -> EffectParameter:
    return EffectParameter(
        f"the spot's diameter times the cosine between {axis} and the way to it from the plate's "
        "centre", "mm", width=10e-3, low=-1.0, high=1.0, even=True, reason=(
            "grease that a finger took along, or a brush did not reach, is a spot about as wide as "
            "either; no source"))


@effect("The electrode of one specimen misses a spot of the film, which carries no field there.",
        finding="The electrode of {which} leaves a spot bare: laid off from the plate's centre "
                "towards it, its diameter reaches {dx} along x and {dy} along y; it is {p} of the "
                "way from plate to frame",
        check="look through the film of {which} against a light, for a spot without electrode",
        columns=("x_mm",))
def electrode_patch(setup: Setup, dx: Annotated[float, _wide("x")],
                    dy: Annotated[float, _wide("y")], p: Annotated[float, EffectParameter(
                        "share of the way from plate to frame at which the spot is", "", width=0.5,
                        low=0.05, high=1.0, spread=log(1.5),
                        reason="between plate and frame no place is likelier than others",
                        told_in="%")], which: str) -> Setup:
    diameter = float(np.hypot(dx, dy))
    if not diameter:
        return setup

    def spotted(specimen: Specimen) -> Specimen:
        centre = specimen.place_between((dx / diameter, dy / diameter), p)
        electrode = specimen.electrode
        return replace(specimen, electrode=replace(
            electrode, patches=(*electrode.patches, Patch(centre, diameter))))

    return setup.with_specimens(spotted, which)


@effect("The electrodes add stiffness of their own, without stress in the flat mounted film.",
        finding="The electrodes stiffen the film by a modulus of {mu_e}",
        check="wipe the electrodes off one specimen and read its deflections without voltage "
              "again")
def electrode_stiffness(setup: Setup, mu_e: Annotated[float, EffectParameter(
        "neo-Hookean modulus per virgin volume, without stress when mounted", "kPa",
        width=1e3, low=0.0, high=1e7, reason=(
            "dried grease of 20 kPa, 25 µm on both sides of a virgin film of 1 mm, is 1 kPa; no "
            "source"))]) -> Setup:
    return setup.with_specimens(
        lambda specimen: with_change(specimen, ("electrode", "stiffness"), mu_e))


def _offset(axis: str) -> EffectParameter:
    return EffectParameter(
        f"offset along {axis}", "mm", width=1e-3, low=-1.0, high=1.0, even=True,
        reason="a plate placed by eye on marks or in a loose jig; no source")


@effect("The plates were glued off the centre of their frames, and may tilt.",
        finding="The plates sit off the centres of their frames, {dx} along x and {dy} along y",
        check="measure the gaps between plate and frame on all four sides with a calliper")
def plate_eccentricity(setup: Setup, dx: Annotated[float, _offset("x")],
                       dy: Annotated[float, _offset("y")]) -> Setup:
    def change(specimen: Specimen) -> Specimen:
        x, y = specimen.needed_plate().offset
        return replace(specimen, plate=replace(specimen.needed_plate(), offset=(x + dx, y + dy)))

    return setup.with_specimens(change)


@effect("Every load is heavier (or lighter) by the same mass than its label says: a plate, hook or "
        "lead was not weighed.",
        finding="Every load is {m_0} {m_0:heavier/lighter} than its label",
        check="weigh plate, screw, hook and lead, and every load, on one balance")
def unaccounted_mass(setup: Setup, m_0: Annotated[float, EffectParameter(
        "every load is m + m_0", "g", width=1e-3, low=-10.0, high=10.0, reason=(
            "plate, screw, hook and glue weigh 0.5 to 3 g and leads carry some of it; no "
            "source"))]) -> Setup:
    return setup.with_rig(unaccounted_mass=setup.rig.unaccounted_mass + m_0)


@effect("A lead, a guide or a touching probe holds the plate like a spring.",
        finding="Something holds the plate back like a spring of {k}",
        check="take away what touches the plate (lead, guide, probe) and read one state again")
def parallel_spring(setup: Setup, k: Annotated[float, EffectParameter(
        "stiffness against the deflection", "N/m", width=5.0, low=0.0, high=1e6,
        reason="a copper lead of 0.3 mm and 30 mm, built in at one end: 3 E I/L^3 = 5 N/m"
        )]) -> Setup:
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
    small, large = sorted((U_s, setup.rig.sag_voltage))  # 1/U_s² add up
    both = small if isinf(large) else small / sqrt(1 + (small / large) ** 2)
    return setup.with_rig(sag_voltage=both)


# One play operator between turns of the voltage; Zou and Gu (Polymers 10, 2018, 525; abstract read)
# fit actuators of this kind with a sum of such operators.
@effect("The film follows the voltage late: on the way up it stands where a lower voltage would "
        "hold it, on the way down where a higher one would.",
        finding="The film follows the voltage late, by {H} on the way up and on the way down",
        check="stop at one voltage on the way up for ten minutes and see whether the reading "
              "still moves",
        columns=("direction",))
def hysteresis(setup: Setup, H: Annotated[float, EffectParameter(
        "the film responds as to U - H (at least 0) on the way up, to U + H on the way down", "kV",
        width=0.1e3, low=0.0, high=1e6, reason=(
            "a film with a share g of its response delayed by τ lags a slow ramp by g τ dU/dt: "
            "with 0.1, 100 s and 10 V/s, 5 kV in 8 min, 0.1 kV; no source"))]) -> Setup:
    return setup.with_rig(lag_voltage=setup.rig.lag_voltage + H)


@effect("The plate rubs on a guide or a probe: it stays where it is until the force that is "
        "missing is larger than the friction, and comes to rest short of where it would go.",
        finding="The plate rubs: it moves only where more than {F} is missing",
        check="tap the stand lightly at one voltage on the way up and see whether the reading "
              "moves on, and look where guide, probe or leads touch the plate")
def friction(setup: Setup, F: Annotated[float, EffectParameter(
        "force against the way the plate came, on the way down first", "mN", width=5e-3, low=0.0,
        high=10.0, reason=(
            "a guide or probe pressed against the plate by a tenth of a load of 0.2 N, with a "
            "coefficient of friction of 0.2, rubs with 4 mN; no source"))]) -> Setup:
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
    return setup.with_rig(sensor_gain=_compounded(setup.rig.sensor_gain, k))


@effect("All readings are shifted by the same length: the sensor was not zero at the flat film.",
        finding="Every reading is {y_0} too {y_0:large/small}: the sensor was not zero at the "
                "flat film",
        check="read the sensor with the film flat and unloaded")
def sensor_zero(setup: Setup, y_0: Annotated[float, EffectParameter(
        "readings are y + y_0", "um", width=50e-6, low=-1.0, high=1.0,
        reason="the zero is set by hand on a plate that is not yet loaded; no source")]) -> Setup:
    return setup.with_rig(sensor_zero=setup.rig.sensor_zero + y_0)


@effect("Readings wander in proportion to the time since the run began: sensor and stand warm up.",
        finding="Readings {rate:rise/fall} by {rate} as time goes by",
        check="read the first state once more at the end of the run",
        columns=("elapsed_s",))
def drift(setup: Setup, rate: Annotated[float, EffectParameter(
        "readings are y + rate · elapsed time", "um/min", width=1e-7 / 60, low=-1e-2 / 60,
        high=1e-2 / 60, reason=(
            "temperature drift of laser sensors: 0.03 %/°C of a range of 20 mm is 6 µm/°C (example "
            "of Omron's technical guide to displacement sensors), in a room that changes by 1 °C "
            "an hour"))]) -> Setup:
    return setup.with_rig(drift=setup.rig.drift + rate)


@effect("Part of the film's stress relaxes, so that the film creeps: a spring and a dashpot in "
        "series act beside the stated law.",
        finding="The film creeps: a part of its stiffness of {mu} relaxes within {tau}",
        check="hold one voltage for ten times as long and see whether the reading still moves",
        columns=(IN_TIME,))
def creep(setup: Setup, mu: Annotated[float, EffectParameter(
        "modulus of a viscous branch beside the law", "kPa", width=10e3, low=0.0, high=1e8, reason=(
            "VHB 4910 relaxes from about twice its modulus at rest, 15 kPa, within minutes; no "
            "source"))], tau: Annotated[float, EffectParameter(
                "time in which it relaxes", "s", width=10.0, low=1e-3, high=1e6, spread=log(10),
                reason="branches fitted to VHB 4910 have times of 0.1 to 1000 s")]) -> Setup:
    if not mu:
        return setup
    return setup.with_films(
        lambda film: replace(film, branches=(*film.branches, ViscousBranch(mu, tau))))


@effect("The films were stretched not for ever ago: their branches still relax.",
        finding="The films had been stretched for {t} only, and still relax",
        check="read the same state again a day later", columns=(IN_TIME,))
def mounting_age(setup: Setup, t: Annotated[float, EffectParameter(
        "time since the film was stretched; infinite where it is relaxed", "h", width=24 * 3600.0,
        low=3.6, high=inf, power=-1, reason="films are measured on the day after they are made, or "
        "later; no source")]) -> Setup:
    def change(film: Film) -> Film:
        if isinf(t) or not film.branches:
            return film
        return replace(film, mounted=t if film.mounted is None else 1 / (1 / t + 1 / film.mounted))

    return setup.with_films(change)


@effect("Something damps the plate's motion: air in a gap, a guide with grease, a touching lead.",
        finding="The plate is damped by {c}",
        check="let the plate swing in the open and count how many swings it takes to fade",
        columns=(IN_TIME,))
def plate_damping(setup: Setup, c: Annotated[float, EffectParameter(
        "force on the plate over its speed", "N s/m", width=0.05, low=0.0, high=1e4, reason=(
            "a plate of 20 g on 80 N/m that fades within ten swings has 2 % of the critical "
            "damping of 2.5 N s/m"))]) -> Setup:
    return setup.with_rig(plate_damping=setup.rig.plate_damping + c)


@effect("The film charges through a resistance of supply, leads and electrodes, and so follows a "
        "voltage late.",
        finding="The film charges through {R}",
        check="measure the voltage on the film with a high-voltage probe just after it is switched",
        columns=(IN_TIME,))
def series_resistance(setup: Setup, R: Annotated[float, EffectParameter(
        "through which the film charges", "MOhm", width=10e6, low=0.0, high=1e15, reason=(
            "high-voltage supplies protect their users by 1 to 100 MOhm; no source"))]) -> Setup:
    return setup.with_rig(series_resistance=setup.rig.series_resistance + R)


@effect("The displacement sensor follows late, as its filter does.",
        finding="The sensor follows late, by {t_s}",
        check="look up the sensor's averaging, or tap the stand and compare with a faster one",
        columns=(IN_TIME,))
def sensor_lag(setup: Setup, t_s: Annotated[float, EffectParameter(
        "time in which the sensor follows, by a factor e", "ms", width=5e-3, low=0.0, high=1e4,
        reason="averages of 16 to 256 samples at 10 kHz; no source")]) -> Setup:
    return setup.with_rig(sensor_lag=setup.rig.sensor_lag + t_s)


@effect("The electrodes' mass swings and weighs with the film.",
        finding="The electrodes have a mass of {rho} of the mounted film, both sides together",
        check="weigh one specimen before and after its electrodes are wiped off")
def electrode_mass(setup: Setup, rho: Annotated[float, EffectParameter(
        "mass of both electrodes per mounted area", "g/m^2", width=0.05, low=0.0, high=100.0,
        reason="25 µm of carbon grease of 1 g/cm³ on both sides; no source")]) -> Setup:
    return setup.with_specimens(lambda specimen: replace(specimen, electrode=replace(
        specimen.electrode, mass=specimen.electrode.mass + rho)))


@effect("Something moves with the plate that does not weigh on it: a lead, a counterweight, a "
        "guide.",
        finding="A mass of {m_a} moves with the plate and does not weigh on it",
        check="look for what moves with the plate but hangs or stands elsewhere, and measure a "
              "frequency without it",
        columns=("frequency_Hz",))
def added_mass(setup: Setup, m_a: Annotated[float, EffectParameter(
        "inertia without weight", "g", width=1e-3, low=0.0, high=10.0, reason=(
            "a third of a copper lead of 0.5 mm² and 30 cm moves with its end: 0.4 g; a linear "
            "guide's slide weighs grams; no source"))]) -> Setup:
    return setup.with_rig(added_mass=setup.rig.added_mass + m_a)


@effect("The air on both sides swings with film and plate.",
        finding="The gas on both sides swings with the film as one of {rho_a} behind a baffle",
        check="measure a frequency in a partial vacuum, or with a board held close to the film, "
              "which makes it lower",
        columns=("frequency_Hz",))
def air_mass(setup: Setup, rho_a: Annotated[float, EffectParameter(
        "density of the air that film and plate move on both sides, frame and stand for a baffle",
        "kg/m^3", width=1.2, low=0.0, high=1000.0, reason=(
            "air of 20 °C and 1 bar: 8/3 ρ r³ on each side of a piston in a baffle (Rayleigh, "
            "The Theory of Sound II, 1896, § 302), half of it on a free disc"))]) -> Setup:
    return setup.with_rig(air=setup.rig.air + rho_a)


@effect("The film is stiffer or softer at another temperature, law and branches alike.",
        finding="The film gets {p:stiffer/softer} as it gets warmer, by {p} a degree about room "
                "temperature",
        check="stretch two strips of the same film at two temperatures and compare their curves",
        columns=(WARMTH,))
def temperature(setup: Setup, p: Annotated[float, EffectParameter(
        "power of the absolute temperature with which stiffness grows", "", width=1.0, low=-50.0,
        high=50.0, reason=(
            "entropy elasticity has p = 1, a modulus N k T (Treloar, The Physics of Rubber "
            "Elasticity, 3rd ed., 1975); a tape that relaxes faster in the warmth has p below 0"),
        told_in="%", tell=lambda p: (1 + 1 / 293.15) ** p - 1)]) -> Setup:
    return setup.with_films(
        lambda film: replace(film, temperature_power=film.temperature_power + p))


def _shared(first: float, second: float) -> float:
    return 1 - (1 - first) * (1 - second)


@effect("The grips hold the width of strips that are said to be free to narrow.",
        finding="The strips are held in their width, {w} of the way from a uniaxial test to pure "
                "shear",
        check="measure the width of a stretched strip half-way between the grips",
        columns=(OF_STRIPS,))
def width_not_free(setup: Setup, w: Annotated[float, EffectParameter(
        "share of the logarithm of the width that the grips hold", "", width=0.1, low=0.0, high=1.0,
        reason=("grips hold a strip's ends over about half its width: a tenth of one that is five "
                "times as long as wide; no source"), told_in="%")]) -> Setup:
    return setup.with_rig(width_held=_shared(setup.rig.width_held, w))


@effect("Strips narrow that are said to be held in their width, as in pure shear.",
        finding="The strips narrow, {w} of the way from pure shear to a uniaxial test",
        check="measure the width of a stretched strip half-way between the grips",
        columns=(OF_STRIPS,))
def width_not_held(setup: Setup, w: Annotated[float, EffectParameter(
        "share of a uniaxial strip's logarithm of the width by which they narrow", "", width=0.1,
        low=0.0, high=1.0, reason=(
            "the free edges of a sheet narrow over about half its length: a tenth of one that is "
            "five times as wide as long; no source"), told_in="%")]) -> Setup:
    return setup.with_rig(width_let=_shared(setup.rig.width_let, w))


@effect("The film between plate and frame is not the lumped model's straight cone but hollow, "
        "steepest at the plate.",
        finding="The film is hollow: {c} of the way from the lumped model's straight cone to a "
                "membrane",
        check="photograph the film from the side and lay a ruler on it from plate to frame",
        lumped=True)
def cone_kinematics(setup: Setup, c: Annotated[float, EffectParameter(
        "film from the straight cone (0) to a weightless membrane hardly deflected (1)", "",
        width=1.0, low=0.0, high=1.5, reason=(
            "equilibrium of a flat tense film makes it 1, bending stiffness would make it less: "
            "nothing between 0 and 1 is favoured much, and room beyond 1 lets data contradict "
            "both; no source"), told_in="%")]) -> Setup:
    def change(specimen: Specimen) -> Specimen:
        if not isinstance(specimen, Lumped):
            raise InputError("is an effect on the lumped model", key="cone_kinematics",
                             given=specimen.name)
        return replace(specimen, profile=specimen.profile + c)

    return setup.with_specimens(change)
