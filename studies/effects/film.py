"""Effects in the film and its electrodes."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np

from tympan.fem.film.laws import Stiffened
from tympan.fem.film.laws.invariants import first_invariant
from tympan.geometry.specimen import Film, Specimen
from tympan.studies.effects.effect import EffectParameter, Setup, effect


@effect("The film hardens with stretch more (h > 0) or less than the nominal law, with the same "
        "stress when mounted.")
def strain_stiffening(setup: Setup, h: Annotated[float, EffectParameter(
        "power of the first invariant by which the slope of the energy grows", "",
        width=0.2, low=-0.8, high=2.0, sign="signed", reason=(
            "Gent's law with J_lim has h = I_m/(J_lim + 3 - I_m) about the mounted I_m = 10: 0.1 "
            "for the 110 of the library's VHB 4910, 0.3 for 40, against 0 for neo-Hooke: sources "
            "on one tape differ so"))]) -> Setup:
    """Every material wrapped; the stress at its film's own flat state stays."""
    def change(film: Film) -> Film:
        mounted = float(np.real(first_invariant(*film.prestretch)[0])) + 3
        return replace(film, material=Stiffened(film.material, h, mounted))

    return setup.with_films(change)


@effect("The permittivity of the film falls (n > 0) or rises as its area grows beyond the mounted "
        "one.")
def permittivity_stretch(setup: Setup, n: Annotated[float, EffectParameter(
        "exponent of ε_r (J/J_p)^(-n)", "", width=0.15, low=-1.0, high=1.0, sign="signed", reason=(
            "VHB 4910: ε_r 4.7 unstretched and 2.6 at a stretch of 5 (Wissler, Mazza, Sens. "
            "Actuators A 138, 2007, as commonly quoted, not read again) make n = "
            "ln(4.7/2.6)/ln(25) = 0.18; others find no dependence"))]) -> Setup:
    """Every film's exponent raised by n."""
    return setup.with_films(
        lambda film: replace(film, permittivity_exponent=film.permittivity_exponent + n))


@effect("All films were stretched a little more along one axis of the frame than along the other, "
        "at the same area.")
def prestretch_anisotropy(setup: Setup, a: Annotated[float, EffectParameter(
        "stretch λ(1+a) along x and λ/(1+a) along y", "", width=0.02, low=-0.1, high=0.1,
        sign="signed",
        reason="a grid drawn on the film and read with a ruler, 1 mm in 50 mm; no "
               "source")]) -> Setup:
    """λ(1+a) along x, λ/(1+a) along y."""
    def change(film: Film) -> Film:
        x, y = film.prestretch
        return replace(film, prestretch=(x * (1 + a), y / (1 + a)))

    return setup.with_films(change)


@effect("The film of one specimen slipped in its frame or was stretched less than the others.")
def prestretch_loss(setup: Setup, delta: Annotated[float, EffectParameter(
        "the specimen's stretches are λ(1-delta)", "", width=0.02, low=0.0, high=0.15,
        sign="positive", reason=(
            "film slipping by 1 mm under a clamp of a 45 mm frame loses 2 % of its stretch; no "
            "source"))], which: str) -> Setup:
    """λ(1−δ) of one specimen."""
    def change(film: Film) -> Film:
        x, y = film.prestretch
        return replace(film, prestretch=(x * (1 - delta), y * (1 - delta)))

    return setup.with_films(change, which)


@effect("The electrode does not reach the frame: an uncovered band along it carries no field.")
def electrode_margin(setup: Setup, d: Annotated[float, EffectParameter(
        "width of the uncovered band along the frame", "mm", width=2e-3, low=0.0, high=10e-3,
        sign="positive", least=0.5e-3, reason=(
            "grease is brushed by hand and kept clear of a frame against flashover, about 1 mm per "
            "few kV; no source. A specimen can have a band from 1 % of the gap between plate and "
            "frame on"))]) -> Setup:
    """The uncovered band along the frame widened by d."""
    def change(specimen: Specimen) -> Specimen:
        margin = specimen.electrode.margin_frame + d
        return replace(specimen, electrode=replace(specimen.electrode, margin_frame=margin))

    return setup.with_specimens(change)


@effect("The electrodes add stiffness of their own, without stress in the flat mounted film.")
def electrode_stiffness(setup: Setup, mu_e: Annotated[float, EffectParameter(
        "neo-Hookean modulus per virgin volume, without stress when mounted", "kPa",
        width=1e3, low=0.0, high=10e3, sign="positive", reason=(
            "dried grease of 20 kPa, 25 µm on both sides of a virgin film of 1 mm, is 1 kPa; no "
            "source"))]) -> Setup:
    """μ_e added to every electrode."""
    def change(specimen: Specimen) -> Specimen:
        stiffness = specimen.electrode.stiffness + mu_e
        return replace(specimen, electrode=replace(specimen.electrode, stiffness=stiffness))

    return setup.with_specimens(change)
