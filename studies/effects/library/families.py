"""Families of effects that readings at rest do not tell apart, each with one name for them all."""

from __future__ import annotations

from math import log

import numpy as np

from tympan.fem.rig import Rig
from tympan.geometry.sectors import covered_share
from tympan.geometry.specimen import Specimen
from tympan.studies.effects.effect import EffectParameter, Family, Quantity

#: A band, spots or a sector without field: plates alone do not tell one from another. Missing
#: quadrants of 12 to 40 % of three shapes, and spots of 30 mm at their frames, do as much as bands
#: whose area is 0.8 to 1.3 times theirs.
#: Of the paper's three actuators sectors of 6 to 33 % do as much as bands of 0.8 to 1.1 of their
#: area. Of three round films the fitted permittivity takes up more of a sector: what is left of it
#: a band of 0.4 to 0.7 of its area does, but for a fifth to a half of χ². There limits are too low.
BARE_FILM = Family(
    "bare_film", "The electrodes cover less of the film than stated: {share} less",
    check="look through the films against a light, or photograph them: the electrode may end short "
          "of the frame, or miss a sector or spots; a line scan over the film tells it too",
    measure=EffectParameter(
        "share of the film that electrodes leave bare beyond what is stated", "", width=0.1,
        low=0.0, high=1.0, reason="that of its members", told_in="%"),
    of=lambda specimen, rig: 1 - covered_share(specimen), alike=(0.75, 1.25),
    told_by=(Quantity.SHAPE,))


def _carried(specimen: Specimen, rig: Rig) -> float:
    """Mass beyond the labels that pulls on the film at its plate, as its weight would [kg].

    Of the electrodes what the plate lifts: where a round film of the same areas deflects as the
    logarithm of the distance, 1/ln k − 1/(k − 1) of them, k the frame's area over the plate's.
    """
    plate, frame = (float(np.real(part.curve.area))
                    for part in (specimen.needed_plate().outline, specimen.frame))
    lifted = (frame - plate) * (1 / log(frame / plate) - 1 / (frame / plate - 1))
    return (rig.unaccounted_mass + specimen.electrode.mass * lifted
            - rig.friction / rig.gravity)


#: A load with another mass than its label, electrodes that weigh, a plate that rubs: on one film,
#: or with voltages that only rise, the same readings to within 0.01 in χ² of 20. Masses that do as
#: much are equal; of electrodes on a round film, on an ellipse of 7.5 by 4.5 cm 0.92 times.
CARRIED_LOAD = Family(
    "carried_load", "The film carries {share} {size:more/less} than the labels of its loads say",
    check="weigh plate, hook, lead and every load on one balance, and a film before and after its "
          "electrodes are brushed on; look whether guide, probe or leads rub the plate, and read "
          "one state with falling voltage",
    measure=EffectParameter("mass that the film carries beyond the labels", "g", width=1e-3,
                            low=-10.0, high=10.0, reason="that of its members"),
    of=_carried, alike=(0.9, 1.1))


def _stiffening(specimen: Specimen, rig: Rig) -> float:
    """Relative growth of a mounted film's tension with its stretch along x, electrodes and all."""
    film = specimen.membrane
    x, y = np.array(film.prestretch)
    _, slope, _, bend, *_ = film.material.derivatives(x, y)
    # A neo-Hookean layer that is unstressed there has four times its modulus along one axis.
    return float(np.real((bend * x + 4 * specimen.electrode.stiffness / x) / slope))


#: A law that hardens, electrodes that are stiff: to within 0.5 in χ² of 10 up to 30 kPa, ten usual
#: exponents, on three films. What they add to the tension of a mounted film is then 0.86 to 1.63
#: times as much, for the law hardens on.
STIFFER_FILM = Family(
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
