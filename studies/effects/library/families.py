"""Families of effects that readings at rest cannot distinguish, each with a common name."""

from __future__ import annotations

from math import exp, log

import numpy as np

from tympan.fem.rig import Rig
from tympan.geometry.sectors import covered_share
from tympan.geometry.specimen import Specimen
from tympan.studies.effects.effect import EffectFamily, EffectParameter, Observable

#: A band, spots or a sector without field: readings of plates alone cannot distinguish them.
#: Missing quadrants of 12 to 40 % of three shapes, and spots of 30 mm at their frames, have the
#: readings of bands with 0.8 to 1.3 times their area. On the paper's three actuators sectors of 6
#: to 33 % have those of bands with 0.8 to 1.1 of their area. On three round films the fitted
#: permittivity takes up more of a sector: the rest equals a band of 0.4 to 0.7 of its area, except
#: for a fifth to a half of χ². There limits are too low.
BARE_FILM = EffectFamily(
    "bare_film", "The electrodes cover less of the film than stated: {share} less",
    check="look through the films against a light, or photograph them: the electrode may end short "
          "of the frame, or miss a sector or spots; a line scan over the film tells it too",
    measure=EffectParameter(
        "share of the film that electrodes leave bare beyond what is stated", "", width=0.1,
        low=0.0, high=1.0, reason="that of its members", told_in="%"),
    of=lambda specimen, rig: 1 - covered_share(specimen), alike=(0.75, 1.25),
    told_by=(Observable.SHAPE,))


def _carried(specimen: Specimen, rig: Rig) -> float:
    """Sum the mass beyond the labels that pulls on the film at its plate, as its weight would [kg].

    The plate lifts a part of the electrodes: where a round film of the same areas deflects as the
    logarithm of the distance, it is 1/ln k − 1/(k − 1) of them, k the frame's area over the
    plate's. A film without plate carries all of them.
    """
    if specimen.plate is None:
        return specimen.electrode.mass * float(np.real(specimen.frame.curve.area))
    plate, frame = (float(np.real(part.curve.area))
                    for part in (specimen.plate.outline, specimen.frame))
    lifted = (frame - plate) * (1 / log(frame / plate) - 1 / (frame / plate - 1))
    return (rig.unaccounted_mass + specimen.electrode.mass * lifted
            - rig.friction / rig.gravity)


#: A load with another mass than its label, electrodes with weight, a plate with friction: on one
#: film, or with voltages that only rise, their readings agree to within 0.01 in χ² of 20.
#: Equivalent masses are equal; those of electrodes on a round film, and 0.92 times on an ellipse of
#: 7.5 by 4.5 cm.
CARRIED_LOAD = EffectFamily(
    "carried_load", "The film carries {share} {size:more/less} than the labels of its loads say",
    check="weigh plate, hook, lead and every load on one balance, and a film before and after its "
          "electrodes are brushed on; look whether guide, probe or leads rub the plate, and read "
          "one state with falling voltage",
    measure=EffectParameter("mass that the film carries beyond the labels", "g", width=1e-3,
                            low=-10.0, high=10.0, reason="that of its members"),
    of=_carried, alike=(0.9, 1.1))


def _stiffening(specimen: Specimen, rig: Rig) -> float:
    """Compute the relative growth of a mounted film's tension along x, with electrodes."""
    film = specimen.membrane
    x, y = np.array(film.prestretch)
    _, slope, _, bend, *_ = film.material.derivatives(x, y)
    # A neo-Hookean layer that is unstressed there has four times its modulus along one axis.
    return float(np.real((bend * x + 4 * specimen.electrode.stiffness / x) / slope))


#: A law that hardens, electrodes that are stiff: their readings agree to within 0.5 in χ² of 10 up
#: to 30 kPa, ten typical exponents, on three films. Their contribution to the tension of a mounted
#: film then differs by a factor of 0.86 to 1.63, for the law continues to harden.
STIFFER_FILM = EffectFamily(
    "stiffer_film", "The film's tension grows {size:more/less} with stretch than stated, by "
                    "{share} for a tenth more along one axis",
    check="wipe the electrodes off one specimen and read its deflections without voltage again; "
          "stretch a strip of the same film beyond its mounted stretch and compare its curve with "
          "the stated law",
    measure=EffectParameter(
        "growth of the mounted film's tension with stretch along one axis, beyond what is stated",
        "", width=0.2, low=-10.0, high=1e3, reason="that of its members", told_in="%",
        tell=lambda growth: 0.1 * growth),
    of=_stiffening, alike=(0.6, 1.7))


def _unmoved(specimen: Specimen, rig: Rig) -> float:
    """Compute the logarithm of a mounted film's tension over the part of it that 1 V takes away.

    That part is ε₀ε_r over the mounted thickness, times the share that electrodes cover.
    """
    film = specimen.membrane
    x, y = np.array(film.prestretch)
    _, along_x, along_y, *_ = film.material.derivatives(x, y)
    # Tension is a force over a mounted length, the mean of both axes.
    tension = film.thickness * (along_x / y + along_y / x) / 2
    taken = film.relative_permittivity * covered_share(specimen) / (film.thickness / (x * y))
    return float(np.log(np.real(tension / taken)))


#: A film that slipped in its frame, or whose electrode has holes or misses a sector: the voltage
#: acts less on this specimen than on the others. On three shapes and three round films a slip
#: explains 97 % of the χ² of a permittivity lower by 5 to 10 %, with 0.9 to 1 times its measure,
#: and 94 % of that of sectors of 15° and 45°, with 1.05 to 1.5 times. A thicker film also deflects
#: less without voltage: for one thicker by 3 % a slip explains 70 %.
LESS_MOVED = EffectFamily(
    "less_moved", "A voltage takes {share} less tension from the film of {which} than it should: "
                  "this film slipped in its frame, or has less electrode than stated",
    check="of {which}: look for slip where the film is clamped, and measure the marks drawn on it "
          "before stretching; measure its thickness; look through it against a light: the "
          "electrode may have holes or miss a part of it",
    measure=EffectParameter(
        "share of the tension taken by a voltage that is missing in one film", "", width=0.05,
        low=-10.0, high=10.0, reason="that of its members", told_in="%",
        tell=lambda unmoved: 1 - exp(-unmoved)),
    of=_unmoved, alike=(0.9, 1.5), never_told=True)
