"""Pieces of outlines as cadquery edges [mm], the same curves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import make_interp_spline

from tympan.geometry.outlines.pieces import Arc, Line, Piece, Spline
from tympan.geometry.system import missing_library
from tympan.geometry.units import METRE

try:
    import cadquery as cq
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.Geom import Geom_BSplineCurve, Geom_Circle, Geom_Ellipse
    from OCP.gp import gp_Ax2, gp_Pnt
    from OCP.TColgp import TColgp_Array1OfPnt
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal
except ImportError as error:
    if ".so" not in str(error):
        raise
    raise missing_library(error) from None


def pieces_wire(pieces: Sequence[Piece], centre: tuple[float, float] = (0.0, 0.0)) -> cq.Wire:
    """Joined pieces [m] in the plane z = 0 [mm], shifted by ``centre`` [m]."""
    x, y = millimetres(*centre)
    return cq.Wire.assembleEdges([_edge(piece).moved(cq.Location((x, y, 0.0))) for piece in pieces])


def _edge(piece: Piece) -> cq.Edge:
    if isinstance(piece, Line):
        return cq.Edge.makeLine(cq.Vector(*millimetres(*piece.start)),
                                cq.Vector(*millimetres(*piece.end)))
    return _arc(piece) if isinstance(piece, Arc) else _spline(piece)


def _arc(arc: Arc) -> cq.Edge:
    if arc.sweep < 0:
        arc = arc.backwards()
    x, y, a, b = millimetres(*arc.centre, *arc.radii)
    first = arc.turn if a >= b else arc.turn + np.pi / 2
    start = arc.start if a >= b else arc.start - np.pi / 2
    axes = gp_Ax2(cq.Vector(x, y, 0).toPnt(), cq.Vector(0, 0, 1).toDir(),
                  cq.Vector(np.cos(first), np.sin(first), 0).toDir())
    curve = Geom_Circle(axes, a) if a == b else Geom_Ellipse(axes, max(a, b), min(a, b))
    if arc.sweep > 2 * np.pi - 1e-12:
        return cq.Edge(BRepBuilderAPI_MakeEdge(curve).Edge())
    return cq.Edge(BRepBuilderAPI_MakeEdge(curve, start, start + arc.sweep).Edge())


def _spline(spline: Spline) -> cq.Edge:
    """The spline as a B-spline, the same curve."""
    ends = tuple([(1, np.array(slope) * METRE)] for slope in spline.slopes)
    poles = make_interp_spline(spline.knots, np.array(spline.points) * METRE, k=3, bc_type=ends).c
    places = TColgp_Array1OfPnt(1, len(poles))
    for number, (x, y) in enumerate(poles.tolist(), 1):
        places.SetValue(number, gp_Pnt(x, y, 0.0))
    knots = TColStd_Array1OfReal(1, len(spline.knots))
    counts = TColStd_Array1OfInteger(1, len(spline.knots))
    for number, knot in enumerate(spline.knots, 1):
        knots.SetValue(number, knot)
        counts.SetValue(number, 4 if number in (1, len(spline.knots)) else 1)
    return cq.Edge(BRepBuilderAPI_MakeEdge(Geom_BSplineCurve(places, knots, counts, 3)).Edge())


def millimetres(*metres: float) -> tuple[float, ...]:
    """Rounded to the femtometre, so that equal sizes in any unit give equal CAD."""
    return tuple(round(metre * METRE, 12) for metre in metres)
