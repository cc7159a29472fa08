"""Circles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from tympan.geometry.fields import Key
from tympan.geometry.outlines.outline import OUTLINES, SIZE, Symmetric
from tympan.geometry.outlines.pieces import Arc, Array, Piece


@OUTLINES.register
@dataclass(frozen=True)
class Circle(Symmetric):
    """A circle of given radius [m]."""

    shape: ClassVar[str] = "circle"
    radius: Annotated[float, Key("its radius", "length", SIZE)]

    @classmethod
    def example(cls) -> Circle:
        """The paper's circle."""
        return cls(45e-3)

    @property
    def semi_axes(self) -> tuple[float, float]:
        return self.radius, self.radius

    def level(self, x: Array, y: Array) -> Array:
        """Signed distance to the circle [m]."""
        return np.hypot(x, y) - self.radius

    def points(self, count: int) -> Array:
        angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
        return self.radius * np.array([np.cos(angle), np.sin(angle)])

    def pieces(self) -> tuple[Piece, ...]:
        """One arc."""
        return (Arc((0.0, 0.0), self.semi_axes),)
