"""A lumped model as a file to take away: TOML with plain SI numbers; it reads back equal.

The formulas that are written above them stand in ``model_file.txt``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path

import numpy as np

from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import specimen_content, toml
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Specimen
from tympan.geometry.toml_reader import NON_NEGATIVE, POSITIVE, Rule, Table
from tympan.studies.circles import MembraneCircle
from tympan.studies.files import write_text
from tympan.studies.lumped.actuator import Actuator, Viscous

_WEIGHT: Rule = (lambda x: 0 <= x <= 1, "must be from 0 to 1")


@dataclass(frozen=True)
class LumpedModel:
    """What stands for a specimen: circles of radii [m], the shortest first, weights α, two factors.

    The film's law, thickness, prestretch and permittivity, and the plate's size, are those of
    ``specimen``. ``flat_capacitance`` is the whole flat film's [F], ``highest_voltage`` the highest
    across the film [V] that it is for: these circles keep their hoop stretch, so they do not pull
    in where the film does.
    """

    specimen: Specimen
    radii: tuple[float, ...]
    weights: tuple[float, ...]
    flat_capacitance: float
    highest_voltage: float
    stiffness: float = 1.0
    permittivity: float = 1.0
    viscous: Viscous = field(default_factory=Viscous)

    @property
    def circles(self) -> MembraneCircle:
        return MembraneCircle(self.specimen, np.array(self.radii),
                              flat_capacitance=self.flat_capacitance)

    def check(self, voltage: float) -> None:
        """Refuse a voltage across the film [V] beyond those it is for."""
        if abs(voltage) > self.highest_voltage * (1 + 1e-9):
            raise InputError(f"the model was built for at most {self.highest_voltage / 1e3:.5g} kV "
                             "across the film and does not know where it pulls in: build it for "
                             "more with --voltages",
                             key=self.specimen.name, given=f"{voltage / 1e3:.5g} kV")

    def actuator(self, mass: float, rig: Rig = Rig()) -> Actuator:
        return Actuator(self.circles, self.weights, mass, self.viscous, rig,
                        self.stiffness, self.permittivity)


def write_model(file: Path, model: LumpedModel) -> None:
    """Write a model's file."""
    viscous = model.viscous
    content = {
        "stiffness": model.stiffness, "permittivity": model.permittivity,
        "flat_capacitance_F": model.flat_capacitance, "highest_voltage_V": model.highest_voltage,
        "viscous": {"k1_Pa": viscous.k1, "eta1_Pa_s": viscous.eta1, "eta2_Pa_s": viscous.eta2},
        "circle": [{"radius_m": radius, "alpha": weight}
                   for radius, weight in zip(model.radii, model.weights, strict=True)],
        "specimen": specimen_content(model.specimen, plain=True),
    }
    formulas = resources.files("tympan.studies.lumped").joinpath("model_file.txt")
    write_text(file, formulas.read_text(encoding="utf-8") + toml(content))


def read_model(file: Path | str) -> LumpedModel:
    """The model of a file."""
    table = Table.read(file)
    specimen = load_specimen(replace(table.table("specimen"), plain=True))
    circles = table.tables("circle")
    if not circles:
        raise table.error("circle", "must be at least one circle")
    radii = tuple(circle.number("radius_m", rule=POSITIVE) for circle in circles)
    weights = tuple(circle.number("alpha", rule=_WEIGHT) for circle in circles)
    inside = sum(specimen.plate.outline.semi_axes) / 2
    if min(radii) <= inside:
        raise table.error("circle", f"radii must be larger than the plate's, {inside:g} m",
                          min(radii))
    viscous = table.table("viscous")
    model = LumpedModel(
        specimen, radii, weights, table.number("flat_capacitance_F", rule=NON_NEGATIVE),
        table.number("highest_voltage_V", rule=POSITIVE), table.number("stiffness", rule=POSITIVE),
        table.number("permittivity", rule=NON_NEGATIVE),
        Viscous(viscous.number("k1_Pa", rule=NON_NEGATIVE),
                viscous.number("eta1_Pa_s", rule=POSITIVE),
                viscous.number("eta2_Pa_s", rule=NON_NEGATIVE)))
    for part in (*circles, viscous, table):
        part.done()
    if abs(sum(weights) - 1) > 1e-9:
        raise table.error("circle", "alpha of all circles must add up to 1", sum(weights))
    return model
