"""Rectangles with rounded corners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from tympan.geometry.errors import InputError
from tympan.geometry.fields import Key
from tympan.geometry.outlines.corners import filleted
from tympan.geometry.outlines.outline import OUTLINES, ROUNDING, SIZE, Symmetric
from tympan.geometry.outlines.pieces import Piece


@OUTLINES.register
@dataclass(frozen=True)
class RoundedRectangle(Symmetric):
    """A rectangle with rounded or sharp corners."""

    shape: ClassVar[str] = "rounded_rectangle"
    semi_axes: Annotated[tuple[float, float], Key("half extents along x and y", "length", SIZE)]
    corner_radius: Annotated[float, Key("of the corners; 0 leaves them sharp", "length", ROUNDING)]

    def __post_init__(self) -> None:
        """Refuse corners larger than the rectangle."""
        if np.real(self.corner_radius) > min(np.real(self.semi_axes)) * (1 + 1e-12):
            raise InputError("must not exceed the smaller half side: use a stadium or a circle "
                             "there",
                             key="corner_radius",
                             given=f"{np.real(self.corner_radius) * 1e3:.4g} mm")

    @classmethod
    def example(cls) -> RoundedRectangle:
        """As long and wide as the paper's large ellipse."""
        return cls((75e-3, 45e-3), 20e-3)

    def pieces(self) -> tuple[Piece, ...]:
        """Lines and quarter circles."""
        a, b = self.semi_axes
        return filleted(((a, -b), (a, b), (-a, b), (-a, -b)), self.corner_radius)
