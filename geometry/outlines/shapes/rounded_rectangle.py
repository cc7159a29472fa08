"""Rectangles with rounded corners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tympan.geometry.outlines.corners import filleted
from tympan.geometry.outlines.outline import ROUNDING, SIZE, Symmetric, register
from tympan.geometry.outlines.pieces import Piece
from tympan.geometry.toml_reader import Table


@register
@dataclass(frozen=True)
class RoundedRectangle(Symmetric):
    """A rectangle of given half sides along x and y and corner radius [m]; 0 leaves its corners sharp."""

    shape: ClassVar[str] = "rounded_rectangle"
    semi_axes: tuple[float, float]
    corner_radius: float

    @classmethod
    def from_table(cls, table: Table) -> RoundedRectangle:
        """Read ``semi_axes`` and ``corner_radius``."""
        axes = table.pair("semi_axes", "length", rule=SIZE)
        radius = table.quantity("corner_radius", "length", rule=ROUNDING)
        if radius > min(axes) * (1 + 1e-12):
            raise table.error("corner_radius",
                              "must not exceed the smaller half side: use a stadium or a circle there",
                              table.value("corner_radius"))
        return cls(axes, radius)

    @classmethod
    def example(cls) -> RoundedRectangle:
        """As long and wide as the paper's large ellipse."""
        return cls((75e-3, 45e-3), 20e-3)

    def pieces(self) -> tuple[Piece, ...]:
        """Lines and quarter circles."""
        a, b = self.semi_axes
        return filleted(((a, -b), (a, b), (-a, b), (-a, -b)), self.corner_radius)
