"""α of every registered outline: the same film, load and plate in a frame of each shape."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tympan.geometry.outlines import Circle, Outline, area, examples
from tympan.geometry.specimen import Plate, Specimen
from tympan.studies import files as store
from tympan.studies.alpha import AlphaResult, AlphaSettings, alpha
from tympan.studies.case import Settings
from tympan.studies.paper.actuators import paper_film

#: The table's columns.
HEADER = ("shape", "half_width_mm", "half_height_mm", "area_cm2", "circle_1_mm", "circle_2_mm",
          "alpha_1", "alpha_2",
          "fit_error", "held_out_error", "field_alpha_1", "field_held_out_error", "one_circle_mm",
          "one_circle_held_out_error", "warnings")


@dataclass(frozen=True)
class Row:
    """A frame's outline with its α: two membrane circles of its sectors, and the one circle that fits best."""

    outline: Outline
    two: AlphaResult
    one: AlphaResult

    def cells(self) -> list[Any]:
        """In the order of :data:`HEADER`; a round frame has one circle, and empty cells for the second."""
        (a,
         b), two, fields = self.outline.semi_axes, self.two.by_basis["membrane"], self.two.from_fields
        radii, weights = ([*values, None][:2] for values in (self.two.circles, two.alpha))
        one = self.one.by_basis["membrane"]
        doubts = [text for text in self.two.warnings if "cones" not in text]
        return [self.outline.shape, a * 1e3, b * 1e3, float(np.real(area(self.outline))) * 1e4,
                *(None if radius is None else radius * 1e3 for radius in radii), *weights,
                two.fit_error,
                two.held_out_error, fields.alpha[0], fields.held_out_error,
                self.one.circles[0] * 1e3,
                one.held_out_error, "; ".join(doubts)]


def specimen_in(outline: Outline) -> Specimen:
    """The paper's film and plate in a frame of this outline."""
    return Specimen(outline.shape, outline, Plate(Circle(10e-3)), paper_film())


def outline_table(settings: Settings, loads: AlphaSettings = AlphaSettings(),
                  progress: Callable[[str], None] = lambda _: None) -> Iterator[Row]:
    """A row for every registered outline that has an example."""
    for outline in examples().values():
        progress(outline.shape)
        specimen = specimen_in(outline)
        two, one = (alpha(specimen, settings, replace(loads, circles=count, radii=radii))
                    for count, radii in ((2, "sectors"), (1, "fit")))
        yield Row(outline, two, one)


def write(rows: list[Row], folder: Path) -> None:
    """``outlines.csv`` and ``outlines.json``."""
    store.write_csv(folder / "outlines.csv", HEADER, [row.cells() for row in rows])
    store.write_json(folder / "outlines.json",
                     [dict(zip(HEADER, row.cells(), strict=True)) for row in rows])
