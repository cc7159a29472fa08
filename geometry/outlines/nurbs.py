"""Rational splines of drawings as cubic ones."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.geometry.outlines.pieces import Piece, graded, spline_through


def pieces_of_spline(knots: AnyArray, poles: AnyArray, weights: AnyArray, degree: int
                     ) -> list[Piece]:
    """Convert a rational spline to cubic ones of continuous curvature, cut at other knots.

    A polynomial cubic of continuous curvature is converted exactly.
    ``poles`` have shape (n, 2) [m], ``weights`` (n,), ``knots`` (n + degree + 1,).
    """
    if len(poles) <= degree or not weights.min() > 0:
        raise InputError(f"has a spline of degree {degree} with {len(poles)} poles: they must be "
                         "more than that, and their weights positive")
    from scipy.interpolate import BSpline  # heavy, and few drawings have splines

    curve = BSpline(knots, np.column_stack([poles * weights[:, None], weights]), degree)
    low, high = knots[degree], knots[-degree - 1]
    inner, times = np.unique(knots[degree + 1 : -degree - 1], return_counts=True)
    exact = degree == 3 and np.ptp(weights) == 0
    corners = inner[times > degree - 2] if not exact else inner[times > 1]
    breaks = np.concatenate([[low], inner[(inner > low) & (inner < high)], [high]])
    parts = np.concatenate([[low], corners[(corners > low) & (corners < high)], [high]])

    def local(place: AnyArray) -> tuple[AnyArray, AnyArray]:
        value, slope = curve(place), curve(place, 1)
        point = value[:, :2] / value[:, 2:]
        return point, (slope[:, :2] - point * slope[:, 2:]) / value[:, 2:]

    result: list[Piece] = []
    for start, end in pairwise(parts):
        # Places at a corner are moved inside the part, so that derivatives are those of its side.
        within_part = breaks[(breaks >= start) & (breaks <= end)].astype(float)
        inset = 1e-13 * (end - start)

        def within(place: AnyArray, low: float = start + inset,
                   high: float = end - inset) -> tuple[AnyArray, AnyArray]:
            return local(np.clip(place, low, high))

        size = float(np.ptp(poles, axis=0).max())
        knots = within_part if exact else graded(within, within_part, size)
        result.append(spline_through(knots, *within(knots)))
    return result
