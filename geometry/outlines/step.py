"""Curves of STEP files, and edges of CAD, as pieces of outlines [m]."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBndLib import BRepBndLib
from OCP.Geom import Geom_TrimmedCurve
from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Ellipse, GeomAbs_Line
from OCP.GeomConvert import GeomConvert
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE, TopAbs_ShapeEnum, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.nurbs import pieces_of_spline
from tympan.geometry.outlines.pieces import Arc, Line, Piece
from tympan.geometry.reader_process import at_most

_MILLI = 1e-3

#: Time that the library may take [s]: fifty times what a rectangle takes. A damaged file may keep
#: it busy for ever.
_LEAST = 0.25
#: Further time for every megabyte of the file [s]: eight times what a thousand lines take.
_PER_MEGABYTE = 8.0


def step_pieces(file: Path) -> list[Piece]:
    """Read the pieces of all edges of a flat face or wire in a plane of constant z."""
    with at_most(_LEAST + _PER_MEGABYTE * file.stat().st_size / 1e6):
        reader = STEPControl_Reader()
        if reader.ReadFile(str(file)) != IFSelect_RetDone or not reader.TransferRoots():
            raise InputError("is no STEP file")
        whole = reader.OneShape()
    edges = [TopoDS.Edge_s(shape) for shape in _parts(whole, TopAbs_EDGE)]
    if not edges:
        raise InputError("has no edges")
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(whole, box, False, False)
    low, high = box.CornerMin(), box.CornerMax()
    if _parts(whole, TopAbs_SOLID) or high.Z() - low.Z() > 1e-6 * low.Distance(high):
        raise InputError("must be flat, in a plane of constant z: it reaches from z = "
                         f"{low.Z():.4g} to {high.Z():.4g} mm")
    return [piece for edge in edges for piece in edge_pieces(edge)]


def _parts(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> list[TopoDS_Shape]:
    parts = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, parts)
    return [parts.FindKey(number) for number in range(1, parts.Extent() + 1)]


def edge_pieces(edge: TopoDS_Edge) -> list[Piece]:
    """An edge in a plane of constant z [mm] as pieces [m]."""
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
