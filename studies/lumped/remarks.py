"""Remarks with any result of a lumped model: the origin of its constants."""

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
    """Fill a sentence of remarks.toml with its numbers."""
    return _WORDS[key].format(**values)


def origin(actuator: Actuator) -> list[str]:
    """Word the origin of what is not the film's own: the paper's viscous constants and cones.

    The remarks also name branches of the film that the model leaves out.
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
    """Collect remarks on the masses [kg] and nominal voltages [V] of a specimen's readings."""
    return [f"{specimen.name}: {words}"
            for words in Case.greatest(specimen, masses, voltages, rig).remarks]


def is_cone(actuator: Actuator) -> bool:
    """Test whether an actuator's circles are the paper's cones."""
    return not isinstance(actuator.circles, MembraneCircle)


def softness(actuator: Actuator) -> str:
    """Word the ratio of the stiffness of membranes to that of their cones."""
    circles = MembraneCircle(actuator.specimen, actuator.circles.radius)
    factors = np.unique(np.round(circles.membrane_factor, 2))
    return " to ".join(f"{factor:g}" for factor in (factors.min(), factors.max())[:len(factors)])
