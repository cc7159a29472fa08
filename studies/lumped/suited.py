"""The lumped model of a specimen for given loads, built when first needed and cached."""

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
    """Build, or read from the cache, a model under a mass [kg] for 0 to a voltage [V].

    It is the model of ``tympan lumped build`` without a reduced film, with
    :data:`tympan.studies.lumped.actuator.BORROWED` viscous constants. It is stored on disk, so that
    the next call only reads it.

    Raises
    ------
    InputError
        When the field model has no equilibrium up to the voltage, or a lumped model cannot
        represent the rig.
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
    """Read the sources that decide a model, besides the solvers, which the key includes."""
    files = [Path(building.__file__), *sorted(Path(alpha.__file__).parent.glob("*.py"))]
    return [file.read_text(encoding="utf-8") for file in files]
