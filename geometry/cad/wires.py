"""Outlines as wires and planar faces of OpenCASCADE's, the kernel of cadquery [mm].

The kernel alone takes half the time of cadquery's import, which a film meshed for the first time
would wait for.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from io import BytesIO
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from tympan.geometry.errors import InputError
from tympan.geometry.outlines import Circle, Ellipse, Outline
from tympan.geometry.outlines.pieces import Arc, Line, Piece, Spline
from tympan.geometry.specimen import Electrode, Specimen
from tympan.geometry.system import missing_library
from tympan.geometry.units import METRE

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

Pair = tuple[float, float]

#: How near an axis a piece ends that ends on it, relative to the outline.
_MEET = 1e-12

_UP = gp_Dir(0, 0, 1)
_START, _MIDDLE, _END = np.array([0.0]), np.array([0.5]), np.array([1.0])


def outline_wire(outline: Outline, centre: Pair = (0.0, 0.0)) -> TopoDS_Wire:
    """The outline in the plane z = 0 [mm], its centre at the given place [m]."""
    return _pieces_wire(outline.curve.pieces, centre)


def offset_wire(outline: Outline, centre: Pair, distance: float) -> TopoDS_Wire:
    """The parallel curve at a distance [m], outwards if positive.

    That of an ellipse or spline is within 1e-8 of its size. An outline with a sharp corner, or one
    that bends too tightly, is an :class:`InputError`. OpenCASCADE's own offset curves do not
    survive STEP into gmsh.
    """
    if isinstance(outline, Circle | Ellipse):
        return _smooth_offset(outline, centre, distance)
    curve = outline.curve
    moved = curve.beside(distance)
    backwards = [(before.at(np.array([0.5]))[1] * after.at(np.array([0.5]))[1]).sum() <= 0
                 for before, after in zip(curve.pieces, moved.pieces, strict=True)]
    shrunk = [isinstance(piece, Arc) and min(piece.radii) <= 0 for piece in moved.pieces]
    corners = np.abs(curve.turns()).max() > 1e-6
    if corners or any(backwards) or any(shrunk):
        where = "needs an outline without sharp corners" if corners else \
            "must stay below the outline's radius of curvature"
        raise InputError(f"an electrode margin {where}", key="electrode",
                         given=f"{abs(distance) * METRE:.4g} mm")
    return _pieces_wire(moved.pieces, centre)


def planar(outer: TopoDS_Wire, *inner: TopoDS_Wire) -> TopoDS_Face:
    """A face in the plane z = 0; cadquery's own repairs what outlines, checked, do not need."""
    builder = BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 0), _UP), outer, True)
    for wire in inner:
        builder.Add(wire)
    oriented = ShapeFix_Face(builder.Face())
    oriented.FixOrientation()
    return oriented.Face()


def quarter(specimen: Specimen) -> TopoDS_Face | None:
    """The film where both coordinates are positive, all of it under the electrode.

    None where the electrode leaves some bare, or an outline cannot be cut at the axes.
    """
    plate, outer = specimen.plate, _first_quadrant(specimen.frame)
    inner = _first_quadrant(plate.outline) if plate is not None else ()
    if outer is None or inner is None or specimen.electrode != Electrode():
        return None
    back = [piece.backwards() for piece in reversed(inner)]
    corner = (0.0, 0.0)
    low, high = (back[-1].at(_END)[0][0], back[0].at(_START)[0][0]) if back else (corner, corner)
    top, right = outer[-1].at(_END)[0][0], outer[0].at(_START)[0][0]
    pieces = (*outer, Line((0.0, float(top[1])), (0.0, float(high[1]))),
              *back, Line((float(low[0]), 0.0), (float(right[0]), 0.0)))
    return planar(_pieces_wire(pieces, corner))


def brep(shapes: Iterable[TopoDS_Shape]) -> bytes:
    """Shapes as another program that builds on OpenCASCADE reads them, half of one ends it [mm]."""
    compound, builder, content = TopoDS_Compound(), TopoDS_Builder(), BytesIO()
    builder.MakeCompound(compound)
    for shape in shapes:
        builder.Add(compound, shape)
    BRepTools.Write_s(compound, content)
    return content.getvalue()


def millimetres(*metres: float) -> tuple[float, ...]:
    """Rounded to the femtometre, so that equal sizes in any unit give equal CAD."""
    return tuple(round(metre * METRE, 12) for metre in metres)


def _first_quadrant(outline: Outline) -> list[Piece] | None:
    """The pieces from the x axis to the y axis; None where one crosses an axis within itself."""
    close = _MEET * max(outline.semi_axes)
    parts = [part for piece in outline.curve.pieces for part in _halved(piece, close)]
    first = next((number for number, part in enumerate(parts)
                  if _within(part) and not _within(parts[number - 1])), None)
    if first is None:
        return None
    pieces = list(takewhile(_within, (*parts[first:], *parts[:first])))
    ends = np.array([piece.at(np.array([0.0, 1.0]))[0] for piece in pieces])
    meets = max(abs(ends[0, 0, 1]), abs(ends[-1, 1, 0]), -ends.min()) < close
    return pieces if meets else None


