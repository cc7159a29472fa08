"""Curves of DXF and STEP files as pieces of outlines [m]."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import cadquery as cq
import ezdxf.filemanagement
import ezdxf.lldxf.const
import ezdxf.units
import numpy as np
from ezdxf.enums import InsertUnits
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_TrimmedCurve
from OCP.GeomConvert import GeomConvert
from scipy.interpolate import BSpline

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.pieces import Arc, Array, Line, Piece, graded, spline_through

_MILLI = 1e-3
_FLAT = 1e-9


def dxf_pieces(file: Path, layer: str) -> list[Piece]:
    """Pieces of a layer, ``*`` of all; a drawing without units is in millimetres."""
    try:
        document = ezdxf.filemanagement.readfile(file)
    except (ezdxf.lldxf.const.DXFError, OSError, UnicodeDecodeError) as error:
        raise InputError(f"is no DXF file: {str(error).splitlines()[0]}") from None
    unit = ezdxf.units.conversion_factor(InsertUnits(document.units or 4), InsertUnits.Meters)
    entities = [entity for entity in document.modelspace() if layer in ("*", entity.dxf.layer)]
    pieces = [piece for entity in entities for piece in _of_entity(entity, unit)]
    if not pieces:
        names = sorted({entity.dxf.layer for entity in document.modelspace()})
        raise InputError("has no lines, arcs or splines on that layer; its layers are "
                         f"{', '.join(names) or 'empty'}")
    return pieces


def step_pieces(file: Path) -> list[Piece]:
    """Of all edges of a flat face or wire in a plane of constant z."""
    try:
        shapes = cq.importers.importStep(str(file)).vals()
    except Exception:  # OpenCASCADE raises nothing more specific
        raise InputError("is no STEP file") from None
    edges = [edge for shape in shapes for edge in shape.Edges()]
    if not edges:
        raise InputError("has no edges")
    box = cq.Compound.makeCompound(edges).BoundingBox()
    if any(shape.Solids() for shape in shapes) or box.zlen > 1e-6 * box.DiagonalLength:
        raise InputError("must be flat, in a plane of constant z: it reaches from z = "
                         f"{box.zmin:.4g} to {box.zmax:.4g} mm")
    return [piece for edge in edges for piece in edge_pieces(edge)]


def _of_entity(entity: Any, unit: float) -> list[Piece]:
    kind, dxf = entity.dxftype(), entity.dxf
    if kind in ("LWPOLYLINE", "POLYLINE"):
        return [piece for part in entity.virtual_entities() for piece in _of_entity(part, unit)]
    if kind not in ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"):
        if kind in ("TEXT", "MTEXT", "DIMENSION", "POINT", "HATCH"):
            return []
        raise InputError(f"has a {kind}: outlines are made of lines, arcs, ellipses, polylines and "
                         "splines")

    def place(point: Any) -> tuple[float, float]:
        if abs(point[2]) * unit > _FLAT:
            raise InputError(f"must be flat: a {kind} has a point at {point[0]:.6g}, "
                             f"{point[1]:.6g}, {point[2]:.6g}")
        return unit * point[0], unit * point[1]

    if kind == "LINE":
        return [Line(place(dxf.start), place(dxf.end))]
    if kind in ("ARC", "CIRCLE"):
        start, end = np.radians((0.0, 360.0) if kind == "CIRCLE"
                                else (dxf.start_angle, dxf.end_angle))
        sweep = float(np.mod(end - start, 2 * np.pi)) or 2 * np.pi
        return [Arc(place(dxf.center), (unit * dxf.radius,) * 2, float(start), sweep)]
    if kind == "ELLIPSE":
        x, y = unit * dxf.major_axis[0], unit * dxf.major_axis[1]
        major = float(np.hypot(x, y))
        sweep = float(np.mod(dxf.end_param - dxf.start_param, 2 * np.pi)) or 2 * np.pi
        return [Arc(place(dxf.center), (major, major * dxf.ratio), dxf.start_param, sweep,
                    float(np.arctan2(y, x)))]
    tool = entity.construction_tool()
    poles = np.array([place(point) for point in tool.control_points])
    weights = np.array(tool.weights()) if len(tool.weights()) else np.ones(len(poles))
    return _of_spline(np.array(tool.knots()), poles, weights, tool.order - 1)


def _of_spline(knots: Array, poles: Array, weights: Array, degree: int) -> list[Piece]:
    """Splines, exact where cubic, polynomial and of continuous curvature; parted elsewhere."""
    curve = BSpline(knots, np.column_stack([poles * weights[:, None], weights]), degree)
    low, high = knots[degree], knots[-degree - 1]
    inner, times = np.unique(knots[degree + 1 : -degree - 1], return_counts=True)
    exact = degree == 3 and np.ptp(weights) == 0
    corners = inner[times > degree - 2] if not exact else inner[times > 1]
    breaks = np.concatenate([[low], inner[(inner > low) & (inner < high)], [high]])
    parts = np.concatenate([[low], corners[(corners > low) & (corners < high)], [high]])

    def local(place: Array) -> tuple[Array, Array]:
        value, slope = curve(place), curve(place, 1)
        point = value[:, :2] / value[:, 2:]
        return point, (slope[:, :2] - point * slope[:, 2:]) / value[:, 2:]

    result: list[Piece] = []
    for start, end in pairwise(parts):
        # Just inside a corner, so that derivatives are those of this side.
        within_part = breaks[(breaks >= start) & (breaks <= end)].astype(float)
        inset = 1e-13 * (end - start)

        def within(place: Array, low: float = start + inset,
                   high: float = end - inset) -> tuple[Array, Array]:
            return local(np.clip(place, low, high))

        size = float(np.ptp(poles, axis=0).max())
        knots = within_part if exact else graded(within, within_part, size)
        result.append(spline_through(knots, *within(knots)))
    return result


def edge_pieces(edge: cq.Edge) -> list[Piece]:
    """An edge in a plane of constant z [mm] as pieces [m]."""
    curve = BRepAdaptor_Curve(edge.wrapped)
    first, last = curve.FirstParameter(), curve.LastParameter()
    kind = edge.geomType()
    if kind == "LINE":
        ends = (curve.Value(parameter) for parameter in (first, last))
        return [Line(*((end.X() * _MILLI, end.Y() * _MILLI) for end in ends))]
    if kind in ("CIRCLE", "ELLIPSE"):
        conic = curve.Circle() if kind == "CIRCLE" else curve.Ellipse()
        radii = ((conic.Radius(),) * 2 if kind == "CIRCLE"
                 else (conic.MajorRadius(), conic.MinorRadius()))
        up = float(np.sign(conic.Axis().Direction().Z()))
        centre, along = conic.Location(), conic.XAxis().Direction()
        return [Arc((centre.X() * _MILLI, centre.Y() * _MILLI),
                    (radii[0] * _MILLI, radii[1] * _MILLI), up * first,
                    up * (last - first), float(np.arctan2(along.Y(), along.X())))]
    handle = BRep_Tool.Curve_s(edge.wrapped, 0.0, 1.0)
    spline = GeomConvert.CurveToBSplineCurve_s(Geom_TrimmedCurve(handle, first, last))
    if spline.IsPeriodic():
        spline.SetNotPeriodic()
    poles = np.array([[spline.Pole(k).X(), spline.Pole(k).Y()]
                      for k in range(1, spline.NbPoles() + 1)]) * _MILLI
    weights = np.array([spline.Weight(k) for k in range(1, spline.NbPoles() + 1)])
    knots = np.repeat([spline.Knot(k) for k in range(1, spline.NbKnots() + 1)],
                      [spline.Multiplicity(k) for k in range(1, spline.NbKnots() + 1)])
    return _of_spline(knots, poles, weights, spline.Degree())
