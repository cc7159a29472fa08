"""Outlines piece by piece, as drawings give them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.outline import Boxed, register
from tympan.geometry.outlines.pieces import Arc, Line, Piece, Spline
from tympan.geometry.toml_reader import Table

#: How far the end of a piece may miss the start of the next, over the size of the drawing.
JOINT = 1e-6


@register
@dataclass(frozen=True)
class Drawn(Boxed):
    """Joined ``segments`` counterclockwise around a closed curve, wherever they lie [m]."""

    shape: ClassVar[str] = "drawn"
    segments: tuple[Piece, ...] = field(metadata={"discrete": True})

    @classmethod
    def from_table(cls, table: Table) -> Drawn:
        """Read ``segments``, a list of tables."""
        found = cls(tuple(_segment(inner) for inner in table.tables("segments")))
        if not found.segments:
            raise table.error("segments", "must be a list of tables, one a piece")
        ends = np.vstack([piece.at(np.ones(1))[0] for piece in found.segments])
        starts = np.roll(Curve(found.segments).starts, -1, axis=0)
        miss = np.linalg.norm(ends - starts, axis=1)
        if miss.max() > JOINT * np.ptp(ends, axis=0).max() + 1e-12:
            x, y = 1e3 * ends[int(miss.argmax())]
            raise table.error("segments",
                              f"must be closed: the piece that ends at {x:.4g}, {y:.4g} mm is "
                              f"{miss.max() * 1e3:.3g} mm away from the start of the next")
        return found

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
        """No: its pieces decide."""
        return False

    def pieces(self) -> tuple[Piece, ...]:
        """The segments."""
        return self.segments


def segment_content(piece: Piece, text: Any) -> Mapping[str, Any]:
    """A piece as a table; ``text`` writes a quantity of a dimension."""
    def lengths(points: Any) -> Any:
        return [lengths(point) for point in points] if isinstance(points, tuple) else text(points,
                                                                                           "length")

    if isinstance(piece, Line):
        return {"kind": "line", "start": lengths(piece.start), "end": lengths(piece.end)}
    if isinstance(piece, Arc):
        angles = {name: text(getattr(piece, name), "angle") for name in ("start", "sweep", "turn")}
        return {"kind": "arc", "centre": lengths(piece.centre), "radii": lengths(piece.radii),
                **angles}
    return {"kind": "spline", "knots": [float(knot) for knot in piece.knots],
            "points": lengths(piece.points),
            "slopes": lengths(piece.slopes)}


def _segment(table: Table) -> Piece:
    read = table.choice("kind", {"line": _line, "arc": _arc, "spline": _spline})
    piece = read(table)
    table.done()
    return piece


def _line(table: Table) -> Piece:
    return Line(table.pair("start", "length"), table.pair("end", "length"))


def _arc(table: Table) -> Piece:
    start, sweep, turn = (table.quantity(name, "angle") for name in ("start", "sweep", "turn"))
    return Arc(table.pair("centre", "length"), table.pair("radii", "length"), start, sweep, turn)


def _spline(table: Table) -> Piece:
    knots, points = table.numbers("knots"), table.places("points", 2)
    slopes = table.places("slopes", 2)
    if len(knots) != len(points) or len(slopes) != 2 or min(np.diff(knots)) <= 0:
        raise table.error("knots",
                          "must be ascending numbers, one a point, with slopes at both ends")
    return Spline(knots, points, (slopes[0], slopes[1]))


def joined(pieces: list[Piece], which: str | None) -> Drawn:
    """The one closed curve that pieces in any order and direction make, or the ``outer`` or ``inner`` one of two.

    Raises
    ------
    InputError
        Naming the place, where a curve is open or branches, or where there is not one curve.
    """
    ends = np.array([[piece.at(np.array([t]))[0][0] for t in (0.0, 1.0)] for piece in pieces])
    tolerance = JOINT * float(np.ptp(ends.reshape(-1, 2), axis=0).max()
                              or np.max(np.abs(ends))) + 1e-12
    left, loops = list(range(len(pieces))), []
    while left:
        first = left.pop(0)
        loop, begin, end = [pieces[first]], ends[first, 0], ends[first, 1]
        while np.linalg.norm(end - begin) > tolerance:
            near = [(k, side) for k in left for side in (0, 1)
                    if np.linalg.norm(ends[k, side] - end) <= tolerance]
            if len(near) != 1:
                x, y = 1e3 * end
                words = "is open" if not near else "branches"
                raise InputError(f"must be one closed curve: it {words} at {x:.6g}, {y:.6g} mm of the drawing")
            k, side = near[0]
            left.remove(k)
            loop.append(pieces[k] if side == 0 else pieces[k].backwards())
            end = ends[k, 1 - side]
        curve = Curve(tuple(loop))
        loops.append(curve if curve.area > 0 else curve.backwards())
    loops.sort(key=lambda curve: float(curve.area))
    if len(loops) == 2 and which is not None:
        return Drawn(loops[which == "outer"].pieces)
    if len(loops) != 1:
        (x, _), (y, _) = loops[0].box
        raise InputError(f"must hold one closed curve, but has {len(loops)}, the smallest of them at {1e3 * x:.6g}, "
                         f'{1e3 * y:.6g} mm of the drawing: name a layer, or curve = "outer" or "inner" of two')
    return Drawn(loops[0].pieces)
