"""What a map is drawn of: α and stroke of ellipses with circular plates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.alpha import AlphaSettings, LoadGrid, alpha
from tympan.studies.case import Settings, build_model, voltage_ramp
from tympan.studies.paper.actuators import paper_film
from tympan.studies.parallel import mapped

#: The short semi-axis of all shapes of a map [m]; only ratios matter to α, but for the size of the
#: loads.
SHORT = 45e-3


@dataclass(frozen=True)
class Place:
    """Where on the map: long semi-axis and plate radius over the short semi-axis; the material."""

    aspect: float
    ratio: float
    material: str = "vhb-4910"

    @property
    def specimen(self) -> Specimen:
        """An ellipse with the paper's film and short semi-axis."""
        return Specimen(f"ellipse {self.aspect:.4g}, plate {self.ratio:.4g}",
                        Ellipse((self.aspect * SHORT, SHORT)),
                        Plate(Circle(self.ratio * SHORT)), paper_film(self.material))


@dataclass(frozen=True)
class Reading:
    """α₁ of two membrane circles with the semi-axes, the force error it leaves, the stroke [m].

    ``trouble``: what went wrong.
    """

    place: Place
    alpha: float
    error: float
    stroke: float
    trouble: str = ""


@dataclass(frozen=True)
class MapSettings:
    """How a map is made: loads of the α, mass [kg] and voltage [V] of the stroke, and places.

    The grid spans ``aspects`` and ``ratios``; ``inside`` random places in its range have random
    materials of the library, ``outside`` ones have aspects up to ``far[0]`` and ratios up to
    ``far[1]``.
    """

    loads: LoadGrid = field(default_factory=lambda: LoadGrid((17.9e-3, 22.45e-3), (0.0, 2e3, 4e3)))
    mass: float = 17.9e-3
    voltage: float = 3.5e3
    aspects: tuple[float, ...] = (1.1, 1.2, 1.35, 1.5, 1.7, 1.95, 2.2, 2.5)
    ratios: tuple[float, ...] = (0.1, 0.15, 0.22, 0.3, 0.4, 0.5, 0.6)
    inside: int = 30
    outside: int = 24
    far: tuple[float, float] = (5.0, 0.8)
    seed: int = 2026

    def grid(self) -> list[Place]:
        """The places the formula is found from."""
        return [Place(aspect, ratio) for aspect in self.aspects for ratio in self.ratios]

    def inner(self) -> list[Place]:
        """Places it is tested on, within its range."""
        rng = np.random.default_rng(self.seed)
        names = sorted(MATERIALS)
        return [Place(rng.uniform(self.aspects[0], self.aspects[-1]),
                      rng.uniform(self.ratios[0], self.ratios[-1]),
                      names[rng.integers(len(names))]) for _ in range(self.inside)]

    def outer(self) -> list[Place]:
        """Places beyond its range: longer, with a larger plate, or both."""
        rng = np.random.default_rng(self.seed + 1)
        places: list[Place] = []
        while len(places) < self.outside:
            place = Place(rng.uniform(self.aspects[0], self.far[0]),
                          rng.uniform(self.ratios[0], self.far[1]))
            if place.aspect > self.aspects[-1] or place.ratio > self.ratios[-1]:
                places.append(place)
        return places


def map_readings(places: Sequence[Place], map_settings: MapSettings, workers: int = 1,
                 progress: Callable[[str], None] = lambda _: None) -> list[Reading]:
    """At every place, in their order.

    One without an equilibrium is a reading of nan with the reason.
    """
    collected = []
    for reading in mapped(partial(_reading, map_settings), places, workers):
        progress(reading.place.specimen.name)
        collected.append(reading)
    return collected


def _reading(map_settings: MapSettings, place: Place) -> Reading:
    specimen, settings = place.specimen, Settings()
    loads = AlphaSettings(map_settings.loads, LoadGrid((), ()))
    try:
        weights = alpha(specimen, settings, loads).by_basis["membrane"]
    except InputError as error:
        return Reading(place, np.nan, np.nan, np.nan, str(error))
    (_, resting), (_, charged) = voltage_ramp(
        build_model(specimen, settings), map_settings.mass, (0.0, map_settings.voltage), Rig(),
        settings.path)
    if charged.status != "equilibrium":
        return Reading(place, weights.alpha[0], weights.fit_error, np.nan, charged.advice)
    stroke = charged.state.plate.deflection - resting.state.plate.deflection
    return Reading(place, weights.alpha[0], weights.fit_error, stroke)
