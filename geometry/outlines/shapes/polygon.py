"""Regular and free polygons, corners sharp or rounded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from tympan.geometry.fields import Key
from tympan.geometry.outlines.corners import filleted
from tympan.geometry.outlines.outline import OUTLINES, ROUNDING, SIZE, Boxed
from tympan.geometry.outlines.pieces import Piece
from tympan.geometry.toml_reader import Rule

_SIDES: Rule = (lambda x: x == int(x) and 3 <= x <= 100, "must be a whole number from 3 to 100")


@OUTLINES.register
@dataclass(frozen=True)
class RegularPolygon(Boxed):
    """Equal sides, corners on a circle, one of them on the x axis, sharp or rounded.

    The bounding box is centred, so the corners' circle is off centre where the number of sides is
    odd.
    """

    shape: ClassVar[str] = "regular_polygon"
    sides: Annotated[int, Key("number of its sides", rule=_SIDES)]
    radius: Annotated[float, Key("of the circle through its corners", "length", SIZE)]
    fillet: Annotated[float, Key("radius of the rounded corners", "length", ROUNDING)] = 0.0

    @classmethod
    def example(cls) -> RegularPolygon:
        """A hexagon 45 mm high from its centre."""
        return cls(6, 52e-3, 8e-3)

    def pieces(self) -> tuple[Piece, ...]:
        """Lines, and arcs between them."""
        angles = 2 * np.pi * np.arange(self.sides) / self.sides
        corners = [(self.radius * float(np.cos(angle)), self.radius * float(np.sin(angle)))
                   for angle in angles]
        return filleted(corners, self.fillet)


@OUTLINES.register
@dataclass(frozen=True)
class Polygon(Boxed):
    """Corners at ``vertices`` counterclockwise, wherever they lie, rounded by ``fillet`` [m]."""

    shape: ClassVar[str] = "polygon"
    vertices: Annotated[tuple[tuple[float, float], ...],
                        Key("its corners, counterclockwise", "length", least=3)]
    fillet: Annotated[float, Key("radius of the rounded corners", "length", ROUNDING)] = 0.0

    @classmethod
    def example(cls) -> Polygon:
        """A blunt arrow head: it has one mirror plane and a re-entrant corner."""
        return cls(((60e-3, 0.0), (-20e-3, 45e-3), (-60e-3, 38e-3), (-45e-3, 0.0), (-60e-3, -38e-3),
                    (-20e-3, -45e-3)),
                   8e-3)

    @property
    def simple(self) -> bool:
        """No: its points decide."""
        return False

    def pieces(self) -> tuple[Piece, ...]:
        """Lines, and arcs between them."""
        return filleted(self.vertices, self.fillet)
