"""Curves of STEP files, and edges of CAD, as pieces of outlines [m]."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_Transform
from OCP.BRepGProp import BRepGProp
from OCP.BRepLib import BRepLib_FindSurface
from OCP.Geom import Geom_TrimmedCurve
from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Ellipse, GeomAbs_Line, GeomAbs_Plane
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax3, gp_Dir, gp_Pln, gp_Pnt, gp_Trsf, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_ShapeEnum, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

from tympan.base.errors import InputError
from tympan.base.reader_process import at_most
from tympan.geometry.outlines.contours import DrawingSheet
from tympan.geometry.outlines.nurbs import pieces_of_spline
from tympan.geometry.outlines.pieces import Arc, Line, Piece

_MILLI = 1e-3
#: Largest distance of a flat shape from its plane, over its size.
_FLAT = 1e-6

#: Time limit of the library [s]: fifty times what a rectangle takes. A damaged file may keep it
#: busy for ever.
_LEAST = 0.25
#: Further time for every megabyte of the file [s]: eight times what a thousand lines take.
_PER_MEGABYTE = 8.0


def step_sheet(file: Path, which: str) -> DrawingSheet:
    """Read all edges of flat faces or wires, or those of one flat face of a solid; in any plane."""
    with at_most(_LEAST + _PER_MEGABYTE * file.stat().st_size / 1e6):
        reader = STEPControl_Reader()
        if reader.ReadFile(str(file)) != IFSelect_RetDone or not reader.TransferRoots():
            raise InputError("is no STEP file")
        whole = reader.OneShape()
    if not _parts(whole, TopAbs_EDGE):
        raise InputError("has no edges")
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(whole, box, False, False)
    low, high = box.CornerMin(), box.CornerMax()
    remarks = list[str]()
    solid = bool(_parts(whole, TopAbs_SOLID))
    if solid or high.Z() - low.Z() > _FLAT * low.Distance(high):
        plane = None if solid else _common_plane(whole, _FLAT * low.Distance(high))
        if plane is None:
            whole, plane, remarks = _flat_face(whole, which)
        whole = _laid_down(whole, plane)
    edges = [TopoDS.Edge_s(shape) for shape in _parts(whole, TopAbs_EDGE)]
    return DrawingSheet([piece for edge in edges for piece in edge_pieces(edge)], tuple(remarks))


def _common_plane(whole: TopoDS_Shape, thickness: float) -> gp_Pln | None:
    """Find the plane of all faces and edges; None if they have none in common."""
    surfaces = [BRepAdaptor_Surface(TopoDS.Face_s(face)) for face in _parts(whole, TopAbs_FACE)]
    found = BRepLib_FindSurface(whole, thickness, True)
    if not found.Found() or any(surface.GetType() != GeomAbs_Plane for surface in surfaces):
        return None
    return BRepAdaptor_Surface(BRepBuilderAPI_MakeFace(found.Surface(), _FLAT).Face()).Plane()


def _flat_face(whole: TopoDS_Shape, which: str) -> tuple[TopoDS_Shape, gp_Pln, list[str]]:
    """Find the ``largest`` flat face, or the ``top`` or ``bottom`` one of those parallel to it."""
    faces = list[tuple[float, TopoDS_Shape, gp_Pln]]()
    for part in _parts(whole, TopAbs_FACE):
        surface = BRepAdaptor_Surface(TopoDS.Face_s(part))
        if surface.GetType() == GeomAbs_Plane:
            amount = GProp_GProps()
            BRepGProp.SurfaceProperties_s(part, amount)
            faces.append((amount.Mass(), part, surface.Plane()))
    if not faces:
        raise InputError("has no flat face: export the flat face, or the wire, that is the outline")
    area, face, plane = max(faces, key=lambda item: item[0])
    out = _axes(plane)[0]

    def height(item: tuple[float, TopoDS_Shape, gp_Pln]) -> float:
        return float(gp_Vec(gp_Pnt(), item[2].Location()).Dot(gp_Vec(out)))

    if which != "largest":
        faces = [item for item in faces if item[2].Axis().Direction().IsParallel(out, 1e-6)]
        end = (max if which == "top" else min)(map(height, faces))
        size = max(abs(end), area**0.5)
        area, face, plane = max((item for item in faces if abs(height(item) - end) <= _FLAT * size),
                                key=lambda item: item[0])
    others = " or ".join(f'"{name}"' for name in ("largest", "top", "bottom") if name != which)
    return face, plane, [f"took the {which} flat face of the solid: face = {others} takes another"]


def _axes(plane: gp_Pln) -> tuple[gp_Dir, gp_Dir]:
    """Directions from which a plane is seen (above, the front, the right) and to its right."""
    out = plane.Axis().Direction()
    x, y, z = (0.0 if abs(part) < _FLAT else part for part in (out.X(), out.Y(), out.Z()))
    if (z or -y or x) < 0:
        out = out.Reversed()
    if not (x or y):
        return out, gp_Dir(1, 0, 0)
    return out, gp_Dir(0, 0, 1).Crossed(out)


def _laid_down(shape: TopoDS_Shape, plane: gp_Pln) -> TopoDS_Shape:
    """Turn a shape so that its plane has constant z; a horizontal one stays in place."""
    out, right = _axes(plane)
    turn = gp_Trsf()
    turn.SetTransformation(gp_Ax3(), gp_Ax3(gp_Pnt(), out, right))
    return BRepBuilderAPI_Transform(shape, turn, True).Shape()


def _parts(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> list[TopoDS_Shape]:
    parts = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, parts)
    return [parts.FindKey(number) for number in range(1, parts.Extent() + 1)]


def edge_pieces(edge: TopoDS_Edge) -> list[Piece]:
    """Convert an edge in a plane of constant z [mm] to pieces [m]."""
    curve = BRepAdaptor_Curve(edge)
    first, last = curve.FirstParameter(), curve.LastParameter()
    kind = curve.GetType()
    if kind == GeomAbs_Line:
        ends = (curve.Value(parameter) for parameter in (first, last))
        return [Line(*((end.X() * _MILLI, end.Y() * _MILLI) for end in ends))]
    if kind in (GeomAbs_Circle, GeomAbs_Ellipse):
        conic = curve.Circle() if kind == GeomAbs_Circle else curve.Ellipse()
        radii = ((conic.Radius(),) * 2 if kind == GeomAbs_Circle
                 else (conic.MajorRadius(), conic.MinorRadius()))
        up = float(np.sign(conic.Axis().Direction().Z()))
        centre, along = conic.Location(), conic.XAxis().Direction()
        return [Arc((centre.X() * _MILLI, centre.Y() * _MILLI),
                    (radii[0] * _MILLI, radii[1] * _MILLI), up * first,
                    up * (last - first), float(np.arctan2(along.Y(), along.X())))]
    handle = BRep_Tool.Curve_s(edge, 0.0, 1.0)
    spline = GeomConvert.CurveToBSplineCurve_s(Geom_TrimmedCurve(handle, first, last))
    if spline.IsPeriodic():
        spline.SetNotPeriodic()
    poles = np.array([[spline.Pole(k).X(), spline.Pole(k).Y()]
                      for k in range(1, spline.NbPoles() + 1)]) * _MILLI
    weights = np.array([spline.Weight(k) for k in range(1, spline.NbPoles() + 1)])
    knots = np.repeat([spline.Knot(k) for k in range(1, spline.NbKnots() + 1)],
                      [spline.Multiplicity(k) for k in range(1, spline.NbKnots() + 1)])
    return pieces_of_spline(knots, poles, weights, spline.Degree())
