"""Effects of films and electrodes: material, prestretch, thickness, bare film."""

from __future__ import annotations

from dataclasses import replace
from math import log
from typing import Annotated

import numpy as np

from tympan.base.paths import with_change
from tympan.fem.film.laws import MooneyShare, Stiffened
from tympan.fem.film.laws.invariants import first_invariant
from tympan.geometry.specimen import NARROWEST, Film, Patch, Specimen
from tympan.studies.effects.effect import EffectParameter, Observable, Setup, effect
from tympan.studies.effects.library.families import BARE_FILM, LESS_MOVED, STIFFER_FILM


@effect("The film hardens with stretch more (h > 0) or less than the nominal law, with the same "
        "stress when mounted.",
        finding="The film hardens {h:more/less} with stretch than the stated law, by an exponent "
                "of {h}",
        check="stretch a strip of the same film beyond its mounted stretch and compare its curve "
              "with the stated law", family=STIFFER_FILM)
def strain_stiffening(setup: Setup, h: Annotated[float, EffectParameter(
        "power of the first invariant by which the slope of the energy grows", "",
        width=0.2, low=-0.95, high=8.0, reason=(
            "Gent's law with J_lim has h = I_m/(J_lim + 3 - I_m) about the mounted I_m = 10: 0.1 "
            "for the 110 of the library's VHB 4910, 0.3 for 40, against 0 for neo-Hooke: sources "
            "on one tape differ so"))]) -> Setup:
    """Harden the law of all films by an exponent about their mounted state."""
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
    """Replace a share of the stress of all films by Mooney's second invariant."""
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
    """Let the permittivity of all films fall with their area."""
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
    """Stretch all films more along x and less along y, at the same area."""
    def change(film: Film) -> Film:
        x, y = film.prestretch
        return replace(film, prestretch=(x * (1 + a), y / (1 + a)))

    return setup.with_films(change)


@effect("The film of one specimen slipped in its frame or was stretched less than the others.",
        finding="The film of {which} slipped: it is {delta} less stretched than stated",
        check="look for slip where the film of {which} is clamped, and measure the marks drawn on "
              "it before stretching; a thinner film, or an electrode that misses a part of it, "
              "does nearly the same: measure its thickness and look through it against a light",
        family=LESS_MOVED)
def prestretch_loss(setup: Setup, delta: Annotated[float, EffectParameter(
        "the specimen's stretches are λ(1-delta)", "", width=0.02, low=0.0, high=0.9, reason=(
            "film slipping by 1 mm under a clamp of a 45 mm frame loses 2 % of its stretch; no "
            "source"), told_in="%")], which: str) -> Setup:
    """Reduce the prestretch of one specimen along both axes."""
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
        shows_in=(Observable.SHAPE, Observable.SLOPE))
def thickness_gradient(setup: Setup, gx: Annotated[float, _uneven("x")],
                       gy: Annotated[float, _uneven("y")]) -> Setup:
    """Make all films thicker on one side of the frame."""
    def change(film: Film) -> Film:
        x, y = film.thickness_gradient
        return replace(film, thickness_gradient=(x + gx, y + gy))

    return setup.with_films(change)


@effect("The electrode does not reach the frame: an uncovered band along it carries no field.",
        finding="The electrodes end {d} short of the frame",
        check="measure with a ruler how far from the frame the electrodes end", family=BARE_FILM)
def electrode_margin(setup: Setup, d: Annotated[float, EffectParameter(
        "width of the uncovered band along the frame", "mm", width=2e-3, low=0.0, high=1.0,
        least=0.5e-3, reason=(
            "grease is brushed by hand and kept clear of a frame against flashover, about 1 mm per "
            "few kV; no source. A specimen can have a band from 1 % of the gap between plate and "
            "frame on"))]) -> Setup:
    """Leave a bare band along the frame of all specimens."""
    def banded(specimen: Specimen) -> Specimen:
        # A band too narrow to be built becomes none, or the narrowest, whichever is nearer.
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
        shows_in=(Observable.SHAPE,), family=BARE_FILM)
def electrode_patch(setup: Setup, dx: Annotated[float, _wide("x")],
                    dy: Annotated[float, _wide("y")], p: Annotated[float, EffectParameter(
                        "share of the way from plate to frame at which the spot is", "", width=0.5,
                        low=0.05, high=1.0, spread=log(1.5),
                        reason="between plate and frame no place is likelier than others",
                        told_in="%")], which: str) -> Setup:
    """Leave a bare spot between plate and frame of one specimen."""
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
              "again", family=STIFFER_FILM)
def electrode_stiffness(setup: Setup, mu_e: Annotated[float, EffectParameter(
        "neo-Hookean modulus per virgin volume, without stress when mounted", "kPa",
        width=1e3, low=0.0, high=1e7, reason=(
            "dried grease of 20 kPa, 25 µm on both sides of a virgin film of 1 mm, is 1 kPa; no "
            "source"))]) -> Setup:
    """Give the electrodes a stiffness of their own."""
    return setup.with_specimens(
        lambda specimen: with_change(specimen, ("electrode", "stiffness"), mu_e))
