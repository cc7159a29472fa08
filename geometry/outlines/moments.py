"""Area, centroid and second moments of what an outline encloses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.outlines import Outline

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moments:
    """Area [m²], centroid [m], shape (2,), second moments about it [m⁴], shape (2, 2)."""

    area: float
    centroid: Array
    second: Array


def moments(outline: Outline, count: int = 4096) -> Moments:
    """Of the polygon through ``count`` points on the curve; the relative error falls as 1/count².

    Examples
    --------
    >>> from tympan.geometry.outlines import Circle
    >>> result = moments(Circle(2.0))
    >>> bool(abs(result.area / (4 * np.pi) - 1) < 1e-6)
    True
    >>> bool(abs(result.second[0, 0] / (4 * np.pi) - 1) < 2e-6)
    True
    """
    p = outline.points(count)
    q = np.roll(p, -1, axis=1)
    twice = p[0] * q[1] - p[1] * q[0]
    sign = np.sign(twice.sum())
    area = float(sign * twice.sum() / 2)
    centroid = sign * ((p + q) * twice).sum(1) / (6 * area)
    # Over the triangle 0pq: ∫ x xᵀ dA = |0pq|/12 (ppᵀ + qqᵀ + (p+q)(p+q)ᵀ).
    about_origin = sign * sum(np.einsum("ie,je,e->ij", v, v, twice) for v in (p, q, p + q)) / 24
    return Moments(area, centroid, about_origin - area * np.outer(centroid, centroid))
