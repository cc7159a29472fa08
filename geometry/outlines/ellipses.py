"""Circles, ellipses and superellipses (Lamé curves)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Annotated, Any, ClassVar

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.fields import Key
from tympan.base.toml_reader import Rule
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.outline import OUTLINES, SEMI_AXES, SIZE, Outline
from tympan.geometry.outlines.pieces import Arc, Piece, graded, spline_through

_EXPONENT: Rule = (lambda x: 2 <= x <= 20, "must be from 2 (an ellipse) to 20 (nearly a rectangle)")


@OUTLINES.register
@dataclass(frozen=True)
class Circle(Outline):
    """A circle of given radius [m]."""

    shape: ClassVar[str] = "circle"
    also: ClassVar[tuple[str, ...]] = ("round", "disc", "disk")
    radius: Annotated[float, Key("its radius", "length", SIZE,
                                 also=("diameter", "width", "semi_axes", "size"))]

    @property
    def semi_axes(self) -> tuple[float, float]:
        return self.radius, self.radius

    def level(self, x: AnyArray, y: AnyArray) -> AnyArray:
        return np.hypot(x, y) - self.radius

    def points(self, count: int) -> AnyArray:
        angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
        return self.radius * np.array([np.cos(angle), np.sin(angle)])

    def pieces(self) -> tuple[Piece, ...]:
        return (Arc((0.0, 0.0), self.semi_axes),)


@OUTLINES.register
@dataclass(frozen=True)
class Ellipse(Outline):
    """An ellipse with given semi-axes along x and y [m]; either may be the longer one."""

    shape: ClassVar[str] = "ellipse"
    also: ClassVar[tuple[str, ...]] = ("oval",)
    semi_axes: Annotated[tuple[float, float], SEMI_AXES]

    def level(self, x: AnyArray, y: AnyArray) -> AnyArray:
        """First-order distance (level function over its gradient) [m]."""
        a, b = self.semi_axes
        root = np.sqrt((x / a) ** 2 + (y / b) ** 2)
        slope = np.sqrt((x / a**2) ** 2 + (y / b**2) ** 2) / np.maximum(root, 1e-300)
        return (root - 1) / np.maximum(slope, 1 / max(a, b))

    def points(self, count: int) -> AnyArray:
        angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
        a, b = self.semi_axes
        return np.array([a * np.cos(angle), b * np.sin(angle)])

    def pieces(self) -> tuple[Piece, ...]:
        return (Arc((0.0, 0.0), self.semi_axes),)


@OUTLINES.register
@dataclass(frozen=True)
class Superellipse(Outline):
    """The curve ``|x/a|ⁿ + |y/b|ⁿ = 1``, as splines within 1e-9 of its size."""

    shape: ClassVar[str] = "superellipse"
    semi_axes: Annotated[tuple[float, float], SEMI_AXES]
    exponent: Annotated[float, Key("n: 2 is an ellipse", rule=_EXPONENT)]

    def pieces(self) -> tuple[Piece, ...]:
        """One spline in each quadrant, all through points at the same graded eccentric angles."""
        return tuple(self._spline(number) for number in range(4))

    @cached_property
    def mirrored(self) -> Curve:
        """The first quadrant."""
        return Curve((self._spline(0),))

    def points(self, count: int) -> AnyArray:
        if count % 4:
            return super().points(count)
        share = np.arange(count // 4) / (count // 4)
        places, axes = self.mirrored.pieces[0].at(share)[0], np.array(self.semi_axes)
        return np.vstack([_turned(places / axes, number) * axes for number in range(4)]).T

    def level(self, x: AnyArray, y: AnyArray) -> AnyArray:
        """Signed distance [m]; the nearest point lies in the quadrant of the place."""
        return self.mirrored.level(np.abs(x), np.abs(y))

    def _spline(self, number: int) -> Piece:
        """Spline of one quadrant; quadrants are numbered counterclockwise."""
        angles = _angles(float(np.real(self.exponent)))
        points, slopes = (_turned(part, number) * np.array(self.semi_axes)
                          for part in _quadrant(angles, self.exponent))
        return spline_through(angles, points, slopes)


def _turned(points: AnyArray, times: int) -> AnyArray:
    """Turn points, shape (n, 2), counterclockwise by quarter turns."""
    for _ in range(times):
        points = np.column_stack([-points[:, 1], points[:, 0]])
    return points


def _quadrant(angle: AnyArray, exponent: Any) -> tuple[AnyArray, ...]:
    """Compute points of the first quadrant for semi-axes 1, and derivatives by the angle.

    Both have the shape (n, 2).
    """
    c, s = np.maximum(np.cos(angle), 0.0), np.maximum(np.sin(angle), 0.0)
    c = np.where(c < 1e-15, 0.0, c)
    total = _power(c, exponent) + _power(s, exponent)
    radius = total ** (-1 / exponent)
    rate = -radius / total * (_power(s, exponent - 1) * c - _power(c, exponent - 1) * s)
    return (np.column_stack([radius * c, radius * s]),
            np.column_stack([rate * c - radius * s, rate * s + radius * c]))


def _power(base: AnyArray, exponent: Any) -> AnyArray:
    """Raise to a power that may be complex; zero stays zero."""
    positive = np.where(base > 0, base, 1.0)
    return np.where(base > 0, positive**exponent, 0.0)


@lru_cache(maxsize=1024)
def _angles(exponent: float) -> AnyArray:
    low = graded(lambda angle: _quadrant(angle, exponent), np.linspace(0, np.pi / 4, 9), 1.0)
    return np.concatenate([low, (np.pi / 2 - low[-2::-1])])
