"""Smooth closed curves through points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from tympan.geometry.fields import Key
from tympan.geometry.outlines.outline import OUTLINES, Boxed
from tympan.geometry.outlines.pieces import Array, Piece, Spline


@OUTLINES.register
@dataclass(frozen=True)
class ClosedSpline(Boxed):
    """The periodic cubic spline through points, over the length of their chords."""

    shape: ClassVar[str] = "spline"
    through: Annotated[tuple[tuple[float, float], ...],
                       Key("points on it, counterclockwise", "length", least=3)]

    @classmethod
    def example(cls) -> ClosedSpline:
        """An egg."""
        return cls(((68e-3, 0.0), (35e-3, 37e-3), (-15e-3, 45e-3), (-52e-3, 0.0), (-15e-3, -45e-3),
                    (35e-3, -37e-3)))

    @property
    def simple(self) -> bool:
        """No: its points decide."""
        return False

    def pieces(self) -> tuple[Piece, ...]:
        """One spline; its knots, the lengths of chords, move with the points."""
        points = np.array([*self.through, self.through[0]])
        rise = np.diff(points, axis=0)
        step = np.sqrt((rise * rise).sum(axis=1))
        slope = tuple(_slopes(step, rise)[0].tolist())
        knots = np.concatenate([np.zeros(1), np.cumsum(step)])
        return (Spline(tuple(knots.tolist()), tuple((x, y) for x, y in points.tolist()),
                       (slope, slope)),)


def _slopes(step: Array, rise: Array) -> Array:
    """Derivatives at the points that make the curvature continuous around the curve."""
    before, count = np.roll(1 / step, 1), len(step)
    here = np.arange(count)
    matrix = np.zeros((count, count), step.dtype)
    matrix[here, here] = 2 * (before + 1 / step)
    matrix[here, here - 1] += before
    matrix[here, (here + 1) % count] += 1 / step
    steep = rise / step[:, None] ** 2
    return np.asarray(np.linalg.solve(matrix, 3 * (steep + np.roll(steep, 1, axis=0))))