def _within(piece: Piece) -> bool:
    """Whether its middle has positive coordinates."""
    return bool((piece.at(_MIDDLE)[0] > 0).all())


def _halved(piece: Piece, close: float) -> list[Piece]:
    """A line or an arc in parts that do not cross an axis in their middle."""
    middle = piece.at(_MIDDLE)[0][0]
    if isinstance(piece, Spline) or np.abs(middle).min() > close:
        return [piece]
    if isinstance(piece, Line):
        place = (float(middle[0]), float(middle[1]))
        halves: list[Piece] = [Line(piece.start, place), Line(place, piece.end)]
    else:
        half = piece.sweep / 2
        halves = [replace(piece, sweep=half),
                  replace(piece, start=piece.start + half, sweep=half)]
    return [part for each in halves for part in _halved(each, close)]


def _smooth_offset(outline: Circle | Ellipse, centre: Pair, distance: float) -> TopoDS_Wire:
    """As a periodic spline."""
    points = outline.points(96)
    ahead, behind = np.roll(points, -1, axis=1), np.roll(points, 1, axis=1)
    tangent = (ahead - behind) / np.hypot(*(ahead - behind))
    moved = points + distance * np.array([tangent[1], -tangent[0]])
    if np.any(np.sum((np.roll(moved, -1, axis=1) - moved) * tangent, axis=0) <= 0):
        raise InputError("an electrode margin must stay below the outline's radius of curvature",
                         key="electrode", given=f"{abs(distance) * METRE:.4g} mm")
    places = (moved + np.array(centre)[:, None]).T * METRE
    spline = GeomAPI_Interpolate(_points(places), True, 1e-6)
    spline.Perform()
    return _wire([BRepBuilderAPI_MakeEdge(spline.Curve()).Edge()])


def _pieces_wire(pieces: Sequence[Piece], centre: Pair) -> TopoDS_Wire:
    shift = gp_Trsf()
    shift.SetTranslation(gp_Vec(*millimetres(*centre), 0))
    return _wire(_edge(piece).Moved(TopLoc_Location(shift)) for piece in pieces)


def _wire(edges: Iterable[TopoDS_Shape]) -> TopoDS_Wire:
    """Edges in any order as one wire."""
    members, builder = TopTools_ListOfShape(), BRepBuilderAPI_MakeWire()
    for edge in edges:
        members.Append(edge)
    builder.Add(members)
    return builder.Wire()


def _edge(piece: Piece) -> TopoDS_Edge:
    if isinstance(piece, Line):
        start, end = (gp_Pnt(*millimetres(*place), 0) for place in (piece.start, piece.end))
        return BRepBuilderAPI_MakeEdge(start, end).Edge()
    return _arc(piece) if isinstance(piece, Arc) else _spline(piece)


def _arc(arc: Arc) -> TopoDS_Edge:
    if arc.sweep < 0:
        arc = arc.backwards()
    x, y, a, b = millimetres(*arc.centre, *arc.radii)
    first = arc.turn if a >= b else arc.turn + np.pi / 2
    start = arc.start if a >= b else arc.start - np.pi / 2
    axes = gp_Ax2(gp_Pnt(x, y, 0), _UP, gp_Dir(np.cos(first), np.sin(first), 0))
    curve = Geom_Circle(axes, a) if a == b else Geom_Ellipse(axes, max(a, b), min(a, b))
    if arc.sweep > 2 * np.pi - 1e-12:
        return BRepBuilderAPI_MakeEdge(curve).Edge()
    return BRepBuilderAPI_MakeEdge(curve, start, start + arc.sweep).Edge()


def _spline(spline: Spline) -> TopoDS_Edge:
    """Cubic between its knots, with its slopes at its ends."""
    knots = TColStd_HArray1OfReal(1, len(spline.knots))
    for number, knot in enumerate(spline.knots, start=1):
        knots.SetValue(number, knot)
    curve = GeomAPI_Interpolate(_points(np.array(spline.points) * METRE), knots, False, 1e-9)
    start, end = (gp_Vec(x * METRE, y * METRE, 0) for x, y in spline.slopes)
    curve.Load(start, end, False)
    curve.Perform()
    return BRepBuilderAPI_MakeEdge(curve.Curve()).Edge()


def _points(places: NDArray[np.float64]) -> TColgp_HArray1OfPnt:
    """Places in the plane z = 0, shape (count, 2) [mm]."""
    points = TColgp_HArray1OfPnt(1, len(places))
    for number, (x, y) in enumerate(places.tolist(), start=1):
        points.SetValue(number, gp_Pnt(x, y, 0))
    return points
