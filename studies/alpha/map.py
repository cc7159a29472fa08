"""α and stroke of ellipses with circular plates: readings, a formula fitted to some, its tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.geometry.errors import InputError
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies.alpha import AlphaSettings, LoadGrid, alpha
from tympan.studies.alpha.formula import Formula, fit_formula
from tympan.studies.case import Settings, build_model, voltage_ramp
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.files import from_json, read_json, remove, write_json
from tympan.studies.paper.actuators import paper_film
from tympan.studies.parallel import mapped

Array = NDArray[Any]

#: The short semi-axis of all shapes of a map [m]; only ratios matter to α, but for the size of the
#: loads.
SHORT = 45e-3

#: Places of a map: on its grid, at random within its range, and beyond it.
SETS = ("grid", "inside", "outside")

#: The columns of alpha-map.csv: one per field of a reading, beside its set and the formula.
COLUMNS: tuple[Column, ...] = (
    Column.labels("where", SETS),
    Column.labels("material"),
    Column("aspect"),
    Column("plate_over_short"),
    Column("alpha_1", required=False, absent="nan"),
    Column("formula"),
    Column("force_error", required=False, absent="nan"),
    Column("stroke", "mm", required=False, absent="nan"),
    Column.labels("trouble", required=False),
)
_READ = {"material": "material", "aspect": "aspect", "ratio": "plate_over_short",
         "alpha": "alpha_1", "error": "force_error", "stroke": "stroke", "trouble": "trouble"}


@dataclass(frozen=True)
class Reading:
    """A place on the map, and what is read there.

    ``aspect`` and ``ratio``: long semi-axis and plate radius over the short semi-axis. ``alpha``:
    α₁ of two membrane circles with the semi-axes; ``error``: the force error it leaves, relative;
    ``stroke`` [m]; nan where ``trouble`` says what went wrong.
    """

    aspect: float
    ratio: float
    material: str = "vhb-4910"
    alpha: float = np.nan
    error: float = np.nan
    stroke: float = np.nan
    trouble: str = ""

    @property
    def specimen(self) -> Specimen:
        """An ellipse with the paper's film and short semi-axis."""
        return Specimen(f"ellipse {self.aspect:.4g}, plate {self.ratio:.4g}",
                        Ellipse((self.aspect * SHORT, SHORT)),
                        Plate(Circle(self.ratio * SHORT)), paper_film(self.material))


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

    def grid(self) -> list[Reading]:
        """The places the formula is found from."""
        return [Reading(aspect, ratio) for aspect in self.aspects for ratio in self.ratios]

    def inner(self) -> list[Reading]:
        """Places it is tested on, within its range."""
        rng = np.random.default_rng(self.seed)
        names = sorted(MATERIALS)
        return [Reading(rng.uniform(self.aspects[0], self.aspects[-1]),
                        rng.uniform(self.ratios[0], self.ratios[-1]),
                        names[rng.integers(len(names))]) for _ in range(self.inside)]

    def outer(self) -> list[Reading]:
        """Places beyond its range: longer, with a larger plate, or both."""
        rng = np.random.default_rng(self.seed + 1)
        places: list[Reading] = []
        while len(places) < self.outside:
            place = Reading(rng.uniform(self.aspects[0], self.far[0]),
                            rng.uniform(self.ratios[0], self.far[1]))
            if place.aspect > self.aspects[-1] or place.ratio > self.ratios[-1]:
                places.append(place)
        return places


