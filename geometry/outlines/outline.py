"""Outlines: what all of them share, what may be wrong with one, and the registry."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.fields import Content, FieldsAlone, Key, Registry, takes_units, write
from tympan.base.toml_reader import Rule, Table
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.pieces import MOST_PIECES, TURN, Piece, cross

#: Smallest feature over the larger half extent: shorter pieces, tighter curves and narrower necks
#: are refused.
SMALLEST = 1e-3
#: Fewest points on an outline in the search for crossings and narrow necks.
_POINTS = 6000

SIZE: Rule = (lambda x: 1e-5 * (1 - 1e-9) <= x <= 10 * (1 + 1e-9),
              "must be positive, from 10 um to 10 m")

#: Key of shapes that are given by half extents along both axes.
SEMI_AXES = Key("half extents along x and y", "length", SIZE,
                also=("width", "height", "half_axes", "axes", "size", "radius", "diameter"))


class Outline(FieldsAlone, ABC):
    """A closed curve whose bounding box is centred on the origin, counterclockwise.

    ``shape`` is its name in specimen files, ``semi_axes`` are its half extents along x and y [m].
    A shape adds its numbers, which may be complex, and :meth:`pieces`; unless it is :class:`Boxed`,
    it gives its half extents and both axes mirror it.
    """

    if TYPE_CHECKING:  # fields of some shapes, computed by others
        @property
        def shape(self) -> str: ...

        @property
        def semi_axes(self) -> tuple[float, float]: ...

    @abstractmethod
    def pieces(self) -> tuple[Piece, ...]:
        """Pieces of the curve, counterclockwise about the origin [m], which CAD draws exactly."""

    @property
    def simple(self) -> bool:
        """Whether it cannot cross itself, whatever its numbers."""
        return True

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Axes (``"x"``, ``"y"``) whose coordinate may change sign without changing the curve."""
        return frozenset("xy")

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks for a reader of the file on how the outline was found, in sentences."""
        return ()

    @cached_property
    def drawn_at(self) -> tuple[float, float] | None:
        """Centre of its box in the coordinates of its corners [m]; None for a shape by sizes."""
        return None

    @cached_property
    def curve(self) -> Curve:
        """The pieces, centred on their bounding box."""
        return Curve(self.pieces())

    @property
    def mirrored(self) -> Curve:
        """Part of the curve that gives the rest by mirroring; the whole curve if none is known."""
        return self.curve

    def level(self, x: AnyArray, y: AnyArray) -> AnyArray:
        """Negative inside, positive outside; near the curve nearly the distance [m]."""
        return self.curve.level(x, y)

    def points(self, count: int) -> AnyArray:
        """Points on the curve, shape (2, count) [m], evenly along each piece."""
        return self.curve.points(count)


class Boxed(Outline):
    """Outlines whose pieces may lie anywhere, may be without symmetry and may cross themselves.

    Half extents and mirror axes are found from the curve.
    """

    @property
    def simple(self) -> bool:
        return False

    @cached_property
    def curve(self) -> Curve:
        pieces = self.pieces()
        if len(pieces) > MOST_PIECES:
            raise InputError(f"has {len(pieces)} lines, arcs and splines: at most {MOST_PIECES} "
                             "make an outline", given=self.shape)
        return Curve(pieces).centred()

    @property
    def semi_axes(self) -> tuple[float, float]:
        (west, east), (south, north) = self.curve.box
        return (east - west) / 2, (north - south) / 2

    @property
    def mirror_planes(self) -> frozenset[str]:
        return self.curve.mirror_planes


@takes_units
@dataclass(frozen=True)
class Rotated(Boxed):
    """Another outline turned counterclockwise about the centre of its bounding box."""

    outline: Outline
    rotation: Annotated[float, Key("of any shape, counterclockwise about the centre of its box",
                                   "angle", TURN, default="0 deg")]

    @property
    def shape(self) -> str:
        return self.outline.shape

    @property
    def simple(self) -> bool:
        return self.outline.simple

    @property
    def remarks(self) -> tuple[str, ...]:
        return self.outline.remarks

    @cached_property
    def drawn_at(self) -> tuple[float, float] | None:
        drawn = self.outline.drawn_at
        if drawn is None:
            return None
        x, y = self.outline.curve.placed(self.rotation).middle
        return drawn[0] + x, drawn[1] + y

    def pieces(self) -> tuple[Piece, ...]:
        return self.outline.curve.placed(self.rotation).pieces


class OutlineRegistry(Registry[Any]):
    """Shapes; the table of any of them may have the key ``rotation``."""

    def read(self, table: Table) -> Any:
        rotation = table.number("rotation", "angle", 0.0 if table.plain else "0 rad", TURN)
        outline = super().read(table)
        return outline if rotation == 0 or outline.shape == "circle" else Rotated(outline, rotation)

    def write(self, value: Any, plain: bool = False) -> Content:
        if isinstance(value, Rotated):
            return self.write(value.outline, plain) | write(value, plain)
        return super().write(value, plain)


#: Shapes that files may name.
OUTLINES = OutlineRegistry("shape")


def check_outline(outline: Any, key: str) -> None:
    """Refuse an outline that cannot be made or meshed; the message names the place [mm].

    Such an outline runs clockwise, crosses or touches itself, or has features smaller than a
    thousandth of its size.
    """
    try:
        _check(outline)
    except InputError as error:
        raise error.located(key=key) from None


@lru_cache(maxsize=256)
def _check(outline: Any) -> None:
    holds, words = SIZE
    if not all(map(holds, outline.semi_axes)):
        raise InputError(f"its half extents {words}", given=", ".join(
            f"{1e3 * extent:.4g} mm" for extent in outline.semi_axes))
    curve = outline.mirrored
    size = float(max(outline.semi_axes))
    lengths = curve.lengths
    if lengths.min() < SMALLEST * size:
        raise _error(outline, curve.starts[lengths.argmin()],
                     f"has a piece {lengths.min() * 1e3:.3g} mm long, less than {SMALLEST:g} of "
                     f"its larger half extent of {size * 1e3:.4g} mm")
    _curvature(outline, curve, size)
    if not outline.simple:
        curve = outline.curve
        _crossing(outline, curve, size)
        if curve.area < 0:
            raise _error(outline, curve.starts[0],
                         "runs clockwise, with its inside out: list its points counterclockwise, "
                         "beginning")


def _curvature(outline: Outline, curve: Curve, size: float) -> None:
    for piece in curve.pieces:
        value, slope, bend = piece.at(np.linspace(0, 1, 8 * len(piece.breaks)))
        squared = (slope * slope).sum(axis=1)
        turn = np.abs(cross(slope, bend))
        tight = squared**1.5 < SMALLEST * size * turn
        if tight.any():
            worst = int(tight.argmax())
            radius = squared[worst] ** 1.5 / turn[worst]
            raise _error(outline, value[worst],
                         f"bends with a radius of {radius * 1e3:.3g} mm, less than "
                         f"{SMALLEST:g} of its larger half extent of {size * 1e3:.4g} mm")


def _crossing(outline: Outline, curve: Curve, size: float) -> None:
    """Refuse a curve with points near each other that are far apart along it."""
    from scipy.spatial import cKDTree

    count = max(_POINTS, 8 * len(curve.pieces))
    points = curve.points(count).T
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    along, whole = np.concatenate([[0.0], np.cumsum(steps)[:-1]]), float(steps.sum())
    near = max(SMALLEST * size, 0.75 * float(steps.max()))
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
    apart = np.abs(along[pairs[:, 0]] - along[pairs[:, 1]])
    apart = np.minimum(apart, whole - apart)
    meet = pairs[apart > 20 * near]
    if len(meet):
        for first, second in meet:
            crossing = _meeting(points, first, second)
            if crossing is not None:
                raise _error(outline, crossing, "crosses itself")
        first, second = points[meet[0, 0]], points[meet[0, 1]]
        raise _error(outline, (first + second) / 2,
                     f"has a neck narrower than {near * 1e3:.3g} mm")


def _meeting(points: AnyArray, first: int, second: int) -> AnyArray | None:
    """Find where sides of a polyline cross about two of its points; None if they do not."""
    sides = np.roll(points, -1, axis=0) - points
    i, j = ((point + np.arange(-2, 2)) % len(points) for point in (first, second))
    gap, r, s = points[j] - points[i][:, None], sides[i][:, None], sides[j]
    with np.errstate(divide="ignore", invalid="ignore"):  # of parallel sides
        t, u = cross(gap, s) / cross(r, s), cross(gap, r) / cross(r, s)
    meet = np.argwhere((t >= 0) & (t <= 1) & (u >= 0) & (u <= 1))
    if not len(meet):
        return None
    side, other = meet[0]
    return np.asarray(points[i][side] + t[side, other] * sides[i][side])


def _error(outline: Outline, place: AnyArray, words: str) -> InputError:
    x, y = np.round(1e3 * place, 9) + 0.0
    return InputError(f"{words} at {x:.4g}, {y:.4g} mm from its centre", given=outline.shape)
