"""The job of ``tympan map``.

Readings on the grid, the formula, its tests, and what is stored of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tympan.studies.alpha.formula import Formula, fit_formula
from tympan.studies.alpha.map_readings import MapSettings, Place, Reading, map_readings
from tympan.studies.columns import Column, LabelColumn, NumberColumn, read_own_sheet, write_sheet
from tympan.studies.files import from_json, read_json, remove, write_json

#: Places of a map: on its grid, at random within its range, and beyond it.
SETS = ("grid", "inside", "outside")

#: The columns of alpha-map.csv.
COLUMNS: tuple[Column, ...] = (
    LabelColumn("where", SETS),
    LabelColumn("material"),
    NumberColumn("aspect"),
    NumberColumn("plate_over_short"),
    NumberColumn("alpha_1", required=False, absent="nan"),
    NumberColumn("formula"),
    NumberColumn("force_error", required=False, absent="nan"),
    NumberColumn("stroke", "mm", "length", required=False, absent="nan"),
    LabelColumn("trouble", required=False),
)


@dataclass(frozen=True)
class AlphaMap:
    """Readings on the ``grid``, at random places ``inside`` its range, and ``outside`` it."""

    settings: MapSettings
    grid: tuple[Reading, ...]
    inside: tuple[Reading, ...]
    outside: tuple[Reading, ...]
    formula: Formula

    def json(self) -> dict[str, Any]:
        """As a JSON object, without the readings."""
        sets = {name: getattr(self, name) for name in SETS}
        errors = {name: self.formula.errors(readings) for name, readings in sets.items()}
        return {"formula": self.formula.words(), "constants": list(self.formula.constants),
                "aspects": list(self.formula.aspects), "ratios": list(self.formula.ratios),
                "worst_error": {name: float(np.abs(error).max()) for name, error in errors.items()},
                "rms_error": {name: float(np.sqrt(np.mean(error**2)))
                              for name, error in errors.items()},
                "places": {name: len(readings) for name, readings in sets.items()},
                "settings": asdict(self.settings)}

    def save(self, folder: Path) -> None:
        """Write ``alpha-map.csv`` and ``alpha-map.json``."""
        remove(folder, "alpha-map.json", "alpha-map.png", "alpha-map.svg")
        rows = [(name, reading) for name in SETS for reading in getattr(self, name)]
        readings = [reading for _, reading in rows]
        aspect = np.array([reading.place.aspect for reading in readings])
        ratio = np.array([reading.place.ratio for reading in readings])
        write_sheet(folder / "alpha-map.csv", COLUMNS, {
            "where": [name for name, _ in rows],
            "material": [reading.place.material for reading in readings],
            "aspect": aspect, "plate_over_short": ratio,
            "alpha_1": [reading.alpha for reading in readings],
            "formula": self.formula(aspect, ratio),
            "force_error": [reading.error for reading in readings],
            "stroke": [reading.stroke for reading in readings],
            "trouble": [reading.trouble for reading in readings]})
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
        for row, name in enumerate(columns["where"].tolist()):
            aspect, ratio, alpha, error, stroke = (
                float(columns[key][row])
                for key in ("aspect", "plate_over_short", "alpha_1", "force_error", "stroke"))
            place = Place(aspect, ratio, str(columns["material"][row]))
            sets[name].append(Reading(place, alpha, error, stroke, str(columns["trouble"][row])))
        formula = {key: record.get(key) for key in ("constants", "aspects", "ratios")}
        return cls(settings, tuple(sets["grid"]), tuple(sets["inside"]), tuple(sets["outside"]),
                   from_json(Formula, formula, file))


def alpha_map(settings: MapSettings, workers: int = 1,
              progress: Callable[[str], None] = lambda _: None) -> AlphaMap:
    """Make a map: read the grid, find the formula, test it."""
    places: tuple[Sequence[Place], ...] = settings.grid(), settings.inner(), settings.outer()
    grid, inside, outside = (tuple(map_readings(part, settings, workers, progress))
                             for part in places)
    return AlphaMap(settings, grid, inside, outside, fit_formula(grid))
