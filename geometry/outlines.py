"""Closed outlines of frames and plates: one class per shape, registered once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry.tables import Rule, Table

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FullEllipse:
    """A drawing primitive: a whole ellipse around the origin with semi-axes along x and y [m]."""

    semi_axes: tuple[float, float]


class Outline(Protocol):
    """A closed curve around the origin, symmetric about both axes unless it says otherwise."""

    shape: ClassVar[str]

    @property
    def semi_axes(self) -> tuple[float, float]:
        """Half extent along x and along y [m]."""

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Axes (``"x"``, ``"y"``) whose coordinate may change sign without changing the curve."""

    def level(self, x: Array, y: Array) -> Array:
        """Negative inside, zero on the curve, positive outside; near the curve, about the distance [m]."""

    def points(self, count: int) -> Array:
        """Points on the curve, shape (2, count) [m]."""

    def primitives(self) -> tuple[FullEllipse, ...]:
        """The curve as pieces that CAD can draw exactly, in order around it."""


_SIZE: Rule = (lambda x: 1e-5 <= x <= 10, "must be positive, from 10 um to 10 m")

REGISTRY: dict[str, Callable[[Table], Outline]] = {}
Shape = TypeVar("Shape", bound="Circle | Ellipse")


def register(cls: type[Shape]) -> type[Shape]:
    """Make a shape known to specimen files under its ``shape`` name."""
    REGISTRY[cls.shape] = cls.from_table
    return cls


@register
@dataclass(frozen=True)
class Circle:
    """A circle of given radius [m]."""

    shape: ClassVar[str] = "circle"
    radius: float

    @classmethod
    def from_table(cls, table: Table) -> Circle:
        """Read ``radius``."""
        return cls(table.quantity("radius", "length", rule=_SIZE))

    @property
    def semi_axes(self) -> tuple[float, float]:
        """Half extent along x and along y [m]."""
        return self.radius, self.radius

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Both axes."""
        return frozenset("xy")

    def level(self, x: Array, y: Array) -> Array:
        """Signed distance to the circle [m]."""
        return np.hypot(x, y) - self.radius

    def points(self, count: int) -> Array:
        """Points on the curve, shape (2, count) [m]."""
        angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
        return self.radius * np.array([np.cos(angle), np.sin(angle)])

    def primitives(self) -> tuple[FullEllipse, ...]:
        """One circle."""
        return (FullEllipse(self.semi_axes),)


@register
@dataclass(frozen=True)
class Ellipse:
    """An ellipse with given semi-axes along x and y [m]; either may be the longer one."""

    shape: ClassVar[str] = "ellipse"
    semi_axes: tuple[float, float]

    @classmethod
    def from_table(cls, table: Table) -> Ellipse:
        """Read ``semi_axes``."""
        x, y = table.quantities("semi_axes", "length", rule=_SIZE, count=2)
        return cls((x, y))

    @property
    def mirror_planes(self) -> frozenset[str]:
        """Both axes."""
        return frozenset("xy")

    def level(self, x: Array, y: Array) -> Array:
        """First-order distance (level function over its gradient) [m]."""
        a, b = self.semi_axes
        root = np.sqrt((x / a) ** 2 + (y / b) ** 2)
        slope = np.sqrt((x / a**2) ** 2 + (y / b**2) ** 2) / np.maximum(root, 1e-300)
        return (root - 1) / np.maximum(slope, 1 / max(a, b))

    def points(self, count: int) -> Array:
        """Points on the curve, shape (2, count) [m]."""
        angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
        a, b = self.semi_axes
        return np.array([a * np.cos(angle), b * np.sin(angle)])

    def primitives(self) -> tuple[FullEllipse, ...]:
        """One ellipse."""
        return (FullEllipse(self.semi_axes),)


def area(outline: Outline, points: int = 2048) -> float:
    """Area inside an outline [m²]: those of two inscribed polygons, extrapolated.

    Examples
    --------
    >>> round(area(Circle(2.0)) / 4, 9)
    3.141592654
    """
    fine = outline.points(2 * points)
    coarse = fine[:, ::2]
    inside, rougher = (abs(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))) / 2 for x, y in (fine, coarse))
    return inside + (inside - rougher) / 3
