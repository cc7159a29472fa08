"""What is wrong with an outline, and where."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.curve import Curve, piece_length
from tympan.geometry.outlines.outline import Outline
from tympan.geometry.outlines.pieces import Array, cross

#: Smallest feature over the larger half extent: shorter pieces, tighter curves and narrower necks
#: are refused.
SMALLEST = 1e-3
_POINTS = 6000


def check_outline(outline: Any, key: str) -> None:
    """Refuse what encloses no area that could be made and meshed, naming the place [mm].

    That is what runs clockwise, crosses or touches itself, or has features smaller than a
    thousandth of its size.
    """
    try:
        _check(outline)
    except InputError as error:
        raise error.located(key=key) from None


@lru_cache(maxsize=256)
def _check(outline: Any) -> None:
    curve = outline.curve
    size = float(max(outline.semi_axes))
    lengths = np.array([float(piece_length(piece)) for piece in curve.pieces])
    if lengths.min() < SMALLEST * size:
        raise _error(outline, curve.starts[lengths.argmin()],
                     f"has a piece {lengths.min() * 1e3:.3g} mm long, less than {SMALLEST:g} of "
                     f"its larger half extent of {size * 1e3:.4g} mm")
    _curvature(outline, curve, size)
    if not outline.simple:
        _crossing(outline, curve, size)
        if curve.area < 0:
            raise _error(outline, curve.starts[0],
                         "runs clockwise, with its inside out: list its points counterclockwise, "
                         "beginning")


def _curvature(outline: Outline, curve: Curve, size: float) -> None:
    for piece in curve.pieces:
        value, slope, bend = piece.at(np.linspace(0, 1, 8 * len(piece.breaks)))
        squared = (slope * slope).sum(axis=1)
        turn = np.abs(cross(slope, bend))
        tight = squared**1.5 < SMALLEST * size * turn
        if tight.any():
            worst = int(tight.argmax())
            radius = squared[worst] ** 1.5 / turn[worst]
            raise _error(outline, value[worst],
                         f"bends with a radius of {radius * 1e3:.3g} mm, less than {SMALLEST:g} of "
                         f"its larger half extent of {size * 1e3:.4g} mm")


def _crossing(outline: Outline, curve: Curve, size: float) -> None:
    """Points near each other though far apart along the curve."""
    count = max(_POINTS, 8 * len(curve.pieces))
    points = curve.points(count).T
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    along, whole = np.concatenate([[0.0], np.cumsum(steps)[:-1]]), float(steps.sum())
    near = max(SMALLEST * size, 0.75 * float(steps.max()))
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
    apart = np.abs(along[pairs[:, 0]] - along[pairs[:, 1]])
    apart = np.minimum(apart, whole - apart)
    meet = pairs[apart > 20 * near]
    if len(meet):
        for first, second in meet:
            crossing = _meeting(points, first, second)
            if crossing is not None:
                raise _error(outline, crossing, "crosses itself")
        first, second = points[meet[0, 0]], points[meet[0, 1]]
        raise _error(outline, (first + second) / 2,
                     f"has a neck narrower than {near * 1e3:.3g} mm")


def _meeting(points: Array, first: int, second: int) -> Array | None:
    """Where the polyline's sides about two of its points cross, if they do."""
    sides = np.roll(points, -1, axis=0) - points
    i, j = ((point + np.arange(-2, 2)) % len(points) for point in (first, second))
    gap, r, s = points[j] - points[i][:, None], sides[i][:, None], sides[j]
    with np.errstate(divide="ignore", invalid="ignore"):  # of parallel sides
        t, u = cross(gap, s) / cross(r, s), cross(gap, r) / cross(r, s)
    meet = np.argwhere((t >= 0) & (t <= 1) & (u >= 0) & (u <= 1))
    if not len(meet):
        return None
    side, other = meet[0]
    return np.asarray(points[i][side] + t[side, other] * sides[i][side])


def _error(outline: Outline, place: Array, words: str) -> InputError:
    x, y = np.round(1e3 * place, 9) + 0.0
    return InputError(f"{words} at {x:.4g}, {y:.4g} mm from its centre",
                      given=outline.shape)
