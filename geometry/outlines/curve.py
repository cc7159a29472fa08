"""A closed curve of pieces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.units import METRE
from tympan.geometry.outlines.pieces import (
    Piece,
    Point,
    cross,
    curvature,
    normals,
    subdivided,
)

Foot = tuple[AnyArray, AnyArray]

#: Gauss's rule for few breaks: the length of an ellipse is exact to rounding errors.
_LONG = np.polynomial.legendre.leggauss(12)
#: Gauss's rule for many breaks: their intervals are short, so fewer points will do.
_SHORT = np.polynomial.legendre.leggauss(4)
#: Number of breaks from which on there are many.
_MANY = 64
#: Distance of a parameter from 0 or 1 below which it stands for an end of a piece.
_AT_END = 1e-12
#: Turn of direction that is a corner [rad].
_SHARP = 1e-6
#: Turn of direction from which on results warn of the film's stress at a corner [rad]. Circles
#: drawn as polygons of 30 sides and more turn by less.
_BLUNT = 0.21


@dataclass(frozen=True)
class Curve:
    """Pieces around a closed curve, each starting where the one before it ends [m]."""

    pieces: tuple[Piece, ...]

    def at(self, foot: Foot) -> tuple[AnyArray, AnyArray]:
        """Points and derivatives at feet, shape (n, 2) each [m]."""
        number, t = foot
        if len(self.pieces) == 1:
            return self.pieces[0].at(t)[:2]
        parts = {k: self.pieces[k].at(t[number == k])[:2] for k in np.unique(number)}
        kind = np.result_type(float, *(value for value, _ in parts.values()))
        value, slope = np.empty((len(t), 2), kind), np.empty((len(t), 2), kind)
        for k, part in parts.items():
            value[number == k], slope[number == k] = part
        return value, slope

    def foot(self, places: AnyArray) -> Foot:
        """Find the points of the curve nearest to places, shape (n, 2): their piece, parameter."""
        t = np.array([piece.nearest(places) for piece in self.pieces])
        if len(self.pieces) == 1:
            return np.zeros(len(places), dtype=int), t[0]
        away = np.array([np.linalg.norm(piece.at(row)[0] - places, axis=1)
                         for piece, row in zip(self.pieces, t, strict=True)])
        number = away.argmin(axis=0)
        return number, t[number, np.arange(len(places))]

    def level(self, x: AnyArray, y: AnyArray) -> AnyArray:
        """Signed distance [m], negative inside."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        places = np.column_stack([x.ravel(), y.ravel()])
        foot = self.foot(places)
        away = places - self.at(foot)[0]
        side = np.sign((away * self._normal(foot)).sum(axis=1))
        return np.asarray((side * np.linalg.norm(away, axis=1)).reshape(x.shape))

    def _normal(self, foot: Foot) -> AnyArray:
        """Outward normals; at a corner the sum of both sides', whose sign there is still right."""
        number, t = foot
        count = len(self.pieces)
        here = normals(self.at(foot)[1])
        first, last = t < _AT_END, t > 1 - _AT_END
        number = np.where(first, number - 1, np.where(last, number + 1, number)) % count
        there = normals(self.at((number, np.where(first, 1.0, np.where(last, 0.0, t))))[1])
        return here + there

    def points(self, count: int) -> AnyArray:
        """Points nearly evenly around, one at the start of each piece, shape (2, count) [m]."""
        lengths = self.lengths
        if count < 2 * len(lengths):
            fine = self.points(2 * len(lengths) * count)
            return fine[:, :: 2 * len(lengths)]
        share = lengths / lengths.sum() * (count - len(lengths))
        each = 1 + share.astype(int)
        each[np.argsort(each - 1 - share, kind="stable")[: count - each.sum()]] += 1
        return np.vstack([piece.at(np.arange(n) / n)[0]
                          for piece, n in zip(self.pieces, each, strict=True)]).T

    @cached_property
    def lengths(self) -> AnyArray:
        """Lengths of the pieces, real [m]."""
        return np.array([float(np.real(piece_length(piece))) for piece in self.pieces])

    @cached_property
    def length(self) -> Any:
        """Perimeter [m]."""
        return sum(piece_length(piece) for piece in self.pieces).item()

    @cached_property
    def area(self) -> Any:
        """Area inside [m²], negative if the curve runs clockwise."""
        return sum(_integral(piece, lambda x, y, dx, dy: (x * dy - y * dx) / 2)
                   for piece in self.pieces).item()

    @cached_property
    def box(self) -> tuple[Point, Point]:
        """Least and largest x, least and largest y [m]."""
        low_x, high_x, low_y, high_y = (self._extreme(axis, sign) for axis in range(2)
                                        for sign in (-1, 1))
        return (low_x, high_x), (low_y, high_y)

    @property
    def middle(self) -> Point:
        """Centre of its bounding box [m]."""
        x, y = ((low + high) / 2 for low, high in self.box)
        return x, y

    def _extreme(self, axis: int, sign: int) -> Any:
        reached = np.array([_extreme(piece, axis, sign) for piece in self.pieces])
        # Where two pieces reach equally far, the derivative is the mean of both.
        largest = reached.real.max()
        return sign * reached[reached.real >= largest - 1e-13 * abs(largest)].mean().item()

    @cached_property
    def mirror_planes(self) -> frozenset[str]:
        """Axes whose coordinate may change sign without moving the curve by 1e-10 of its size."""
        x, y = np.real(self.points(max(97, 3 * len(self.pieces))))
        size = max(np.abs(x).max(), np.abs(y).max())
        return frozenset(axis for axis, image in (("x", (-x, y)), ("y", (x, -y)))
                         if np.abs(self.level(*image)).max() < 1e-10 * size)

    def placed(self, angle: Any = 0.0, shift: Point = (0.0, 0.0)) -> Curve:
        """Turn the curve about the origin, then shift it."""
        return Curve(tuple(piece.placed(angle, shift) for piece in self.pieces))

    def centred(self) -> Curve:
        """Shift the curve so that its bounding box is centred on the origin."""
        x, y = self.middle
        tiny = 1e-15 * abs(self.box[0][1] - self.box[0][0])
        return self if max(abs(x), abs(y)) <= tiny else self.placed(shift=(-x, -y))

    def beside(self, distance: Any) -> Curve:
        """Make the parallel curve at a distance [m], outwards if positive, to 1e-10 of its size.

        Raises
        ------
        InputError
            When a sharp corner would tear the parallel curve, or a tight bend would fold it.
        """
        where = ""
        if np.abs(self.turns()).max() > _SHARP:
            where = ("needs an outline without sharp corners: round them with `fillet` or "
                     "`corner_radius`")
        elif any((1 + distance * piece_curvature(piece)).min() <= 0 for piece in self.pieces):
            where = "must stay below the outline's radius of curvature"
        if where:
            raise InputError(where, given=f"{abs(distance) * METRE:.4g} mm")
        return Curve(tuple(piece.beside(distance) for piece in self.pieces))

    def backwards(self) -> Curve:
        """Reverse the curve."""
        return Curve(tuple(piece.backwards() for piece in reversed(self.pieces)))

    @property
    def starts(self) -> AnyArray:
        """First points of the pieces, shape (pieces, 2) [m]."""
        return np.vstack([piece.at(np.zeros(1))[0] for piece in self.pieces])

    def sharp_corners(self, outwards: bool) -> AnyArray:
        """Corners pointing outwards, or inwards, sharply enough for a warning, shape (n, 2) [m]."""
        turns = self.turns() if outwards else -self.turns()
        return self.starts.real[turns > _BLUNT]

    def turns(self) -> AnyArray:
        """Angle by which the direction turns at the start of every piece [rad]."""
        into = np.vstack([piece.at(np.ones(1))[1] for piece in self.pieces]).real
        out = np.vstack([piece.at(np.zeros(1))[1] for piece in self.pieces]).real
        into = np.roll(into, 1, axis=0)
        return np.asarray(np.arctan2(cross(into, out), (into * out).sum(axis=1)))


