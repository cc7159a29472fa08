"""Remarks with any result of a lumped model: where its constants are from."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case
from tympan.studies.circles import MembraneCircle
from tympan.studies.files import words_beside
from tympan.studies.lumped.actuator import Actuator

_WORDS = words_beside(__file__)


def remark(key: str, **values: object) -> str:
    """A sentence of remarks.toml with its numbers."""
    return _WORDS[key].format(**values)


def origin(actuator: Actuator) -> list[str]:
    """Origin of what is not the film's own: the paper's viscous constants, the paper's cones.

    And what of its film it leaves out.
    """
    remarks, viscous, specimen = [], actuator.viscous, actuator.specimen
    if viscous.borrowed:
        remarks.append(remark("viscous", k1=1e-6 * viscous.k1, eta1=1e-6 * viscous.eta1,
                              eta2=1e-3 * viscous.eta2))
    if specimen.membrane.branches:
        remarks.append(remark("branches", specimen=specimen.name))
    if is_cone(actuator):
        remarks.append(remark("cone", factors=softness(actuator)))
    return remarks


def of_loads(specimen: Specimen, masses: Iterable[float], voltages: Iterable[float], rig: Rig
             ) -> list[str]:
    """Remarks on the masses [kg] and nominal voltages [V] of a specimen's readings."""
    return [f"{specimen.name}: {words}"
            for words in Case.greatest(specimen, masses, voltages, rig).remarks]


def is_cone(actuator: Actuator) -> bool:
    """Whether its circles are the paper's cones."""
    return not isinstance(actuator.circles, MembraneCircle)


def softness(actuator: Actuator) -> str:
    """Ratio of the stiffness of membranes to that of their cones, in words."""
    circles = MembraneCircle(actuator.specimen, actuator.circles.radius)
    factors = np.unique(np.round(circles.membrane_factor, 2))
    return " to ".join(f"{factor:g}" for factor in (factors.min(), factors.max())[:len(factors)])
