"""Pieces that outlines are made of: straight lines, arcs of ellipses, cubic splines.

A piece runs from ``t = 0`` to ``t = 1``. Its numbers may be complex, so that what is computed from
a curve can be differentiated by its lengths with a complex step; what decides between cases looks
at real parts.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.fields import Key, Registry
from tympan.base.toml_reader import Rule

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

Point = tuple[Any, Any]
#: Points of a curve, and its first and second derivatives there.
LocalFrame = tuple[AnyArray, AnyArray, AnyArray]

#: Kinds of pieces that files may spell out.
PIECES: Registry[Any] = Registry("kind")

#: Most pieces of an outline; nobody draws more by hand.
MOST_PIECES = 1000
#: Most knots of a spline that follows a curve. A curve that needs more bends too sharply.
_MOST_KNOTS = 10_000

#: Distance below which two places are one [m].
_POINT = 1e-12

PLACE: Rule = (lambda x: abs(x) <= 1e3, "must be within 1 km")
_RADIUS: Rule = (lambda x: 1e-6 <= x <= 1e3, "must be from 1 um to 1 km")
_SWEEP: Rule = (lambda x: 1e-6 <= abs(x) <= 2 * np.pi + 1e-9,
                "must be an angle, not 0, of at most a whole turn")
TURN: Rule = (lambda x: abs(x) <= 1e3, "must be within 1000 rad")

_PANEL = np.pi / 8
_FINE = 1e-10
_SETTLED = 1e-13


@PIECES.register
@dataclass(frozen=True)
class Line:
    """A straight line."""

    kind: ClassVar[str] = "line"
    start: Annotated[Point, Key("where it starts", "length", PLACE)]
    end: Annotated[Point, Key("where it ends", "length", PLACE)]

    @property
    def breaks(self) -> AnyArray:
        """Parameters between which the piece is a polynomial, or nearly one."""
        return np.array([0.0, 1.0])

    def at(self, t: AnyArray) -> LocalFrame:
        """Points, first and second derivatives, shape (n, 2) each [m]."""
        start, slope = np.array(self.start), np.array(self.end) - np.array(self.start)
        slopes = np.broadcast_to(slope, (len(t), 2))
        return start + t[:, None] * slope, slopes, np.zeros_like(slopes)

    def nearest(self, places: AnyArray) -> AnyArray:
        """Parameters of the points nearest to places of shape (n, 2)."""
        (start, _), (slope, _), _ = self.at(np.arange(2.0))
        return np.asarray(np.clip((places - start) @ slope / (slope @ slope), 0, 1))

    def placed(self, angle: Any, shift: Point) -> Line:
        """Rotate the piece about the origin, then shift it."""
        return Line(_placed(self.start, angle, shift), _placed(self.end, angle, shift))

    def beside(self, distance: Any) -> Line:
        """Create the parallel piece on the right; it may be a spline.

        For a counterclockwise curve this is the outside.
        """
        (x, y), (u, v) = self.start, self.end
        length = ((u - x) ** 2 + (v - y) ** 2) ** 0.5
        dx, dy = distance * (v - y) / length, distance * (x - u) / length
        return Line((x + dx, y + dy), (u + dx, v + dy))

    def part(self, low: float, high: float) -> Line:
        """Part of the line from one parameter to another."""
        start, end = (tuple(place) for place in self.at(np.array([low, high]))[0].tolist())
        return Line(self.start if low == 0 else start, self.end if high == 1 else end)

    def between(self, start: AnyArray, end: AnyArray) -> Line:
        """Move the ends of the piece to two points nearby."""
        return Line((start[0], start[1]), (end[0], end[1]))

    def backwards(self) -> Line:
        """Reverse the piece."""
        return Line(self.end, self.start)


class Curved(ABC):
    """Base of arcs and splines: the nearest point, and the parallel curve as a spline."""

    #: Points from one break to the next at which the search for the nearest point may begin.
    each: ClassVar[int]

    @property
    @abstractmethod
    def breaks(self) -> AnyArray: ...

    @abstractmethod
    def at(self, t: AnyArray) -> LocalFrame: ...

    def nearest(self, places: AnyArray) -> AnyArray:
        """Parameters of the nearest points, by Newton's method from the two nearest samples."""
        seeds = self._tree.query(places, k=2)[1]
        near = [self._refined(places, seed) for seed in seeds.T]
        first, second = (np.linalg.norm(self.at(t)[0] - places, axis=1) for t in near)
        return np.where(first <= second, *near)

    def beside(self, distance: Any) -> Piece:
        def curve(t: AnyArray) -> tuple[AnyArray, AnyArray]:
            value, slope, bend = self.at(t)
            turn = curvature(slope, bend)[:, None]
            return value + distance * normals(slope), slope * (1 + distance * turn)

        size = float(np.abs(np.diff(self.at(self.breaks)[0], axis=0)).sum())
        knots = graded(curve, self.breaks, size)
        return spline_through(knots, *curve(knots))

    def between(self, start: AnyArray, end: AnyArray) -> Piece:
        """Move the ends of the piece; in between it moves in proportion, and becomes a spline."""
        before, after = self.at(np.array([0.0, 1.0]))[0]
        shift, more = start - before, (end - after) - (start - before)

        def curve(t: AnyArray) -> tuple[AnyArray, AnyArray]:
            value, slope, _ = self.at(t)
            return value + shift + t[:, None] * more, slope + more

        knots = graded(curve, self.breaks, float(np.ptp(self.at(self.breaks)[0], axis=0).max()))
        return spline_through(knots, *curve(knots))

    @cached_property
    def _samples(self) -> AnyArray:
        return subdivided(self.breaks, self.each)

    @cached_property
    def _tree(self) -> cKDTree:
        from scipy.spatial import cKDTree  # heavy, and not needed to read a drawing

        return cKDTree(self.at(self._samples)[0])

    def _refined(self, places: AnyArray, seed: AnyArray) -> AnyArray:
        low = self._samples[np.maximum(seed - 1, 0)]
        high = self._samples[np.minimum(seed + 1, len(self._samples) - 1)]
        t = self._samples[seed]
        for _ in range(12):
            before = t
            value, slope, bend = self.at(t)
            away = value - places
            steepness = (slope * slope).sum(axis=1)
            curvature = steepness + (away * bend).sum(axis=1)
            curvature = np.where(curvature > 0.1 * steepness, curvature, steepness)
            t = np.clip(t - (away * slope).sum(axis=1) / curvature, low, high)
            if np.abs(t - before).max(initial=0.0) < _SETTLED:
                break
        return t


