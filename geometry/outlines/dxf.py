"""Curves of DXF files as pieces of outlines [m]."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ezdxf.filemanagement
import ezdxf.units
import numpy as np
from ezdxf.enums import InsertUnits

from tympan.geometry.errors import InputError
from tympan.geometry.outlines.nurbs import pieces_of_spline
from tympan.geometry.outlines.pieces import Arc, Line, Piece

#: How far from the plane z = 0 a point may be [m].
_FLAT = 1e-9


def dxf_pieces(file: Path, layer: str) -> list[Piece]:
    """Pieces of a layer, ``*`` of all; a drawing without units is in millimetres."""
    document = ezdxf.filemanagement.readfile(file)
    # A drawing without a header gets ezdxf's own, in metres.
    units = document.units if b"$INSUNITS" in file.read_bytes() else 0
    try:
        drawn_in = InsertUnits(units or 4)
    except ValueError:
        raise InputError("is drawn in units that DXF does not know: $INSUNITS is "
                         f"{units}") from None
    unit = ezdxf.units.conversion_factor(drawn_in, InsertUnits.Meters)
    drawing = document.modelspace()
    entities = [entity for entity in drawing if layer in ("*", _layer(entity))]
    pieces = [piece for entity in entities for piece in _of_entity(entity, unit)]
    if not pieces:
        names = sorted({_layer(entity) for entity in drawing})
        raise InputError("has no lines, arcs or splines on that layer; its layers are "
                         f"{', '.join(names) or 'empty'}")
    return pieces


def _layer(entity: Any) -> str:
    """The name of its layer; bytes that are no UTF-8 in a file that says so are Latin-1."""
    name: str = entity.dxf.layer
    try:
        name.encode()
    except UnicodeEncodeError:
        return name.encode("utf-8", "surrogateescape").decode("latin-1")
    return name


def _of_entity(entity: Any, unit: float) -> list[Piece]:
    kind, dxf = entity.dxftype(), entity.dxf
    if kind in ("LWPOLYLINE", "POLYLINE"):
        return [piece for part in entity.virtual_entities() for piece in _of_entity(part, unit)]
    if kind not in ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"):
        if kind in ("TEXT", "MTEXT", "DIMENSION", "POINT", "HATCH"):
            return []
        raise InputError(f"holds {kind}: outlines are made of lines, arcs, ellipses, polylines and "
                         "splines")

    def place(point: Any) -> tuple[float, float]:
        if abs(point[2]) * unit > _FLAT:
            raise InputError(f"must be flat: a {kind} has a point at {point[0]:.6g}, "
                             f"{point[1]:.6g}, {point[2]:.6g}")
        return unit * point[0], unit * point[1]

    if kind == "LINE":
        return [Line(place(dxf.start), place(dxf.end))]
    mirrored = kind != "SPLINE" and _mirrored(entity)
    if kind in ("ARC", "CIRCLE"):
        start, end = np.radians((0.0, 360.0) if kind == "CIRCLE"
                                else (dxf.start_angle, dxf.end_angle))
        sweep = float(np.mod(end - start, 2 * np.pi)) or 2 * np.pi
        x, y = place(dxf.center)
        if mirrored:
            x, start = -x, np.pi - end
        return [Arc((x, y), (unit * dxf.radius,) * 2, float(start), sweep)]
    if kind == "ELLIPSE":
        x, y = unit * dxf.major_axis[0], unit * dxf.major_axis[1]
        major = float(np.hypot(x, y))
        sweep = float(np.mod(dxf.end_param - dxf.start_param, 2 * np.pi)) or 2 * np.pi
        start = -dxf.end_param if mirrored else dxf.start_param
        return [Arc(place(dxf.center), (major, major * dxf.ratio), start, sweep,
                    float(np.arctan2(y, x)))]
    tool = entity.construction_tool()
    poles = np.array([place(point) for point in tool.control_points])
    weights = np.array(tool.weights()) if len(tool.weights()) else np.ones(len(poles))
    return pieces_of_spline(np.array(tool.knots()), poles, weights, tool.order - 1)


def _mirrored(entity: Any) -> bool:
    """Whether its plane is seen from behind, as CAD leaves what it mirrored: x runs to the left."""
    x, y, z = entity.dxf.extrusion
    if np.hypot(x, y) > _FLAT * abs(z):
        raise InputError(f"must be flat: a {entity.dxftype()} lies in a plane across "
                         f"{x:.6g}, {y:.6g}, {z:.6g}")
    return bool(z < 0)
