"""Closed outlines of frames and plates: one class per shape, registered once."""

from __future__ import annotations

from typing import Any

import numpy as np

from tympan.geometry.outlines.checks import check_outline
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.outlines.outline import OUTLINES, Outline, Pieced, Rotated
from tympan.geometry.outlines.shapes.circle import Circle
from tympan.geometry.outlines.shapes.drawn import Drawn
from tympan.geometry.outlines.shapes.ellipse import Ellipse
from tympan.geometry.outlines.shapes.files import DxfFile, StepFile
from tympan.geometry.outlines.shapes.polygon import Polygon, RegularPolygon
from tympan.geometry.outlines.shapes.rounded_rectangle import RoundedRectangle
from tympan.geometry.outlines.shapes.spline import ClosedSpline
from tympan.geometry.outlines.shapes.stadium import Stadium
from tympan.geometry.outlines.shapes.superellipse import Superellipse

__all__ = [
    "OUTLINES", "Circle", "ClosedSpline", "Curve", "Drawn", "DxfFile", "Ellipse", "Outline",
    "Pieced", "Polygon", "RegularPolygon", "Rotated", "RoundedRectangle", "Stadium",
    "StepFile", "Superellipse", "area", "check_outline", "examples", "perimeter",
]


def examples() -> dict[str, Outline]:
    """A typical outline of every shape, 45 mm high and 45 to 75 mm wide from the centre.

    Examples
    --------
    >>> "stadium" in examples()
    True
    """
    return {name: cls.example() for name, cls in OUTLINES.items() if hasattr(cls, "example")}


def area(outline: Outline) -> Any:
    """Area inside an outline [m²]; complex if its lengths are.

    Examples
    --------
    >>> round(area(Circle(2.0)) / 4, 12)
    3.14159265359
    """
    return _real(outline.curve.area)


def perimeter(outline: Outline) -> Any:
    """Length of an outline [m]; complex if its lengths are.

    Examples
    --------
    >>> round(perimeter(Circle(2.0)) / 4, 12)
    3.14159265359
    """
    return _real(outline.curve.length)


def _real(measure: Any) -> Any:
    return measure if np.iscomplexobj(measure) else float(measure)