@PIECES.register
@dataclass(frozen=True)
class Arc(Curved):
    """An arc of an ellipse, from the eccentric angle ``start`` over ``sweep``."""

    kind: ClassVar[str] = "arc"
    each: ClassVar[int] = 8
    centre: Annotated[Point, Key("centre of its ellipse", "length", PLACE)]
    radii: Annotated[Point, Key("semi-axes of its ellipse", "length", _RADIUS)]
    start: Annotated[Any, Key("eccentric angle where it starts", "angle", TURN)] = 0.0
    sweep: Annotated[Any, Key("how far it runs, counterclockwise if positive", "angle",
                              _SWEEP)] = 2 * np.pi
    turn: Annotated[Any, Key("direction of the first semi-axis", "angle", TURN)] = 0.0

    @property
    def circular(self) -> bool:
        """Whether it is an arc of a circle."""
        return bool(self.radii[0] == self.radii[1])

    @cached_property
    def breaks(self) -> AnyArray:
        return np.linspace(0, 1, int(np.ceil(abs(np.real(self.sweep)) / _PANEL - 1e-9)) + 1)

    def at(self, t: AnyArray) -> LocalFrame:
        a, b = self.radii
        angle = self.start + t * self.sweep
        x = np.array([a * np.cos(angle), b * np.sin(angle)])
        y = np.array([-a * np.sin(angle), b * np.cos(angle)])
        c, s = np.cos(self.turn), np.sin(self.turn)
        turn = np.array([[c, -s], [s, c]])
        return ((turn @ x).T + np.array(self.centre), (turn @ y).T * self.sweep,
                -(turn @ x).T * self.sweep**2)

    def nearest(self, places: AnyArray) -> AnyArray:
        if not self.circular:
            return super().nearest(places)
        x, y = (places - np.array(self.centre)).T
        angle = np.arctan2(y, x) - self.turn - self.start
        t = np.mod(angle * np.sign(self.sweep), 2 * np.pi) / abs(self.sweep)
        beyond = (t - 1) * abs(self.sweep) > np.pi - abs(self.sweep) / 2
        return np.where(t <= 1, t, np.where(beyond, 0.0, 1.0))

    def placed(self, angle: Any, shift: Point) -> Arc:
        return Arc(_placed(self.centre, angle, shift), self.radii, self.start, self.sweep,
                   self.turn + angle)

    def beside(self, distance: Any) -> Piece:
        if self.circular:
            radius = self.radii[0] + distance * np.sign(np.real(self.sweep))
            return Arc(self.centre, (radius, radius), self.start, self.sweep, self.turn)
        return super().beside(distance)

    def part(self, low: float, high: float) -> Arc:
        return Arc(self.centre, self.radii, self.start + low * self.sweep,
                   (high - low) * self.sweep, self.turn)

    def backwards(self) -> Arc:
        return Arc(self.centre, self.radii, self.start + self.sweep, -self.sweep, self.turn)

    def counterclockwise(self) -> Arc:
        """Make the arc counterclockwise, with angles from the larger semi-axis."""
        if self.sweep < 0:
            return self.backwards().counterclockwise()
        (a, b), right = self.radii, np.pi / 2
        return self if a >= b else Arc(self.centre, (b, a), self.start - right, self.sweep,
                                       self.turn + right)


