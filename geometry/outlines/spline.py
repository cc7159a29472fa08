"""Smooth closed curves through points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.interpolate import CubicSpline

from geometry.outlines.outline import Boxed, register
from geometry.outlines.pieces import Piece, Spline
from geometry.tables import Table


@register
@dataclass(frozen=True)
class ClosedSpline(Boxed):
    """The periodic cubic spline through ``through``, points counterclockwise [m], over the length of their chords."""

    shape: ClassVar[str] = "spline"
    through: tuple[tuple[float, float], ...]

    @classmethod
    def from_table(cls, table: Table) -> ClosedSpline:
        """Read ``through``."""
        return cls(table.places("through", 3))

    @classmethod
    def example(cls) -> ClosedSpline:
        """An egg."""
        return cls(((68e-3, 0.0), (35e-3, 37e-3), (-15e-3, 45e-3), (-52e-3, 0.0), (-15e-3, -45e-3), (35e-3, -37e-3)))

    @property
    def simple(self) -> bool:
        """No: its points decide."""
        return False

    def pieces(self) -> tuple[Piece, ...]:
        """One spline between any two of the points whose knots are those of the whole curve."""
        points = np.array([*self.through, self.through[0]])
        chords = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1))
        # Knots follow the points, real parts alone: what a curve passes through decides it, not how fast.
        knots = np.concatenate([[0.0], np.cumsum(chords.real)])
        curve = CubicSpline(knots, points, bc_type="periodic")
        slopes = curve(np.array([0.0, knots[-1]]), 1)
        (u, v), (w, z) = slopes.tolist()
        return (Spline(tuple(knots.tolist()), tuple((x, y) for x, y in points.tolist()), ((u, v), (w, z))),)
