"""The lumped model of a specimen for the loads at hand, built where it is asked for and kept."""

from __future__ import annotations

import json
from pathlib import Path

from tympan.base.progress import Progress
from tympan.fem.rig import Rig
from tympan.geometry.specimen import Specimen
from tympan.studies import alpha
from tympan.studies.case import Settings
from tympan.studies.kept.store import Store, digest
from tympan.studies.lumped import build as building
from tympan.studies.lumped.build import BuildSettings, build
from tympan.studies.lumped.model_file import LumpedModel

_STORE = Store("lumped", 1000)


def suited_model(specimen: Specimen, mass: float, voltage: float, settings: Settings,
                 rig: Rig = Rig(), progress: Progress = lambda _: None
                 ) -> LumpedModel:
    """Model that ``tympan lumped build`` makes of a specimen under a mass [kg], 0 to a voltage [V].

    It has no reduced film, and :data:`tympan.studies.lumped.actuator.BORROWED` viscous constants.
    It is kept on disk, so that the next time it is there at once.

    Raises
    ------
    InputError
        When the field model has no equilibrium up to the voltage, or the rig is none of a lumped
        model's.
    """
    voltages = (0.0, voltage / 2, voltage) if voltage > 0 else (0.0,)
    key = digest("lumped", specimen, settings, rig, mass, voltage, *_sources())
    model = _STORE.read(key, lambda content: _model(specimen, content))
    if model is None:
        model = build(specimen, settings, BuildSettings((mass,), voltages), rig, progress,
                      in_time=False).model
        _STORE.keep(key, json.dumps([model.radii, model.weights, model.flat_capacitance,
                                     model.highest_voltage, model.stiffness,
                                     model.permittivity, model.gas_area]).encode())
    return model


def _model(specimen: Specimen, content: bytes) -> LumpedModel:
    radii, weights, flat, highest, stiffness, permittivity, gas_area = json.loads(content)
    return LumpedModel(specimen, tuple(radii), tuple(weights), flat, highest, stiffness,
                       permittivity, gas_area=gas_area)


def _sources() -> list[str]:
    """Sources that decide a model beside the solvers, which the key has already."""
    files = [Path(building.__file__), *sorted(Path(alpha.__file__).parent.glob("*.py"))]
    return [file.read_text(encoding="utf-8") for file in files]