@PIECES.register
@dataclass(frozen=True)
class Spline(Curved):
    """The cubic spline with continuous curvature through points at knots."""

    kind: ClassVar[str] = "spline"
    each: ClassVar[int] = 4
    knots: Annotated[tuple[Any, ...], Key("ascending numbers, one a point")]
    points: Annotated[tuple[Point, ...], Key("what it runs through", "length", PLACE, least=2)]
    slopes: Annotated[tuple[Point, Point], Key("derivatives by the knots at both ends", "length")]

    def __post_init__(self) -> None:
        if len(self.knots) != len(self.points) or np.diff(np.real(self.knots)).min() <= 0:
            raise InputError("must be ascending numbers, one a point", key="knots")

    @cached_property
    def breaks(self) -> AnyArray:
        knots = np.real(np.array(self.knots))
        return np.asarray((knots - knots[0]) / (knots[-1] - knots[0]))

    def at(self, t: AnyArray) -> LocalFrame:
        """Evaluate the spline; between two knots, complex ones too, ``t`` is a share of the way."""
        coefficients, widths = self._cubics
        k = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(widths) - 1)
        a, b, c, d = coefficients.take(k, axis=2)
        width = widths[k]
        u = (t - self.breaks[k]) / width
        return ((a + u * (b + u * (c + u * d))).T, ((b + u * (2 * c + 3 * u * d)) / width).T,
                ((2 * c + 6 * u * d) / width**2).T)

    @cached_property
    def _cubics(self) -> tuple[AnyArray, AnyArray]:
        """Coefficients between knots, shape (4, 2, intervals), and shares of the whole way."""
        knots: AnyArray = np.array(self.knots)
        points: AnyArray = np.array(self.points)
        step, rise = np.diff(knots)[:, None], np.diff(points, axis=0)
        slopes = np.vstack([np.array(self.slopes[:1]), self._inner_slopes(step, rise),
                            np.array(self.slopes[1:])])
        start, end = slopes[:-1] * step, slopes[1:] * step
        parts = points[:-1], start, 3 * rise - 2 * start - end, start + end - 2 * rise
        return np.array([part.T for part in parts]), np.diff(self.breaks)

    def _inner_slopes(self, step: AnyArray, rise: AnyArray) -> AnyArray:
        """Solve for the derivatives at inner knots that give continuous curvature."""
        if len(step) == 1:
            return np.empty((0, 2))
        right = 3 * (rise[:-1] / step[:-1] ** 2 + rise[1:] / step[1:] ** 2)
        right[0] -= np.array(self.slopes[0]) / step[0]
        right[-1] -= np.array(self.slopes[1]) / step[-1]
        from scipy.linalg import solve_banded

        inverse = 1 / step[:, 0]
        bands = np.zeros((3, len(right)), inverse.dtype)
        bands[0, 1:] = bands[2, :-1] = inverse[1:-1]
        bands[1] = 2 * (inverse[:-1] + inverse[1:])
        return np.asarray(solve_banded((1, 1), bands, right))

    def placed(self, angle: Any, shift: Point) -> Spline:
        first, last = (_placed(slope, angle, (0.0, 0.0)) for slope in self.slopes)
        return Spline(self.knots, tuple(_placed(point, angle, shift) for point in self.points),
                      (first, last))

    def part(self, low: float, high: float) -> Spline:
        """Part of the spline: the cubic spline through its knots in between and both ends."""
        first, width = self.knots[0], self.knots[-1] - self.knots[0]
        (start, end), slopes, _ = self.at(np.array([low, high]))
        inner = [number for number, share in enumerate(self.breaks) if low < share < high]
        knots = (first + low * width, *(self.knots[number] for number in inner),
                 first + high * width)
        points = (start, *(self.points[number] for number in inner), end)
        return spline_through(np.array(knots), np.array(points), slopes / width)

    def backwards(self) -> Spline:
        (u, v), (x, y) = self.slopes
        knots = tuple(self.knots[0] + self.knots[-1] - knot for knot in reversed(self.knots))
        return Spline(knots, self.points[::-1], ((-x, -y), (-u, -v)))


