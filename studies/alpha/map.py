"""α and stroke of ellipses with circular plates: readings, a fitted formula, and its tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from scipy.optimize import least_squares

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.progress import Progress
from tympan.fem.film.library import MATERIALS
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Circle, Ellipse
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.alpha import AlphaSettings, LoadGrid, alpha
from tympan.studies.case import Settings, build_model, voltage_ramp
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.files import from_json, read_json, remove, write_json
from tympan.studies.parallel import mapped

#: Short semi-axis of all shapes of a map [m]. Only ratios matter to α; the loads must suit this
#: size.
SHORT = 45e-3

#: Sets of places of a map: on its grid, at random within its range, and beyond it.
SETS = ("grid", "inside", "outside")

#: The columns of alpha-map.csv: a reading, its set, and α₁ by the formula.
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

#: Conformal radius of an endless strip over its half width: a round film of this radius is as stiff
#: as the strip, if the plate in the middle is small.
_STRIP = 4 / np.pi


@dataclass(frozen=True)
class Formula:
    """α₁(A, q), A = r₂/r₁, q = r/r₁, with four constants c.

    A film under small tension changes pulls like 1/ln(R/r), so one circle of radius s r₁ is as
    stiff as the ellipse: α₁ = (1/ln(s/q) − 1/ln(A/q)) / (1/ln(1/q) − 1/ln(A/q)), with s = 1 + (4/π
    − 1)(1 − A^−p) between the circle (1) and the endless strip (4/π), and p = c₀ + c₁ ln A + c₂ ln²
    A + c₃ q³ ln A. It holds for A and q in ``aspects`` and ``ratios``.

    Examples
    --------
    >>> formula = Formula((1.83, 0.84, -0.49, -1.44), (1.1, 2.5), (0.1, 0.6))
    >>> round(float(formula(75 / 45, 10 / 45)), 2)
    0.61
    """

    constants: tuple[float, ...]
    aspects: tuple[float, float]
    ratios: tuple[float, float]

    def __call__(self, aspect: Array, ratio: Array) -> Array:
        """Evaluate α₁, also where the formula does not hold."""
        logarithm = np.log(aspect)
        power = np.stack([np.ones_like(logarithm), logarithm, logarithm**2, ratio**3 * logarithm],
                         -1) @ self.constants
        radius = 1 + (_STRIP - 1) * (1 - aspect**-power)
        same, short, long = (1 / np.log(size / ratio) for size in (radius, 1.0, aspect))
        return (same - long) / (short - long)

    def words(self) -> str:
        """Write the formula with its numbers, to be copied."""
        first, *others = self.constants
        c1, c2, c3 = (f"{constant:+.4f}" for constant in others)
        return (f"p = {first:.4f} {c1} ln A {c2} ln² A {c3} q³ ln A;  s = 1 + (4/π − 1)(1 − "
                "A^−p);  α₁ = (1/ln(s/q) − 1/ln(A/q)) / (1/ln(1/q) − 1/ln(A/q));  A = r₂/r₁, q = "
                "r/r₁")


@dataclass(frozen=True)
class MapReading:
    """Place on the map with its results, by the columns of alpha-map.csv.

    ``aspect`` and ``plate_over_short`` are long semi-axis and plate radius over the short
    semi-axis. ``alpha_1`` is that of two membrane circles with the semi-axes, ``force_error`` the
    relative error of the force that remains; both are nan if ``trouble`` gives a reason.
    """

    aspect: float
    plate_over_short: float
    material: str = "vhb-4910"
    alpha_1: float = np.nan
    force_error: float = np.nan
    stroke: float = np.nan
    trouble: str = ""

    @property
    def name(self) -> str:
        return f"ellipse {self.aspect:.4g} plate {self.plate_over_short:.4g}"

    def specimen(self, film: Film) -> Specimen:
        """Ellipse of this place, with a film of its material."""
        frame = Ellipse((self.aspect * SHORT, SHORT))
        plate = Plate(Circle(self.plate_over_short * SHORT))
        return Specimen(self.name, frame, plate,
                        replace(film, material=MATERIALS[self.material].material))


@dataclass(frozen=True)
class MapSettings:
    """Settings of a map: loads of the α, mass [kg] and voltage [V] of the stroke, and places.

    The loads must suit the film, whose frames have the short semi-axis :data:`SHORT`.

    The grid spans ``aspects`` and ``ratios``; ``inside`` random places in its range have random
    materials of the library, of those without a range of stretches, ``outside`` ones have aspects
    up to ``far[0]`` and ratios up to ``far[1]``.
    """

    loads: LoadGrid
    mass: float
    voltage: float
    aspects: tuple[float, ...] = (1.1, 1.2, 1.35, 1.5, 1.7, 1.95, 2.2, 2.5)
    ratios: tuple[float, ...] = (0.1, 0.15, 0.22, 0.3, 0.4, 0.5, 0.6)
    inside: int = 30
    outside: int = 24
    far: tuple[float, float] = (5.0, 0.8)
    seed: int = 2026

    def places(self) -> dict[str, list[MapReading]]:
        """Choose the places of each set: the formula is fitted on the grid, tested on the others.

        Places outside are longer, have a larger plate, or both.
        """
        grid = [MapReading(aspect, ratio) for aspect in self.aspects for ratio in self.ratios]
        rng = np.random.default_rng(self.seed)
        names = sorted(name for name, entry in MATERIALS.items() if entry.law_range is None)
        inside = [MapReading(rng.uniform(self.aspects[0], self.aspects[-1]),
                          rng.uniform(self.ratios[0], self.ratios[-1]),
                          names[rng.integers(len(names))]) for _ in range(self.inside)]
        rng = np.random.default_rng(self.seed + 1)
        outside: list[MapReading] = []
        while len(outside) < self.outside:
            place = MapReading(rng.uniform(self.aspects[0], self.far[0]),
                            rng.uniform(self.ratios[0], self.far[1]))
            if place.aspect > self.aspects[-1] or place.plate_over_short > self.ratios[-1]:
                outside.append(place)
        return dict(zip(SETS, (grid, inside, outside), strict=True))


@dataclass(frozen=True, eq=False)
class AlphaMap:
    """Readings by the name of a column of :data:`COLUMNS`, in SI, and the formula."""

    #: Names of the pictures of a map.
    pictures: ClassVar[tuple[str, ...]] = ("alpha-map.png", "alpha-map.svg")

    settings: MapSettings
    formula: Formula
    readings: Mapping[str, Array]

    def of(self, name: str) -> dict[str, Array]:
        """Select the readings of one of SETS."""
        return {column: values[self.readings["where"] == name]
                for column, values in self.readings.items()}

    def json(self) -> dict[str, Any]:
        """Write the map as a JSON object, without the readings."""
        errors = {name: _errors(self.of(name)) for name in SETS}
        return {"formula": self.formula.words(), "constants": list(self.formula.constants),
                "aspects": list(self.formula.aspects), "ratios": list(self.formula.ratios),
                "worst_error": {name: float(np.abs(error).max()) for name, error in errors.items()},
                "rms_error": {name: float(np.sqrt(np.mean(error**2)))
                              for name, error in errors.items()},
                "places": {name: len(self.of(name)["where"]) for name in SETS},
                "settings": asdict(self.settings)}

    def save(self, folder: Path) -> None:
        """Write ``alpha-map.csv`` and ``alpha-map.json``."""
        remove(folder, "alpha-map.json")
        write_sheet(folder / "alpha-map.csv", COLUMNS, self.readings)
        write_json(folder / "alpha-map.json", self.json())

    @classmethod
    def load(cls, folder: Path) -> AlphaMap:
        """Load a saved map."""
        file = folder / "alpha-map.json"
        record = from_json(dict[str, Any], read_json(file), file)
        return cls(from_json(MapSettings, record.get("settings"), file, "settings"),
                   from_json(Formula, record, file),
                   read_own_sheet(folder / "alpha-map.csv", COLUMNS))


def alpha_map(film: Film, settings: MapSettings, workers: int = 1,
              progress: Progress = lambda _: None) -> AlphaMap:
    """Make a map of a film, but for its material: read all places, fit the formula to the grid."""
    rows = [{"where": name, **asdict(reading)} for name, places in settings.places().items()
            for reading in map_readings(film, places, settings, workers, progress)]
    readings = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    fitted = (readings["where"] == "grid") & np.isfinite(readings["alpha_1"])
    aspect, ratio, weight = (readings[name] for name in ("aspect", "plate_over_short", "alpha_1"))
    formula = _fit_formula(aspect[fitted], ratio[fitted], weight[fitted])
    return AlphaMap(settings, formula, {**readings, "formula": formula(aspect, ratio)})


def map_readings(film: Film, places: Sequence[MapReading], map_settings: MapSettings,
                 workers: int = 1, progress: Progress = lambda _: None
                 ) -> list[MapReading]:
    """Read every place, in order; give the reason where nothing is in equilibrium."""
    readings = []
    with closing(mapped(partial(_read, film, map_settings), places, workers)) as made:
        for reading in made:
            progress(reading.name)
            readings.append(reading)
    return readings


def _read(film: Film, map_settings: MapSettings, place: MapReading) -> MapReading:
    specimen, settings = place.specimen(film), Settings()
    loads = AlphaSettings(map_settings.loads, LoadGrid((), ()))
    try:
        weights = alpha(specimen, settings, loads).by_basis["membrane"]
    except InputError as error:
        return replace(place, trouble=str(error))
    reading = replace(place, alpha_1=weights.alpha[0], force_error=weights.fit_error)
    (_, resting), (_, charged) = voltage_ramp(
        build_model(specimen, settings), map_settings.mass, (0.0, map_settings.voltage), Rig(),
        settings.path)
    if charged.status != "equilibrium":
        return replace(reading, trouble=charged.advice)
    return replace(reading, stroke=charged.state.plate.deflection - resting.state.plate.deflection)


def _fit_formula(aspect: Array, ratio: Array, weight: Array) -> Formula:
    """Fit the formula to α₁ by least squares; its constants are rounded as they are printed.

    ``aspect``, ``ratio`` and ``weight``, which is α₁, have shape (readings,).
    """
    aspects, ratios = ((float(item.min()), float(item.max())) for item in (aspect, ratio))
    fit = least_squares(
        lambda constants: Formula(tuple(constants), aspects, ratios)(aspect, ratio) - weight,
        np.array([2.0, 0.0, 0.0, 0.0]), xtol=1e-14, ftol=1e-14)
    return Formula(tuple(round(float(constant), 4) for constant in fit.x), aspects, ratios)


def _errors(readings: Mapping[str, Array]) -> Array:
    """Subtract readings from the formula, where there are readings."""
    error = readings["formula"] - readings["alpha_1"]
    return error[np.isfinite(error)]
