"""Outlines piece by piece, and smooth ones through points."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.fields import Key, read
from tympan.base.toml_reader import Table
from tympan.geometry.outlines.contours import JOINT, piece_ends
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.outline import OUTLINES, Boxed
from tympan.geometry.outlines.pieces import PIECES, PLACE, Piece, Spline, around


@OUTLINES.register
@dataclass(frozen=True)
class ClosedSpline(Boxed):
    """The periodic cubic spline through points, over the length of their chords."""

    shape: ClassVar[str] = "spline"
    through: Annotated[tuple[tuple[float, float], ...], Key(
        "points on it, counterclockwise; the first may stand at the end again", "length", PLACE,
        least=3)]

    def __post_init__(self) -> None:
        object.__setattr__(self, "through", around(self.through, "through"))

    @cached_property
    def drawn_at(self) -> tuple[float, float]:
        return Curve(self.pieces()).middle

    def pieces(self) -> tuple[Piece, ...]:
        """One spline; its knots are the lengths of chords, and so move with the points."""
        points = np.array([*self.through, self.through[0]])
        rise = np.diff(points, axis=0)
        step = np.sqrt((rise * rise).sum(axis=1))
        slope = tuple(_slopes(step, rise)[0].tolist())
        knots = np.concatenate([np.zeros(1), np.cumsum(step)])
        return (Spline(tuple(knots.tolist()), tuple((x, y) for x, y in points.tolist()),
                       (slope, slope)),)


def _slopes(step: AnyArray, rise: AnyArray) -> AnyArray:
    """Solve for the derivatives at the points that make the curvature continuous all around."""
    from scipy.sparse import csc_array
    from scipy.sparse.linalg import spsolve

    before, count = np.roll(1 / step, 1), len(step)
    here = np.arange(count)
    values = np.concatenate([2 * (before + 1 / step), before, 1 / step])
    places = np.tile(here, 3), np.concatenate([here, (here - 1) % count, (here + 1) % count])
    steep = rise / step[:, None] ** 2
    return np.asarray(spsolve(csc_array((values, places)),
                              3 * (steep + np.roll(steep, 1, axis=0))))


@OUTLINES.register
@dataclass(frozen=True)
class Drawn(Boxed):
    """Joined ``segments`` counterclockwise around a closed curve, wherever they lie [m].

    ``file`` is the drawing that they were read from, if there is one.
    """

    shape: ClassVar[str] = "drawn"
    segments: Annotated[tuple[Piece, ...], Key(
        "its pieces, counterclockwise, each starting where the one before it ends", kinds=PIECES,
        discrete=True)]
    remarks: tuple[str, ...] = field(default=(), compare=False)
    file: str = field(default="", compare=False)

    @classmethod
    def from_table(cls, table: Table) -> Drawn:
        """Read the outline from a table of a file, where pieces may lie apart."""
        drawn = read(cls, table)
        if not drawn.segments:
            raise table.error("segments", "must be a list of tables, one a piece")
        starts, ends = piece_ends(drawn.segments)
        miss = np.linalg.norm(ends - np.roll(starts, -1, axis=0), axis=1)
        if miss.max() > JOINT * np.ptp(ends, axis=0).max() + 1e-12:
            x, y = 1e3 * ends[int(miss.argmax())]
            raise table.error("segments",
                              f"must be closed: the piece that ends at {x:.4g}, {y:.4g} mm is "
                              f"{miss.max() * 1e3:.3g} mm away from the start of the next")
        return drawn

    def pieces(self) -> tuple[Piece, ...]:
        return self.segments

    @cached_property
    def drawn_at(self) -> tuple[float, float]:
        return Curve(self.segments).middle
