"""Polygons with corners sharp or rounded by arcs; stadiums."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from tympan.base.errors import InputError
from tympan.base.fields import Key
from tympan.base.toml_reader import Rule
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.outline import OUTLINES, SEMI_AXES, SIZE, Boxed, Outline
from tympan.geometry.outlines.pieces import PLACE, Arc, Line, Piece, Point, around, direction

_SIDES: Rule = (lambda x: 3 <= x <= 100, "must be a whole number from 3 to 100")
_ROUNDING: Rule = (lambda x: x == 0 or 1e-6 <= x <= 10,
                   "must be 0 (sharp corners) or from 1 um to 10 m")


@OUTLINES.register
@dataclass(frozen=True)
class Stadium(Outline):
    """Half circles at both ends of the longer half extent, of the shorter one's radius."""

    shape: ClassVar[str] = "stadium"
    also: ClassVar[tuple[str, ...]] = ("slot", "obround", "pill", "racetrack")
    semi_axes: Annotated[tuple[float, float], SEMI_AXES]

    def pieces(self) -> tuple[Piece, ...]:
        a, b = self.semi_axes
        quarter = np.pi / 2
        if np.real(a) == np.real(b) and np.imag(a) == np.imag(b):
            return (Arc((0.0, 0.0), (a, a)),)
        if np.real(a) >= np.real(b):
            c = a - b
            return (Arc((c, 0.0), (b, b), -quarter, np.pi), Line((c, b), (-c, b)),
                    Arc((-c, 0.0), (b, b), quarter, np.pi), Line((-c, -b), (c, -b)))
        c = b - a
        return (Arc((0.0, c), (a, a), 0.0, np.pi), Line((-a, c), (-a, -c)),
                Arc((0.0, -c), (a, a), np.pi, np.pi), Line((a, -c), (a, c)))


@OUTLINES.register
@dataclass(frozen=True)
class RoundedRectangle(Outline):
    """A rectangle with rounded or sharp corners."""

    shape: ClassVar[str] = "rounded_rectangle"
    also: ClassVar[tuple[str, ...]] = ("rectangle", "square", "box")
    semi_axes: Annotated[tuple[float, float], replace(SEMI_AXES, doubled=("width", "height"))]
    corner_radius: Annotated[float, Key('of the corners; "0 mm" leaves them sharp', "length",
                                        _ROUNDING, also=("radius", "fillet"))]

    def __post_init__(self) -> None:
        if np.real(self.corner_radius) > min(np.real(self.semi_axes)) * (1 + 1e-12):
            raise InputError("must not exceed the smaller half side: use a stadium or a circle "
                             "there", key="corner_radius",
                             given=f"{np.real(self.corner_radius) * 1e3:.4g} mm")

    def pieces(self) -> tuple[Piece, ...]:
        a, b = self.semi_axes
        return _filleted(((a, -b), (a, b), (-a, b), (-a, -b)), self.corner_radius)


@OUTLINES.register
@dataclass(frozen=True)
class RegularPolygon(Boxed):
    """Equal sides, corners on a circle, one of them on the x axis, sharp or rounded.

    The bounding box is centred, so the corners' circle is off centre where the number of sides is
    odd.
    """

    shape: ClassVar[str] = "regular_polygon"
    also: ClassVar[tuple[str, ...]] = ("triangle", "pentagon", "hexagon", "octagon")
    sides: Annotated[int, Key("number of its sides", rule=_SIDES)]
    radius: Annotated[float, Key("of the circle through its corners", "length", SIZE,
                                 also=("diameter", "circumradius", "width", "size"))]
    fillet: Annotated[float, Key("radius of the rounded corners", "length", _ROUNDING)] = 0.0

    def pieces(self) -> tuple[Piece, ...]:
        angles = 2 * np.pi * np.arange(self.sides) / self.sides
        corners = [(self.radius * float(np.cos(angle)), self.radius * float(np.sin(angle)))
                   for angle in angles]
        return _filleted(corners, self.fillet)


@OUTLINES.register
@dataclass(frozen=True)
class Polygon(Boxed):
    """Corners at ``vertices`` counterclockwise, wherever they lie, rounded by ``fillet`` [m]."""

    shape: ClassVar[str] = "polygon"
    vertices: Annotated[tuple[tuple[float, float], ...], Key(
        "its corners, counterclockwise; the first may stand at the end again", "length", PLACE,
        least=3)]
    fillet: Annotated[float, Key("radius of the rounded corners", "length", _ROUNDING)] = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "vertices", around(self.vertices, "vertices"))

    @cached_property
    def drawn_at(self) -> tuple[float, float]:
        return Curve(self.pieces()).middle

    def pieces(self) -> tuple[Piece, ...]:
        return _filleted(self.vertices, self.fillet)


def _filleted(vertices: Sequence[Point], radius: float) -> tuple[Piece, ...]:
    """Join vertices [m] by lines, rounded there by arcs of a radius [m] unless it is 0."""
    count = len(vertices)
    arcs = [_arc(vertices[k - 1], vertices[k], vertices[(k + 1) % count], radius)
            for k in range(count)]
    size = max(abs(np.real(number)) for vertex in vertices for number in vertex)
    result: list[Piece] = []
    for k, (arc, _, leave, reach) in enumerate(arcs):
        after = (k + 1) % count
        side = _distance(vertices[k], vertices[after])
        rest = np.real(side - reach - arcs[after][3])
        if rest < -1e-12 * size:
            x, y = (1e3 * float(np.real(number)) for number in vertices[k])
            raise InputError(f"must leave room on every side: the side from {x:.4g}, {y:.4g} mm is "
                             f"{np.real(side) * 1e3:.4g} mm long, the arcs at its ends need "
                             f"{np.real(reach + arcs[after][3]) * 1e3:.4g} mm",
                             given=f"{np.real(radius) * 1e3:.4g} mm")
        if arc is not None:
            result.append(arc)
        if rest > 1e-12 * size:
            result.append(Line(leave, arcs[after][1]))
    return tuple(result)


def _arc(before: Point, corner: Point, after: Point,
         radius: float) -> tuple[Arc | None, Point, Point, float]:
    """Make the arc at a corner: the arc, its ends, and the length that it takes of both sides."""
    if np.real(radius) == 0:
        return None, corner, corner, 0.0
    (u, v), (w, z) = _unit(before, corner), _unit(corner, after)
    turn = direction(u * w + v * z, u * z - v * w)
    if abs(np.real(turn)) < 1e-9:
        return None, corner, corner, 0.0
    side = np.sign(np.real(turn))
    reach = radius * side * np.tan(turn / 2)
    start = corner[0] - reach * u, corner[1] - reach * v
    end = corner[0] + reach * w, corner[1] + reach * z
    centre = start[0] - side * radius * v, start[1] + side * radius * u
    arc = Arc(centre, (radius, radius), direction(u, v) - side * np.pi / 2, turn)
    return arc, start, end, reach


def _unit(start: Point, end: Point) -> Point:
    length = _distance(start, end)
    return (end[0] - start[0]) / length, (end[1] - start[1]) / length


def _distance(start: Point, end: Point) -> Any:
    return ((end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2) ** 0.5
