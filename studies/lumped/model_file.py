"""The file of a lumped model: TOML with plain SI numbers; reading it gives an equal model.

The formulas at the top of the file come from ``model_file.txt``, those of a film in time from
``reduced_film.txt``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from tympan.base.errors import VoltageError
from tympan.base.file_kinds import of_kind
from tympan.base.toml_reader import NON_NEGATIVE, POSITIVE, Rule, Table
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import OWN, Rig, rig_under
from tympan.fem.toml_writer import rig_content, specimen_content, toml
from tympan.geometry.specimen import Specimen
from tympan.studies.circles import MembraneCircle
from tympan.studies.files import write_text
from tympan.studies.films.film import ReducedFilm
from tympan.studies.lumped.actuator import BORROWED, Actuator, Viscous
from tympan.studies.shipped import load_named

_WEIGHT: Rule = (lambda x: 0 <= x <= 1, "must be from 0 to 1")

#: Viscous constants of circles whose film has branches of its own: no viscosity.
STILL = Viscous(0.0, 1.0, 0.0)


@dataclass(frozen=True)
class LumpedModel:
    """Model of a specimen: circles of radii [m], the shortest first, weights α, two factors.

    The film's law, thickness, prestretch and permittivity, and the plate's size, are those of
    ``specimen``. ``flat_capacitance`` [F] is that of the whole flat film. ``highest_voltage`` [V]
    is the highest voltage across the film that the model is valid for: these circles keep their
    hoop stretch, so they do not pull in where the film does. ``gas_area`` [m²] is the area on which
    a gas below film and plate lifts the plate. Where a file has no such area, the circles' is used.
    ``rig``: the one that it was built on; a question's own replaces it.
    """

    specimen: Specimen
    radii: tuple[float, ...]
    weights: tuple[float, ...]
    flat_capacitance: float
    highest_voltage: float
    stiffness: float = 1.0
    permittivity: float = 1.0
    viscous: Viscous = BORROWED
    film: ReducedFilm | None = None
    gas_area: float | None = None
    rig: Rig = OWN

    @property
    def circles(self) -> MembraneCircle:
        return MembraneCircle(self.specimen, np.array(self.radii),
                              flat_capacitance=self.flat_capacitance)

    def check(self, voltage: float) -> None:
        """Refuse a voltage across the film [V] above the highest that the model is for."""
        if abs(voltage) > self.highest_voltage * (1 + 1e-9):
            raise VoltageError(f"the model was built for at most {self.highest_voltage / 1e3:.5g} "
                               "kV across the film and does not know its pull-in: build it "
                               "for more with --voltage",
                               key=self.specimen.name, given=f"{voltage / 1e3:.5g} kV")

    def actuator(self, mass: float, rig: Rig = Rig()) -> Actuator:
        return Actuator(self.circles, self.weights, mass, self.viscous, rig,
                        self.stiffness, self.permittivity, self.gas_area)


def write_model(file: Path, model: LumpedModel) -> None:
    """Write a model's file."""
    viscous = model.viscous
    content = {
        "stiffness": model.stiffness, "permittivity": model.permittivity,
        "flat_capacitance_F": model.flat_capacitance, "highest_voltage_V": model.highest_voltage,
        **({} if model.gas_area is None else {"gas_area_m2": model.gas_area}),
        **({} if model.film else {"viscous": {
            "k1_Pa": viscous.k1, "eta1_Pa_s": viscous.eta1, "eta2_Pa_s": viscous.eta2}}),
        "circle": [{"radius_m": radius, "alpha": weight}
                   for radius, weight in zip(model.radii, model.weights, strict=True)],
        **({"film": _film_content(model.film)} if model.film else {}),
        "specimen": specimen_content(model.specimen, plain=True),
        **({} if model.rig == OWN else {"rig": rig_content(model.rig, plain=True)}),
    }
    texts = ("model_file.txt", "reduced_film.txt" if model.film else "viscous.txt", "limits.txt")
    formulas = (resources.files("tympan.studies.lumped").joinpath(name) for name in texts)
    write_text(file, "".join(text.read_text(encoding="utf-8") for text in formulas)
               + toml(content))


