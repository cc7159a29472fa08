"""What is wrong with an outline, and where."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.curve import Curve, piece_length
from tympan.geometry.outlines.outline import Outline
from tympan.geometry.outlines.pieces import Array

#: Smallest feature over the larger half extent: shorter pieces, tighter curves and narrower necks
#: are refused.
SMALLEST = 1e-3
_POINTS = 6000


def check_outline(outline: Any, key: str) -> None:
    """Refuse what encloses no area that could be made and meshed.

    Raises
    ------
    InputError
        Naming the place [mm], of an outline that runs clockwise, crosses or touches itself, or has
        features smaller than a thousandth of its size.
    """
    try:
        _check(outline)
    except InputError as error:
        raise error.located(key=key) from None


@lru_cache(maxsize=256)
def _check(outline: Any) -> None:
    curve = outline.curve
    size = float(max(outline.semi_axes))
    short = [(float(piece_length(piece)), start) for piece, start in zip(curve.pieces, curve.starts,
                                                                         strict=True)]
    length, start = min(short, key=lambda item: item[0])
    if length < SMALLEST * size:
        raise _error(outline, start,
                     f"has a piece {length * 1e3:.3g} mm long, less than {SMALLEST:g} of its "
                     f"larger half extent of {size * 1e3:.4g} mm")
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
        cross = np.abs(slope[:, 0] * bend[:, 1] - slope[:, 1] * bend[:, 0])
        tight = squared**1.5 < SMALLEST * size * cross
        if tight.any():
            worst = int(tight.argmax())
            radius = squared[worst] ** 1.5 / cross[worst]
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
    count = len(points)
    for i in range(first - 2, first + 2):
        for j in range(second - 2, second + 2):
            p, r = points[i % count], points[(i + 1) % count] - points[i % count]
            q, s = points[j % count], points[(j + 1) % count] - points[j % count]
            area = r[0] * s[1] - r[1] * s[0]
            if area == 0:
                continue
            gap = q - p
            t, u = (gap[0] * s[1] - gap[1] * s[0]) / area, (gap[0] * r[1] - gap[1] * r[0]) / area
            if 0 <= t <= 1 and 0 <= u <= 1:
                return np.asarray(p + t * r)
    return None


def _error(outline: Outline, place: Array, words: str) -> InputError:
    x, y = np.round(1e3 * place, 9) + 0.0
    return InputError(f"{words} at {x:.4g}, {y:.4g} mm from its centre",
                      given=outline.shape)
