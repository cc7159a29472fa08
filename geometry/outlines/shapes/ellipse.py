"""Ellipses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from tympan.geometry.fields import Key
from tympan.geometry.outlines.outline import OUTLINES, SIZE, Symmetric
from tympan.geometry.outlines.pieces import Arc, Array, Piece


@OUTLINES.register
@dataclass(frozen=True)
class Ellipse(Symmetric):
    """An ellipse with given semi-axes along x and y [m]; either may be the longer one."""

    shape: ClassVar[str] = "ellipse"
    semi_axes: Annotated[tuple[float, float], Key("half extents along x and y", "length", SIZE)]

    @classmethod
    def example(cls) -> Ellipse:
        """The paper's large ellipse."""
        return cls((75e-3, 45e-3))

    def level(self, x: Array, y: Array) -> Array:
        """First-order distance (level function over its gradient) [m]."""
        a, b = self.semi_axes
        root = np.sqrt((x / a) ** 2 + (y / b) ** 2)
        slope = np.sqrt((x / a**2) ** 2 + (y / b**2) ** 2) / np.maximum(root, 1e-300)
        return (root - 1) / np.maximum(slope, 1 / max(a, b))

    def points(self, count: int) -> Array:
        angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
        a, b = self.semi_axes
        return np.array([a * np.cos(angle), b * np.sin(angle)])

    def pieces(self) -> tuple[Piece, ...]:
        """One arc."""
        return (Arc((0.0, 0.0), self.semi_axes),)