def _film_content(film: ReducedFilm) -> dict[str, Any]:
    """Make the tables of a reduced film: gradients by shape, each 11, 12, 21, 22, 31, 32."""
    gradients = film.gradients.transpose(1, 0, 2, 3).reshape(len(film.volumes), -1)
    return {"error": dict(film.errors),
            "point": [{"volume_m3": volume, "covered": covered, "gradient_per_m": gradient}
                      for volume, covered, gradient in zip(
                          film.volumes.tolist(), film.covered.tolist(), gradients.tolist(),
                          strict=True)]}


def read_actuator(file: Path | str) -> Specimen | LumpedModel:
    """Read a lumped model from its file, or a specimen from its own."""
    lumped = Path(file).exists() and of_kind("lumped model", Table.read(file).data)
    return read_model(file) if lumped else load_named(file)


def read_model(file: Path | str) -> LumpedModel:
    """Read a model from its file."""
    table = Table.read(file, "lumped model")
    specimen = load_specimen(replace(table.table("specimen"), plain=True))
    circles = table.tables("circle")
    if not circles:
        raise table.error("circle", "must be at least one circle")
    radii = tuple(circle.number("radius_m", rule=POSITIVE) for circle in circles)
    weights = tuple(circle.number("alpha", rule=_WEIGHT) for circle in circles)
    inside = sum(specimen.needed_plate().outline.semi_axes) / 2
    if min(radii) <= inside:
        raise table.error("circle", f"radii must be larger than the plate's, {inside:g} m",
                          min(radii))
    film = gas_area = None
    if "gas_area_m2" in table.data:
        gas_area = table.number("gas_area_m2", rule=NON_NEGATIVE)
    if specimen.membrane.branches:
        film = replace(_film(table.table("film"), specimen), gas_area=gas_area)
    model = LumpedModel(
        specimen, radii, weights, table.number("flat_capacitance_F", rule=NON_NEGATIVE),
        table.number("highest_voltage_V", rule=POSITIVE), table.number("stiffness", rule=POSITIVE),
        table.number("permittivity", rule=NON_NEGATIVE),
        STILL if film else _viscous(table.table("viscous")), film, gas_area,
        rig_under(replace(table, plain=True)) or OWN)
    table.asked.add("rig")
    for part in (*circles, table):
        part.done()
    if abs(sum(weights) - 1) > 1e-9:
        raise table.error("circle", "alpha of all circles must add up to 1", sum(weights))
    return model


def _viscous(table: Table) -> Viscous:
    viscous = Viscous(table.number("k1_Pa", rule=NON_NEGATIVE),
                      table.number("eta1_Pa_s", rule=POSITIVE),
                      table.number("eta2_Pa_s", rule=NON_NEGATIVE))
    table.done()
    return viscous


def _film(table: Table, specimen: Specimen) -> ReducedFilm:
    errors = table.table("error")
    points = table.tables("point")
    if not points:
        raise table.error("point", "must be at least one point")
    volumes = np.array([point.number("volume_m3", rule=POSITIVE) for point in points])
    covered = np.array([point.number("covered", rule=_WEIGHT) for point in points])
    gradients = [point.numbers("gradient_per_m") for point in points]
    count = len(gradients[0])
    for point, gradient in zip(points, gradients, strict=True):
        if len(gradient) != count or count % 6 or not count:
            raise point.error("gradient_per_m", "must be six numbers for each shape, as many at "
                                                "every point", len(gradient))
        point.done()
    shaped = np.array(gradients).reshape(len(points), -1, 3, 2).transpose(1, 0, 2, 3)
    film = ReducedFilm(specimen, volumes, covered, np.ascontiguousarray(shaped),
                       {name: errors.number(name, rule=NON_NEGATIVE) for name in errors.data})
    table.done()
    return film
