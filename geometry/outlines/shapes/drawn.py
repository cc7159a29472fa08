"""Outlines piece by piece, as drawings give them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from tympan.geometry.errors import InputError
from tympan.geometry.fields import Key, read
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.outline import OUTLINES, Boxed
from tympan.geometry.outlines.pieces import PIECES, Arc, Line, Piece, Spline
from tympan.geometry.toml_reader import Table

#: How far the end of a piece may miss the start of the next, over the size of the drawing.
JOINT = 1e-6


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
        """From a file, where pieces may lie apart."""
        drawn = read(cls, table)
        if not drawn.segments:
            raise table.error("segments", "must be a list of tables, one a piece")
        ends = np.vstack([piece.at(np.ones(1))[0] for piece in drawn.segments])
        starts = np.roll(Curve(drawn.segments).starts, -1, axis=0)
        miss = np.linalg.norm(ends - starts, axis=1)
        if miss.max() > JOINT * np.ptp(ends, axis=0).max() + 1e-12:
            x, y = 1e3 * ends[int(miss.argmax())]
            raise table.error("segments",
                              f"must be closed: the piece that ends at {x:.4g}, {y:.4g} mm is "
                              f"{miss.max() * 1e3:.3g} mm away from the start of the next")
        return drawn

    @classmethod
    def example(cls) -> Drawn:
        """A bullet: a half ellipse, two lines and a spline."""
        tail = Spline((0.0, 1.0, 2.0), ((-30e-3, 45e-3), (-45e-3, 0.0), (-30e-3, -45e-3)),
                      ((-30e-3, 0.0), (30e-3, 0.0)))
        return cls((Arc((20e-3, 0.0), (40e-3, 45e-3), -np.pi / 2, np.pi),
                    Line((20e-3, 45e-3), (-30e-3, 45e-3)), tail,
                    Line((-30e-3, -45e-3), (20e-3, -45e-3))))

    @property
    def simple(self) -> bool:
        return False

    def pieces(self) -> tuple[Piece, ...]:
        return self.segments


def joined(pieces: list[Piece], which: str | None) -> Drawn:
    """The closed curve that pieces in any order make, or the ``outer`` or ``inner`` one of two.

    Raises
    ------
    InputError
        Naming the place, where a curve is open or branches, or where there is not one curve.
    """
    ends = np.array([[piece.at(np.array([t]))[0][0] for t in (0.0, 1.0)] for piece in pieces])
    tolerance = JOINT * float(np.ptp(ends.reshape(-1, 2), axis=0).max()
                              or np.max(np.abs(ends))) + 1e-12
    remaining, loops = list(range(len(pieces))), []
    while remaining:
        first = remaining.pop(0)
        loop, begin, end = [pieces[first]], ends[first, 0], ends[first, 1]
        while np.linalg.norm(end - begin) > tolerance:
            near = [(k, side) for k in remaining for side in (0, 1)
                    if np.linalg.norm(ends[k, side] - end) <= tolerance]
            if len(near) != 1:
                x, y = 1e3 * end
                words = "is open" if not near else "branches"
                raise InputError(f"must be one closed curve: it {words} at {x:.6g}, {y:.6g} mm of "
                                 "the drawing")
            k, side = near[0]
            remaining.remove(k)
            loop.append(pieces[k] if side == 0 else pieces[k].backwards())
            end = ends[k, 1 - side]
        curve = Curve(tuple(loop))
        loops.append(curve if curve.area > 0 else curve.backwards())
    loops.sort(key=lambda curve: float(curve.area))
    if len(loops) == 2 and which is not None:
        return Drawn(loops[which == "outer"].pieces)
    if len(loops) != 1:
        (x, _), (y, _) = loops[0].box
        raise InputError(f"must hold one closed curve, but has {len(loops)}, the smallest of them "
                         f"at {1e3 * x:.6g}, {1e3 * y:.6g} mm of the drawing: name a layer, or "
                         'curve = "outer" or "inner" of two')
    return Drawn(loops[0].pieces)
