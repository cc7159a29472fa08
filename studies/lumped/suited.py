"""The lumped model of a specimen for the loads at hand, built where it is asked for and kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies import alpha
from tympan.studies.case import Settings
from tympan.studies.diagnosis.reduced.cache import digest, keep, kept
from tympan.studies.lumped import build as building
from tympan.studies.lumped.build import BuildSettings, build
from tympan.studies.lumped.model_file import LumpedModel

_CIRCLES = 2  # of any frame, as ``tympan lumped build`` has them
#: Stiffness, permittivity, flat capacitance, then radii and weights, nan where there is no circle.
_SHAPE = (3 + 2 * _CIRCLES,)


def suited_model(specimen: Specimen, mass: float, voltage: float, settings: Settings,
                 rig: Rig = Rig(), progress: Callable[[str], None] = lambda _: None
                 ) -> LumpedModel:
    """What ``tympan lumped build`` makes of a specimen under a mass [kg], 0 to a voltage [V].

    Its viscous constants are those of :class:`tympan.studies.lumped.actuator.Viscous`. It is kept
    with the films of diagnoses, so that the next one takes no time.

    Raises
    ------
    InputError
        When the field model has no equilibrium up to the voltage, or the rig is none of a lumped
        model's.
    """
    voltages = (0.0, voltage / 2, voltage) if voltage > 0 else (0.0,)
    chosen = BuildSettings((mass,), voltages, _CIRCLES)
    key = digest("lumped model", specimen, settings, rig, mass, voltage, *_sources())
    numbers = kept(key, _SHAPE)
    if numbers is None:
        model = build(specimen, settings, chosen, rig, progress).model
        missing = [np.nan] * (_CIRCLES - len(model.radii))
        keep(key, np.array([model.stiffness, model.permittivity, model.flat_capacitance,
                            *model.radii, *missing, *model.weights, *missing]))
        return model
    stiffness, permittivity, flat = numbers[:3].tolist()
    radii, weights = (tuple(part[~np.isnan(part)].tolist())
                      for part in np.split(numbers[3:], [_CIRCLES]))
    return LumpedModel(specimen, radii, weights, flat, rig.film_voltage(voltages[-1]), stiffness,
                       permittivity)


def _sources() -> list[str]:
    """What decides a model beside the solvers, which the key has already."""
    files = [Path(building.__file__), *sorted(Path(alpha.__file__).parent.glob("*.py"))]
    return [file.read_text(encoding="utf-8") for file in files]