def piece_length(piece: Piece) -> Any:
    """Length of a piece [m]."""
    return _integral(piece, lambda x, y, dx, dy: np.sqrt(dx * dx + dy * dy))


def piece_curvature(piece: Piece) -> AnyArray:
    """Curvature at points along a piece [1/m], positive where it turns left."""
    _, slope, bend = piece.at(subdivided(piece.breaks, 8))
    return curvature(slope, bend).real


def _integral(piece: Piece, form: Any) -> Any:
    """Integrate along a piece by Gauss's rule: 12 points between breaks, 4 if breaks are many."""
    breaks = piece.breaks
    nodes, weights = _SHORT if len(breaks) > _MANY else _LONG
    width = np.diff(breaks)[:, None] / 2
    t = (breaks[:-1, None] + width * (1 + nodes)).ravel()
    value, slope, _ = piece.at(t)
    return ((width * weights).ravel() * form(*value.T, *slope.T)).sum()


def _extreme(piece: Piece, axis: int, sign: int) -> Any:
    """Find the largest value of a coordinate times a sign; real parts alone decide where it is."""
    t = subdivided(piece.breaks, 4)
    best = int(np.argmax(sign * piece.at(t)[0][:, axis].real))
    place, low, high = t[best : best + 1], t[max(best - 1, 0)], t[min(best + 1, len(t) - 1)]
    for _ in range(8):
        _, slope, bend = (part[:, axis].real for part in piece.at(place))
        step = np.where(sign * bend < 0, slope / np.where(bend == 0, 1.0, bend), 0.0)
        before, place = place, np.clip(place - step, low, high)
        if place == before:
            break
    candidates = np.concatenate([place, t[best : best + 1]])
    values = sign * piece.at(candidates)[0][:, axis]
    return values[int(np.argmax(values.real))].item()