@dataclass(frozen=True)
class AlphaMap:
    """Readings on the ``grid``, at random places ``inside`` its range, and ``outside`` it."""

    settings: MapSettings
    grid: tuple[Reading, ...]
    inside: tuple[Reading, ...]
    outside: tuple[Reading, ...]
    formula: Formula

    def errors(self, name: str) -> Array:
        """Formula less reading, where there is one, in one of SETS."""
        aspect, ratio, weight = _columns(getattr(self, name))
        return self.formula(aspect, ratio) - weight

    def json(self) -> dict[str, Any]:
        """As a JSON object, without the readings."""
        errors = {name: self.errors(name) for name in SETS}
        return {"formula": self.formula.words(), "constants": list(self.formula.constants),
                "aspects": list(self.formula.aspects), "ratios": list(self.formula.ratios),
                "worst_error": {name: float(np.abs(error).max()) for name, error in errors.items()},
                "rms_error": {name: float(np.sqrt(np.mean(error**2)))
                              for name, error in errors.items()},
                "places": {name: len(getattr(self, name)) for name in SETS},
                "settings": asdict(self.settings)}

    def save(self, folder: Path) -> None:
        """Write ``alpha-map.csv`` and ``alpha-map.json``."""
        remove(folder, "alpha-map.json", "alpha-map.png", "alpha-map.svg")
        rows = [(name, reading) for name in SETS for reading in getattr(self, name)]
        values: dict[str, Any] = {title: np.array([getattr(reading, name) for _, reading in rows])
                                  for name, title in _READ.items()}
        values["formula"] = self.formula(values["aspect"], values["plate_over_short"])
        write_sheet(folder / "alpha-map.csv", COLUMNS,
                    {**values, "where": [name for name, _ in rows]})
        write_json(folder / "alpha-map.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> AlphaMap:
        """What was saved.

        Raises
        ------
        InputError
            When a file is missing or damaged.
        """
        file = folder / "alpha-map.json"
        record = from_json(dict[str, Any], read_json(file), file)
        settings = from_json(MapSettings, record.get("settings"), file, "settings")
        columns = read_own_sheet(folder / "alpha-map.csv", COLUMNS)
        sets: dict[str, list[Reading]] = {name: [] for name in SETS}
        rows = zip(*(columns[title].tolist() for title in _READ.values()), strict=True)
        for name, row in zip(columns["where"].tolist(), rows, strict=True):
            sets[name].append(Reading(**dict(zip(_READ, row, strict=True))))
        return cls(settings, tuple(sets["grid"]), tuple(sets["inside"]), tuple(sets["outside"]),
                   from_json(Formula, record, file))


def alpha_map(settings: MapSettings, workers: int = 1,
              progress: Callable[[str], None] = lambda _: None) -> AlphaMap:
    """Make a map: read the grid, fit the formula, test it."""
    grid, inside, outside = (tuple(map_readings(places, settings, workers, progress)) for places in
                             (settings.grid(), settings.inner(), settings.outer()))
    return AlphaMap(settings, grid, inside, outside, fit_formula(*_columns(grid)))


def map_readings(places: Sequence[Reading], map_settings: MapSettings, workers: int = 1,
                 progress: Callable[[str], None] = lambda _: None) -> list[Reading]:
    """What is read at every place, in their order; where nothing is in equilibrium, the reason."""
    readings = []
    for reading in mapped(partial(_read, map_settings), places, workers):
        progress(reading.specimen.name)
        readings.append(reading)
    return readings


def _read(map_settings: MapSettings, place: Reading) -> Reading:
    specimen, settings = place.specimen, Settings()
    loads = AlphaSettings(map_settings.loads, LoadGrid((), ()))
    try:
        weights = alpha(specimen, settings, loads).by_basis["membrane"]
    except InputError as error:
        return replace(place, trouble=str(error))
    reading = replace(place, alpha=weights.alpha[0], error=weights.fit_error)
    (_, resting), (_, charged) = voltage_ramp(
        build_model(specimen, settings), map_settings.mass, (0.0, map_settings.voltage), Rig(),
        settings.path)
    if charged.status != "equilibrium":
        return replace(reading, trouble=charged.advice)
    stroke = charged.state.plate.deflection - resting.state.plate.deflection
    return replace(reading, stroke=stroke)


def _columns(readings: Sequence[Reading]) -> tuple[Array, Array, Array]:
    """Aspects, ratios and α₁ of the readings that have one."""
    aspect, ratio, weight = np.array([(reading.aspect, reading.ratio, reading.alpha)
                                      for reading in readings if np.isfinite(reading.alpha)]).T
    return aspect, ratio, weight
