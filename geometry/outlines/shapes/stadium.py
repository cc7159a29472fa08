"""Stadiums: two half circles joined by straight lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from tympan.geometry.fields import Key
from tympan.geometry.outlines.outline import OUTLINES, SIZE, Symmetric
from tympan.geometry.outlines.pieces import Arc, Line, Piece


@OUTLINES.register
@dataclass(frozen=True)
class Stadium(Symmetric):
    """Half circles at both ends of the longer half extent, of the shorter one's radius."""

    shape: ClassVar[str] = "stadium"
    semi_axes: Annotated[tuple[float, float], Key("half extents along x and y", "length", SIZE)]

    @classmethod
    def example(cls) -> Stadium:
        """As long and wide as the paper's large ellipse."""
        return cls((75e-3, 45e-3))

    def pieces(self) -> tuple[Piece, ...]:
        """Arcs, and lines between them unless it is a circle."""
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
