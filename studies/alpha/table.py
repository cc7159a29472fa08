"""α of every registered outline: the same film, load and plate in a frame of each shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from tympan.base.arrays import Array
from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.base.progress import Progress
from tympan.geometry.outlines import Circle, Outline, area, examples
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.alpha.weights import AlphaResult, AlphaSettings, alpha
from tympan.studies.case import Settings
from tympan.studies.columns import Column, read_own_sheet, write_sheet
from tympan.studies.files import from_json, read_json, to_json, write_csv, write_json

#: Columns of outlines-frames.csv: points of each frame's outline.
FRAMES: tuple[Column, ...] = (
    Column.labels("shape"), Column("x", "mm"), Column("y", "mm"))


@dataclass(frozen=True, eq=False)
class OutlineRow:
    """A frame's outline, α of two membrane circles of its sectors, and the one that fits best."""

    shape: Annotated[str, Key("name of the outline's shape")]
    half_width_mm: Annotated[float, Key("half the frame's extent along x")]
    half_height_mm: Annotated[float, Key("half the frame's extent along y")]
    area_cm2: Annotated[float, Key("area of the frame")]
    circle_1_mm: Annotated[float, Key("radius of the first circle")]
    circle_2_mm: Annotated[float | None, Key("radius of the second circle; none in a round frame")]
    alpha_1: Annotated[float, Key("weight of the first circle")]
    alpha_2: Annotated[float | None, Key("weight of the second circle")]
    fit_error: Annotated[float, Key("error of the force on the loads of the fit, relative, root "
                                    "mean square")]
    held_out_error: Annotated[float | None, Key("the same on other loads")]
    field_alpha_1: Annotated[float, Key("weight of the first circle, from the field's shares of "
                                        "the plate's edge force")]
    field_held_out_error: Annotated[float | None, Key("its error of the force on other loads")]
    one_circle_mm: Annotated[float, Key("radius of the single circle that fits best")]
    one_circle_held_out_error: Annotated[float | None, Key("its error of the force on other loads")]
    warnings: Annotated[str, Key("what limits the result, in sentences")]


#: The table's columns.
HEADER = tuple(item.name for item in fields(OutlineRow))


@dataclass(frozen=True, eq=False)
class OutlineTable:
    """α of every registered outline; ``frames`` are points of each, by the columns of FRAMES."""

    rows: tuple[OutlineRow, ...]
    frames: Mapping[str, Array]

    def json(self) -> dict[str, Any]:
        """Write the table as a JSON object, without the outlines' points."""
        return {"outlines": to_json(self.rows)}

    def save(self, folder: Path) -> None:
        """Write ``outlines.csv``, ``outlines-frames.csv`` and ``outlines.json``."""
        records = to_json(self.rows)
        write_csv(folder / "outlines.csv", HEADER, (record.values() for record in records))
        write_sheet(folder / "outlines-frames.csv", FRAMES, self.frames)
        write_json(folder / "outlines.json", records)

    @classmethod
    def load(cls, folder: Path) -> OutlineTable:
        """Load a saved table; refuse one of a version that did not keep the outlines."""
        file, points = folder / "outlines.json", folder / "outlines-frames.csv"
        frames = read_own_sheet(points, FRAMES)
        rows = from_json(tuple[OutlineRow, ...], read_json(file), file)
        for row in rows:
            if row.shape not in frames["shape"]:
                raise InputError(f"has no points of {row.shape}: run tympan outlines again",
                                 file=points)
        return cls(rows, frames)


#: Radius of the plate [m], which suits the examples of outlines.
_PLATE = 10e-3


def outline_table(film: Film, loads: AlphaSettings, settings: Settings,
                  progress: Progress = lambda _: None) -> OutlineTable:
    """Row for every registered outline that has an example, with a film and a round plate in it.

    ``loads`` are those of the fit, and others to test at.
    """
    rows, points = [], []
    for outline in examples().values():
        progress(outline.shape)
        specimen = Specimen(outline.shape, outline, Plate(Circle(_PLATE)), film)
        pair, single = (alpha(specimen, settings, replace(loads, circles=count, radii=radii))
                        for count, radii in ((2, "sectors"), (1, "fit")))
        rows.append(_row(outline, pair, single))
        points.append(outline.points(720))
    x, y = np.concatenate(points, axis=1)
    shapes = np.repeat([row.shape for row in rows], [part.shape[1] for part in points])
    return OutlineTable(tuple(rows), {"shape": shapes, "x": x, "y": y})


def _row(outline: Outline, pair: AlphaResult, single: AlphaResult) -> OutlineRow:
    (a, b), weights = outline.semi_axes, pair.by_basis["membrane"]
    round_frame = len(pair.circles) == 1
    return OutlineRow(
        outline.shape, a * 1e3, b * 1e3, float(np.real(area(outline))) * 1e4,
        pair.circles[0] * 1e3, None if round_frame else pair.circles[1] * 1e3,
        weights.alpha[0], None if round_frame else weights.alpha[1],
        weights.fit_error, weights.held_out_error,
        pair.from_fields.alpha[0], pair.from_fields.held_out_error,
        single.circles[0] * 1e3, single.by_basis["membrane"].held_out_error,
        "; ".join(pair.warnings))
