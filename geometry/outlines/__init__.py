"""Closed outlines of frames and plates: one class per shape, registered once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.plugins import load_later
from tympan.base.toml_reader import Table
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.drawings import DxfFile, StepFile
from tympan.geometry.outlines.drawn import ClosedSpline, Drawn
from tympan.geometry.outlines.ellipses import Circle, Ellipse, Superellipse
from tympan.geometry.outlines.outline import OUTLINES, Outline, Rotated, check_outline
from tympan.geometry.outlines.polygons import Polygon, RegularPolygon, RoundedRectangle, Stadium

__all__ = [
    "OUTLINES", "Circle", "ClosedSpline", "Curve", "Drawn", "DxfFile", "Ellipse", "Outline",
    "Polygon", "RegularPolygon", "Rotated", "RoundedRectangle", "Stadium", "StepFile",
    "Superellipse", "area", "area_moments", "check_outline", "examples", "perimeter",
    "reshaped",
]

#: Corners of the polygon from which the moments of an outline are computed. The relative error
#: falls with the square of their number; for a circle it is about 1e-6.
_CORNERS = 4096

load_later("tympan.outlines", OUTLINES)


def examples() -> dict[str, Outline]:
    """Typical outlines by shape, 45 mm high and 45 to 75 mm wide from the centre."""
    table = Table.read(Path(__file__).with_name("examples.toml"))
    return {name: OUTLINES.read(table.table(name)) for name in table.data}


def reshaped(outline: Outline, template: Outline) -> Outline:
    """Make an outline of a template's shape, as large as another outline and turned like it.

    If files give the template's shape by half extents, it gets those of the other outline. If not,
    all its lengths are scaled until the smaller half extents are equal.
    """
    if isinstance(template, Rotated):
        template = template.outline
    if isinstance(outline, Rotated):
        made = reshaped(outline.outline, template)
        return made if template.shape == "circle" else Rotated(made, outline.rotation)
    factor = min(outline.semi_axes) / min(template.semi_axes)
    content = _scaled(OUTLINES.write(template, plain=True), factor)
    if "semi_axes_m" in content:
        content["semi_axes_m"] = list(outline.semi_axes)
    made = OUTLINES.read(Table("", content, plain=True))
    assert isinstance(made, Outline)
    return made


def _scaled(content: Any, factor: float, length: bool = False) -> Any:
    """Scale all lengths in tables by a factor."""
    if isinstance(content, dict):
        return {key: _scaled(value, factor, key.endswith("_m")) for key, value in content.items()}
    if isinstance(content, list):
        return [_scaled(value, factor, length) for value in content]
    # Twelve digits: a size is not shown as 9.9999999999 mm.
    return float(f"{factor * content:.12g}") if length and factor != 1 else content


def area(outline: Outline) -> Any:
    """Area inside an outline [m²]; complex if its lengths are."""
    return outline.curve.area


def perimeter(outline: Outline) -> Any:
    """Length of an outline [m]; complex if its lengths are."""
    return outline.curve.length


def area_moments(outline: Outline) -> tuple[float, AnyArray, AnyArray]:
    """Area [m²], centroid [m], shape (2,), and second moments about it [m⁴], shape (2, 2).

    All three are computed from a polygon through points on the curve.
    """
    p = outline.points(_CORNERS)
    q = np.roll(p, -1, axis=1)
    twice = p[0] * q[1] - p[1] * q[0]
    sign = np.sign(twice.sum())
    area = float(sign * twice.sum() / 2)
    centroid = sign * ((p + q) * twice).sum(1) / (6 * area)
    # Over the triangle 0pq: ∫ x xᵀ dA = |0pq|/12 (ppᵀ + qqᵀ + (p+q)(p+q)ᵀ).
    about_origin = sign * sum(np.einsum("ie,je,e->ij", v, v, twice) for v in (p, q, p + q)) / 24
    return area, centroid, about_origin - area * np.outer(centroid, centroid)
