"""The job of ``tympan map``: readings on the grid, the formula, its tests, and what is stored of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tympan.studies import files as store
from tympan.studies.alpha.formula import Formula, found
from tympan.studies.alpha.map_readings import MapSettings, Reading, readings


@dataclass(frozen=True)
class Chart:
    """Readings on the ``grid``, at random places ``inside`` its range with other materials, and ``outside``."""

    settings: MapSettings
    grid: tuple[Reading, ...]
    inside: tuple[Reading, ...]
    outside: tuple[Reading, ...]
    formula: Formula

    def record(self) -> dict[str, Any]:
        """As a JSON object."""
        errors = {name: self.formula.errors(read) for name, read in self._sets().items()}
        return {"formula": self.formula.words(), "constants": list(self.formula.constants),
                "aspects": list(self.formula.aspects), "ratios": list(self.formula.ratios),
                "worst_error": {name: float(np.abs(error).max()) for name, error in errors.items()},
                "rms_error": {name: float(np.sqrt(np.mean(error**2)))
                              for name, error in errors.items()},
                "places": {name: len(read) for name, read in self._sets().items()},
                "settings": asdict(self.settings)}

    def write(self, folder: Path) -> None:
        """``alpha-map.csv`` and ``alpha-map.json``."""
        header = ["where", "material", "aspect", "plate_over_short", "alpha_1", "formula",
                  "force_error", "stroke_mm",
                  "trouble"]
        rows = [[name, one.place.material, one.place.aspect, one.place.ratio, one.alpha,
                 float(self.formula(np.array(one.place.aspect), np.array(one.place.ratio))),
                 one.error,
                 one.stroke * 1e3, one.trouble] for name, read in self._sets().items()
                for one in read]
        store.write_csv(folder / "alpha-map.csv", header, rows)
        store.write_json(folder / "alpha-map.json", self.record())

    def _sets(self) -> dict[str, Sequence[Reading]]:
        return {"grid": self.grid, "inside": self.inside, "outside": self.outside}


def chart(settings: MapSettings, workers: int = 1,
          progress: Callable[[str], None] = lambda _: None) -> Chart:
    """Make a map: read the grid, find the formula, test it."""
    grid, inside, outside = (tuple(readings(places, settings, workers, progress)) for places in
                             (settings.grid(), settings.inner(), settings.outer()))
    return Chart(settings, grid, inside, outside, found(grid))
