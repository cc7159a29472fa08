"""Effects that take time: memory, damping, lag, moving masses."""

from __future__ import annotations

from dataclasses import replace
from math import inf, isinf, log
from typing import Annotated

from tympan.geometry.specimen import Film, ViscousBranch
from tympan.studies.effects.effect import EffectParameter, Observable, Setup, effect
from tympan.studies.effects.library.families import CARRIED_LOAD


@effect("Part of the film's stress relaxes, so that the film creeps: a spring and a dashpot in "
        "series act beside the stated law.",
        finding="The film creeps: a part of its stiffness of {mu} relaxes within {tau}",
        check="hold one voltage for ten times as long and see whether the reading still moves",
        shows_in=(Observable.TIME,), twice=True)
def creep(setup: Setup, mu: Annotated[float, EffectParameter(
        "modulus of a viscous branch beside the law", "kPa", width=10e3, low=0.0, high=1e8, reason=(
            "VHB 4910 relaxes from about twice its modulus at rest, 15 kPa, within minutes; no "
            "source"))], tau: Annotated[float, EffectParameter(
                "time in which it relaxes", "s", width=10.0, low=1e-3, high=1e6, spread=log(10),
                reason="branches fitted to VHB 4910 have times of 0.1 to 1000 s")]) -> Setup:
    """Add a viscous branch to all films."""
    if not mu:
        return setup
    return setup.with_films(
        lambda film: replace(film, branches=(*film.branches, ViscousBranch(mu, tau))))


@effect("The films were stretched not for ever ago: their branches still relax.",
        finding="The films had been stretched for {t} only, and still relax",
        check="read the same state again a day later", shows_in=(Observable.TIME,))
def mounting_age(setup: Setup, t: Annotated[float, EffectParameter(
        "time since the film was stretched; infinite where it is relaxed", "h", width=24 * 3600.0,
        low=3.6, high=inf, power=-1, reason="films are measured on the day after they are made, or "
        "later; no source")]) -> Setup:
    """Set the time since the films were stretched, if they have branches."""
    def change(film: Film) -> Film:
        if isinf(t) or not film.branches:
            return film
        return replace(film, mounted=t if film.mounted is None else 1 / (1 / t + 1 / film.mounted))

    return setup.with_films(change)


@effect("Something damps the plate's motion: air in a gap, a guide with grease, a touching lead.",
        finding="The plate is damped by {c}",
        check="let the plate swing in the open and count how many swings it takes to fade",
        shows_in=(Observable.TIME,))
def plate_damping(setup: Setup, c: Annotated[float, EffectParameter(
        "force on the plate over its speed", "N s/m", width=0.05, low=0.0, high=1e4, reason=(
            "a plate of 20 g on 80 N/m that fades within ten swings has 2 % of the critical "
            "damping of 2.5 N s/m"))]) -> Setup:
    """Damp the plate's motion."""
    return setup.with_rig(plate_damping=setup.rig.plate_damping + c)


@effect("The film charges through a resistance of supply, leads and electrodes, and so follows a "
        "voltage late.",
        finding="The film charges through {R}",
        check="measure the voltage on the film with a high-voltage probe just after it is switched",
        shows_in=(Observable.TIME,))
def series_resistance(setup: Setup, R: Annotated[float, EffectParameter(
        "through which the film charges", "MOhm", width=10e6, low=0.0, high=1e15, reason=(
            "high-voltage supplies protect their users by 1 to 100 MOhm; no source"))]) -> Setup:
    """Add a resistance through which the film charges."""
    return setup.with_rig(series_resistance=setup.rig.series_resistance + R)


@effect("The displacement sensor follows late, as its filter does.",
        finding="The sensor follows late, by {t_s}",
        check="look up the sensor's averaging, or tap the stand and compare with a faster one",
        shows_in=(Observable.TIME,))
def sensor_lag(setup: Setup, t_s: Annotated[float, EffectParameter(
        "time in which the sensor follows, by a factor e", "ms", width=5e-3, low=0.0, high=1e4,
        reason="averages of 16 to 256 samples at 10 kHz; no source")]) -> Setup:
    """Delay the sensor by a time constant."""
    return setup.with_rig(sensor_lag=setup.rig.sensor_lag + t_s)


@effect("The electrodes' mass swings and weighs with the film.",
        finding="The electrodes have a mass of {rho} of the mounted film, both sides together",
        check="weigh one specimen before and after its electrodes are wiped off",
        family=CARRIED_LOAD)
def electrode_mass(setup: Setup, rho: Annotated[float, EffectParameter(
        "mass of both electrodes per mounted area", "g/m^2", width=0.05, low=0.0, high=100.0,
        reason="25 µm of carbon grease of 1 g/cm³ on both sides; no source")]) -> Setup:
    """Add mass to the electrodes."""
    return setup.with_specimens(lambda specimen: replace(specimen, electrode=replace(
        specimen.electrode, mass=specimen.electrode.mass + rho)))


@effect("Something moves with the plate that does not weigh on it: a lead, a counterweight, a "
        "guide.",
        finding="A mass of {m_a} moves with the plate and does not weigh on it",
        check="look for what moves with the plate but hangs or stands elsewhere, and measure a "
              "frequency without it",
        shows_in=(Observable.FREQUENCY,))
def added_mass(setup: Setup, m_a: Annotated[float, EffectParameter(
        "inertia without weight", "g", width=1e-3, low=0.0, high=10.0, reason=(
            "a third of a copper lead of 0.5 mm² and 30 cm moves with its end: 0.4 g; a linear "
            "guide's slide weighs grams; no source"))]) -> Setup:
    """Add inertia without weight to the plate."""
    return setup.with_rig(added_mass=setup.rig.added_mass + m_a)


@effect("The air on both sides swings with film and plate.",
        finding="The gas on both sides swings with the film as one of {rho_a} behind a baffle",
        check="measure a frequency in a partial vacuum, or with a board held close to the film, "
              "which makes it lower",
        shows_in=(Observable.FREQUENCY,))
def air_mass(setup: Setup, rho_a: Annotated[float, EffectParameter(
        "density of the air that film and plate move on both sides, frame and stand for a baffle",
        "kg/m^3", width=1.2, low=0.0, high=1000.0, reason=(
            "air of 20 °C and 1 bar: 8/3 ρ r³ on each side of a piston in a baffle (Rayleigh, "
            "The Theory of Sound II, 1896, § 302), half of it on a free disc"))]) -> Setup:
    """Add air that moves with film and plate."""
    return setup.with_rig(air=setup.rig.air + rho_a)
