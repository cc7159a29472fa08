"""Outlines piece by piece, of drawings, and smooth ones through points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np

from tympan.geometry.errors import InputError
from tympan.geometry.fields import Key, read
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.drawings import drawing_pieces
from tympan.geometry.outlines.outline import OUTLINES, Boxed
from tympan.geometry.outlines.pieces import PIECES, PLACE, Array, Piece, Spline, around
from tympan.geometry.toml_reader import Table

#: How far the end of a piece may miss the start of the next, over the size of the drawing.
_JOINT = 1e-6


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

    def pieces(self) -> tuple[Piece, ...]:
        """One spline; its knots, the lengths of chords, move with the points."""
        points = np.array([*self.through, self.through[0]])
        rise = np.diff(points, axis=0)
        step = np.sqrt((rise * rise).sum(axis=1))
        slope = tuple(_slopes(step, rise)[0].tolist())
        knots = np.concatenate([np.zeros(1), np.cumsum(step)])
        return (Spline(tuple(knots.tolist()), tuple((x, y) for x, y in points.tolist()),
                       (slope, slope)),)


def _slopes(step: Array, rise: Array) -> Array:
    """Derivatives at the points that make the curvature continuous around the curve."""
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
    """Joined ``segments`` counterclockwise around a closed curve, wherever they lie [m]."""

    shape: ClassVar[str] = "drawn"
    segments: Annotated[tuple[Piece, ...], Key(
        "its pieces, counterclockwise, each starting where the one before it ends", kinds=PIECES,
        discrete=True)]

    @classmethod
    def from_table(cls, table: Table) -> Drawn:
        """Read the outline from a table of a file, where pieces may lie apart."""
        drawn = read(cls, table)
        if not drawn.segments:
            raise table.error("segments", "must be a list of tables, one a piece")
        starts, ends = _ends(drawn.segments)
        miss = np.linalg.norm(ends - np.roll(starts, -1, axis=0), axis=1)
        if miss.max() > _JOINT * np.ptp(ends, axis=0).max() + 1e-12:
            x, y = 1e3 * ends[int(miss.argmax())]
            raise table.error("segments",
                              f"must be closed: the piece that ends at {x:.4g}, {y:.4g} mm is "
                              f"{miss.max() * 1e3:.3g} mm away from the start of the next")
        return drawn

    def pieces(self) -> tuple[Piece, ...]:
        return self.segments


@OUTLINES.register
@dataclass(frozen=True)
class StepFile:
    """Edges of a flat face or wire in a STEP file, read once and kept as pieces."""

    shape: ClassVar[str] = "step"
    file: Annotated[str, Key("the drawing, from the folder of this file")]
    curve: Annotated[Literal["outer", "inner", "only"], Key("which of two closed curves")] = "only"

    @classmethod
    def from_table(cls, table: Table) -> Drawn:
        """Its pieces, joined."""
        drawing = read(cls, table)
        file = Path(table.file).parent / drawing.file
        try:
            return joined(drawing.pieces(file), drawing.curve)
        except InputError as error:
            raise table.error("file", error.allowed, str(file)) from None

    def pieces(self, file: Path) -> list[Piece]:
        """Pieces of the drawing in a STEP file, in any order."""
        return drawing_pieces(file, "step")


@OUTLINES.register
@dataclass(frozen=True)
class DxfFile(StepFile):
    """Lines, arcs, ellipses, polylines and splines of a DXF file, read once and kept as pieces."""

    shape: ClassVar[str] = "dxf"
    layer: Annotated[str, Key("the layer it is on; * is all")] = "*"

    def pieces(self, file: Path) -> list[Piece]:
        return drawing_pieces(file, "dxf", self.layer)


def _ends(pieces: Sequence[Piece]) -> Array:
    """Where pieces start and end, shape (2, pieces, 2) [m]."""
    return np.array([piece.at(np.array([0.0, 1.0]))[0] for piece in pieces]).swapaxes(0, 1)


def joined(pieces: list[Piece], which: str = "only") -> Drawn:
    """The closed curve that pieces in any order make, or the ``outer`` or ``inner`` one of two.

    A curve that is open or branches, or is not the only one, is an :class:`InputError` with its
    place.
    """
    starts, ends = _ends(pieces)
    both = np.stack([starts, ends])
    tolerance = _JOINT * float(np.ptp(both, axis=(0, 1)).max() or np.abs(ends).max()) + 1e-12
    middles = np.array([piece.at(np.array([0.3, 0.5]))[0] for piece in pieces])
    long = np.linalg.norm(middles - starts[:, None], axis=2).max(axis=1) > tolerance
    remaining, loops = np.flatnonzero(long), list[Curve]()
    while len(remaining):
        first, remaining = int(remaining[0]), remaining[1:]
        loop, end = [pieces[first]], ends[first]
        while np.linalg.norm(end - starts[first]) > tolerance:
            away = np.linalg.norm(both[:, remaining] - end, axis=2)
            near = np.argwhere(away <= tolerance)
            if len(near) != 1:
                x, y = 1e3 * end
                words = "is open" if not len(near) else "branches"
                raise InputError(f"must be one closed curve: it {words} at {x:.6g}, {y:.6g} mm of "
                                 "the drawing")
            side, place = near[0]
            k = int(remaining[place])
            remaining = np.delete(remaining, place)
            loop.append(pieces[k] if side == 0 else pieces[k].backwards())
            end = both[1 - side, k]
        curve = Curve(tuple(loop))
        loops.append(curve if curve.area > 0 else curve.backwards())
    if not loops:
        raise InputError("must be one closed curve: all its lines are points")
    loops.sort(key=lambda curve: float(curve.area))
    if len(loops) == 2 and which != "only":
        return Drawn(loops[which == "outer"].pieces)
    if len(loops) != 1:
        (x, _), (y, _) = loops[0].box
        raise InputError(f"must hold one closed curve, but has {len(loops)}, the smallest of them "
                         f"at {1e3 * x:.6g}, {1e3 * y:.6g} mm of the drawing: name a layer, or "
                         'curve = "outer" or "inner" of two')
    return Drawn(loops[0].pieces)