Piece = Line | Arc | Spline


def subdivided(breaks: AnyArray, each: int) -> AnyArray:
    """Divide each interval between breaks into ``each`` equal parts; the last break is 1."""
    steps = np.arange(each) / each
    return np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * steps).ravel(), 1.0)


def spline_through(knots: AnyArray, points: AnyArray, slopes: AnyArray) -> Spline:
    """Make the spline through points with given derivatives at both ends; shape (n, 2) each."""
    first, last = _pairs(slopes[[0, -1]])
    return Spline(tuple(knots.tolist()), _pairs(points), (first, last))


def graded(curve: Callable[[AnyArray], tuple[AnyArray, ...]], start: AnyArray, size: float
           ) -> AnyArray:
    """Halve intervals of knots until cubics stay within 1e-10 of the ``size`` of a curve.

    Raises
    ------
    InputError
        When the curve takes too many knots.
    """
    knots = start
    for _ in range(40):
        if len(knots) > _MOST_KNOTS:
            raise InputError("bends more sharply than can be followed")
        low, high = knots[:-1], knots[1:]
        values, slopes = curve(knots)
        step = (high - low)[:, None]
        wide = np.zeros(len(low), bool)
        for share in (0.25, 0.5, 0.75):  # at one place alone the error might just change its sign
            place, tangent = curve(low + share * (high - low))
            rest = 1 - share
            before, after = rest**2 * (1 + 2 * share), share**2 * (1 + 2 * rest)
            between = before * values[:-1] + after * values[1:]
            sloping = rest * slopes[:-1] - share * slopes[1:]
            guess = between + step * share * rest * sloping
            across = np.abs(cross(guess - place, tangent)) / np.hypot(*tangent.T)
            wide |= across > _FINE * size
        if not wide.any():
            break
        knots = np.sort(np.concatenate([knots, ((low + high) / 2)[wide]]))
    return knots


def around(points: Sequence[Point], key: str) -> tuple[Point, ...]:
    """Check points around a closed curve [m]; the first may be repeated at the end.

    Raises
    ------
    InputError
        When neighbours are one, or fewer than three are left.
    """
    size = max(abs(np.real(number)) for point in points for number in point)

    def alike(first: Point, second: Point) -> bool:
        return all(abs(np.real(u - v)) <= 1e-9 * size + _POINT
                   for u, v in zip(first, second, strict=True))

    points = tuple(points[:-1] if len(points) > 3 and alike(points[0], points[-1]) else points)
    for before, after in zip(points, (*points[1:], points[0]), strict=True):
        if alike(before, after):
            x, y = (1e3 * float(np.real(number)) for number in before)
            raise InputError(f"must be at least three points, each once: {x:.6g}, {y:.6g} mm is "
                             "there twice in a row", key=key)
    return points


def _placed(point: Point, angle: Any, shift: Point) -> Point:
    x, y = point
    if np.real(angle) == 0 == np.imag(angle):
        return x + shift[0], y + shift[1]
    c, s = np.cos(angle), np.sin(angle)
    return c * x - s * y + shift[0], s * x + c * y + shift[1]


def _pairs(points: AnyArray) -> tuple[Point, ...]:
    return tuple(map(tuple, points.tolist()))


def direction(x: Any, y: Any) -> Any:
    """Angle of a vector from the x axis [rad], to first order in imaginary parts."""
    angle = np.arctan2(np.real(y), np.real(x))
    if not (np.iscomplexobj(x) or np.iscomplexobj(y)):
        return float(angle)
    turned = np.real(x) * np.imag(y) - np.real(y) * np.imag(x)
    return angle + 1j * turned / (np.real(x) ** 2 + np.real(y) ** 2)


def cross(u: AnyArray, v: AnyArray) -> AnyArray:
    """Cross products of vectors of shape (…, 2): their z components."""
    return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])


def curvature(slope: AnyArray, bend: AnyArray) -> AnyArray:
    """Curvature [1/m] from first and second derivatives, shape (n, 2); positive to the left."""
    return np.asarray(cross(slope, bend) / np.sqrt((slope * slope).sum(axis=1)) ** 3)


def normals(slope: AnyArray) -> AnyArray:
    """Compute unit vectors to the right of the directions of travel, shape (n, 2)."""
    length = np.sqrt((slope * slope).sum(axis=1, keepdims=True))
    return np.asarray(np.column_stack([slope[:, 1], -slope[:, 0]]) / length)
