"""Circles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tympan.geometry.outlines.outline import SIZE, Symmetric, register
from tympan.geometry.outlines.pieces import Arc, Array, Piece
from tympan.geometry.toml_reader import Table


@register
@dataclass(frozen=True)
class Circle(Symmetric):
    """A circle of given radius [m]."""

    shape: ClassVar[str] = "circle"
    radius: float

    @classmethod
    def from_table(cls, table: Table) -> Circle:
        """Read ``radius``."""
        return cls(table.quantity("radius", "length", rule=SIZE))

    @classmethod
    def example(cls) -> Circle:
        """The paper's circle."""
        return cls(45e-3)

    @property
    def semi_axes(self) -> tuple[float, float]:
        """Half extent along x and along y [m]."""
        return self.radius, self.radius

    def level(self, x: Array, y: Array) -> Array:
        """Signed distance to the circle [m]."""
        return np.hypot(x, y) - self.radius

    def points(self, count: int) -> Array:
        """Points on the curve, shape (2, count) [m]."""
        angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
        return self.radius * np.array([np.cos(angle), np.sin(angle)])

    def pieces(self) -> tuple[Piece, ...]:
        """One arc."""
        return (Arc((0.0, 0.0), self.semi_axes),)
