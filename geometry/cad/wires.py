"""Outlines as wires and planar faces of OpenCASCADE's, the kernel of cadquery [mm]."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from io import BytesIO

import numpy as np

from tympan.base.arrays import Array
from tympan.base.system import missing_library
from tympan.base.units import METRE, millimetres
from tympan.geometry.outlines import Outline
from tympan.geometry.outlines.pieces import Arc, Line, Piece, Spline
from tympan.geometry.specimen import Pair

try:
    from OCP.BRepBuilderAPI import (
        BRepBuilderAPI_MakeEdge,
        BRepBuilderAPI_MakeFace,
        BRepBuilderAPI_MakeWire,
    )
    from OCP.BRepTools import BRepTools
    from OCP.Geom import Geom_Circle, Geom_Ellipse
    from OCP.GeomAPI import GeomAPI_Interpolate
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pln, gp_Pnt, gp_Trsf, gp_Vec
    from OCP.ShapeFix import ShapeFix_Face
    from OCP.TColgp import TColgp_HArray1OfPnt
    from OCP.TColStd import TColStd_HArray1OfReal
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import (
        TopoDS_Builder,
        TopoDS_Compound,
        TopoDS_Edge,
        TopoDS_Face,
        TopoDS_Shape,
        TopoDS_Wire,
    )
    from OCP.TopTools import TopTools_ListOfShape
except ImportError as error:
    if ".so" not in str(error):
        raise
    raise missing_library(error) from None

_UP = gp_Dir(0, 0, 1)


def outline_wire(outline: Outline, centre: Pair = (0.0, 0.0)) -> TopoDS_Wire:
    """Wire of an outline in the plane z = 0 [mm], its centre at a place [m]."""
    return pieces_wire(outline.curve.pieces, centre)


def pieces_wire(pieces: Sequence[Piece], centre: Pair = (0.0, 0.0)) -> TopoDS_Wire:
    """Wire of pieces that meet at their ends, in the plane z = 0 [mm], moved by ``centre`` [m]."""
    shift = gp_Trsf()
    shift.SetTranslation(gp_Vec(*millimetres(*centre), 0))
    return _wire(piece_edge(piece).Moved(TopLoc_Location(shift)) for piece in pieces)


def planar(outer: TopoDS_Wire, *inner: TopoDS_Wire) -> TopoDS_Face:
    """Face in the plane z = 0, without the repairs of cadquery: outlines are checked already."""
    builder = BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 0), _UP), outer, True)
    for wire in inner:
        builder.Add(wire)
    oriented = ShapeFix_Face(builder.Face())
    oriented.FixOrientation()
    return oriented.Face()


def brep(shapes: Iterable[TopoDS_Shape]) -> bytes:
    """Store shapes for another program with OpenCASCADE [mm]; an incomplete shape crashes it."""
    compound, builder, content = TopoDS_Compound(), TopoDS_Builder(), BytesIO()
    builder.MakeCompound(compound)
    for shape in shapes:
        builder.Add(compound, shape)
    BRepTools.Write_s(compound, content)
    return content.getvalue()


def _wire(edges: Iterable[TopoDS_Shape]) -> TopoDS_Wire:
    """Join edges in any order to one wire."""
    members, builder = TopTools_ListOfShape(), BRepBuilderAPI_MakeWire()
    for edge in edges:
        members.Append(edge)
    builder.Add(members)
    return builder.Wire()


def piece_edge(piece: Piece) -> TopoDS_Edge:
    """Edge of one piece in the plane z = 0 [mm]."""
    if isinstance(piece, Line):
        start, end = (gp_Pnt(*millimetres(*place), 0) for place in (piece.start, piece.end))
        return BRepBuilderAPI_MakeEdge(start, end).Edge()
    return _arc(piece) if isinstance(piece, Arc) else _spline(piece)


def _arc(arc: Arc) -> TopoDS_Edge:
    arc = arc.counterclockwise()
    x, y, a, b = millimetres(*arc.centre, *arc.radii)
    axes = gp_Ax2(gp_Pnt(x, y, 0), _UP, gp_Dir(np.cos(arc.turn), np.sin(arc.turn), 0))
    curve = Geom_Circle(axes, a) if a == b else Geom_Ellipse(axes, a, b)
    if arc.sweep > 2 * np.pi - 1e-12:
        return BRepBuilderAPI_MakeEdge(curve).Edge()
    return BRepBuilderAPI_MakeEdge(curve, arc.start, arc.start + arc.sweep).Edge()


def _spline(spline: Spline) -> TopoDS_Edge:
    """Edge that is cubic between the knots and has the slopes at the ends."""
    knots = TColStd_HArray1OfReal(1, len(spline.knots))
    for number, knot in enumerate(spline.knots, start=1):
        knots.SetValue(number, knot)
    curve = GeomAPI_Interpolate(_points(np.array(spline.points) * METRE), knots, False, 1e-9)
    start, end = (gp_Vec(x * METRE, y * METRE, 0) for x, y in spline.slopes)
    curve.Load(start, end, False)
    curve.Perform()
    return BRepBuilderAPI_MakeEdge(curve.Curve()).Edge()


def _points(places: Array) -> TColgp_HArray1OfPnt:
    """Places in the plane z = 0, shape (count, 2) [mm]."""
    points = TColgp_HArray1OfPnt(1, len(places))
    for number, (x, y) in enumerate(places.tolist(), start=1):
        points.SetValue(number, gp_Pnt(x, y, 0))
    return points
