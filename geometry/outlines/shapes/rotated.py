"""Outlines turned in their plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.outline import Boxed, Outline
from tympan.geometry.outlines.pieces import Piece


@dataclass(frozen=True)
class Rotated(Boxed):
    """Another outline turned counterclockwise by ``rotation`` [rad] about the centre of its bounding box."""

    outline: Outline
    rotation: float

    @property
    def shape(self) -> str:
        """That of the outline."""
        return self.outline.shape

    @property
    def simple(self) -> bool:
        """As the outline."""
        return self.outline.simple

    @cached_property
    def curve(self) -> Curve:
        """The outline's, turned and centred anew."""
        return self.outline.curve.placed(self.rotation).centred()

    def pieces(self) -> tuple[Piece, ...]:
        """Those of the curve."""
        return self.curve.pieces
