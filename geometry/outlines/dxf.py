"""Curves of DXF files as pieces of outlines [m]."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import ezdxf.filemanagement
import ezdxf.units
import numpy as np
from ezdxf.enums import InsertUnits

from tympan.base.errors import InputError
from tympan.base.units import quantity
from tympan.geometry.outlines.contours import MOST_CURVES, DrawingSheet
from tympan.geometry.outlines.nurbs import pieces_of_spline
from tympan.geometry.outlines.pieces import Arc, Line, Piece

#: Largest distance of points from one plane of constant z [m].
_FLAT = 1e-9
#: Size of a drawing [m], read in mm, below which its numbers are probably metres: a film of 2 m
#: would be read as one of 2 mm.
_TINY = 2e-3
#: Deepest nesting of blocks. Only a block that contains itself goes deeper.
_DEEPEST = 20

_CURVES = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE")
#: Kinds of entities that are written on a drawing and are no part of the shape.
_NOTES = frozenset((
    "TEXT", "MTEXT", "ATTDEF", "ATTRIB", "DIMENSION", "ARC_DIMENSION", "LARGE_RADIAL_DIMENSION",
    "LEADER", "MULTILEADER", "MLEADER", "TOLERANCE", "POINT", "HATCH", "MPOLYGON", "SOLID", "TRACE",
    "IMAGE", "WIPEOUT", "VIEWPORT", "XLINE", "RAY", "OLE2FRAME", "ACAD_TABLE", "SHAPE", "LIGHT"))


def dxf_sheet(file: Path, layer: str, unit: str | None) -> DrawingSheet:
    """Read the curves of a layer, or of all visible ones (``*``); ``unit`` overrides the file's."""
    document = ezdxf.filemanagement.readfile(file)
    remarks = list[str]()
    # A drawing without a header gets ezdxf's own, in metres.
    units = document.units if b"$INSUNITS" in file.read_bytes() else 0
    if unit is not None:
        length, source = quantity(f"1 {unit}", "length"), ""
    else:
        try:
            drawn_in = InsertUnits(units or 4)
        except ValueError:
            raise InputError(f"is drawn in units that DXF does not know: $INSUNITS is {units}: "
                             'say what its numbers are, such as unit = "mm"') from None
        length = ezdxf.units.conversion_factor(drawn_in, InsertUnits.Meters)
        source = (f". The file says that its numbers are in {drawn_in.name.lower()} ($INSUNITS "
                  f"{units})" if units else ". The file has no units: its numbers were read in mm")
        source += ': if they are in another unit, add unit = "mm", or whichever it is'
    drawing = document.modelspace()
    hidden = {item.dxf.name.lower() for item in document.layers
              if layer == "*" and (item.is_off() or item.is_frozen())}
    reading = _Reading(layer, hidden, length)
    pieces = [piece for entity in drawing for piece in reading.of(entity, _layer(entity))]
    if not pieces:
        names = ", ".join(sorted({_layer(entity) for entity in drawing}))
        rest = ", ".join(f"{count} {kind}" for kind, count in sorted(reading.left.items()))
        where = "" if layer == "*" else " on that layer"
        raise InputError(f"has no lines, arcs or splines{where}; its layers are {names or 'empty'}"
                         + (f"; it has {rest}, which are no curves: draw the outline with lines, "
                            "arcs, polylines or splines" if rest else ""))
    if unit is None and not units:
        remarks.append('the file has no units and is read in mm: unit = "in" or another '
                       "overrides that" + _guess(pieces))
    if reading.off:
        remarks.append(f"left out layers that are switched off: {', '.join(sorted(reading.off))}")
    return DrawingSheet(pieces, tuple(remarks), source)


def _guess(pieces: list[Piece]) -> str:
    """Advise on the unit if a drawing read in mm is too small for a film."""
    thirds = np.array([0.0, 1 / 3, 2 / 3])
    size = np.ptp(np.vstack([piece.at(thirds)[0] for piece in pieces]), axis=0).max()
    return "" if size > _TINY else (f"; the drawing is then less than {1e3 * _TINY:g} mm wide: its "
                                    'numbers look like metres, unit = "m"')


def _layer(entity: Any) -> str:
    """Name of an entity's layer; bytes that are not UTF-8 are read as Latin-1."""
    name: str = entity.dxf.layer
    try:
        name.encode()
    except UnicodeEncodeError:
        return name.encode("utf-8", "surrogateescape").decode("latin-1")
    return name


class _Reading:
    """A reader of one layer: the plane of the points read so far, and what was left out."""

    def __init__(self, layer: str, hidden: set[str], unit: float) -> None:
        self.layer, self.hidden, self.unit = layer, hidden, unit
        self.height: float | None = None
        self.left, self.off, self.count = Counter[str](), set[str](), 0

    def of(self, entity: Any, layer: str, deep: int = 0) -> Iterator[Piece]:
        """Yield the pieces of a curve or a block on a layer."""
        kind = entity.dxftype()
        if layer.lower() in self.hidden or entity.dxf.get("invisible", 0):
            self.off.add(layer)
        elif kind == "INSERT":
            if deep > _DEEPEST:
                raise InputError(f"has the block {entity.dxf.name} within itself")
            copies = entity.multi_insert() if entity.mcount > 1 else [entity]
            for copy in copies:
                for part in copy.virtual_entities(skipped_entity_callback=self._refused):
                    # An entity on layer 0 of a block takes the layer of the block.
                    inner = _layer(part)
                    yield from self.of(part, layer if inner == "0" else inner, deep + 1)
        elif self.layer not in ("*", layer):
            return
        elif kind in _NOTES:
            self.left[kind] += 1
        elif kind in _CURVES:
            self.count += 1
            if self.count > MOST_CURVES:
                raise InputError(f"has more than {MOST_CURVES} lines, arcs and splines, counting "
                                 "those of its blocks")
            yield from self._curve(entity, kind)
        else:
            self._refused(entity, "")

    def _refused(self, entity: Any, _: str) -> None:
        raise InputError(f"holds {entity.dxftype()}, which is no curve in a plane: outlines are "
                         "made of lines, arcs, ellipses, polylines and splines. Delete it or "
                         "export its edges as such, or name the layer of the outline with layer")

    def _place(self, point: Any, kind: str, mirrored: bool = False) -> tuple[float, float]:
        height = self.unit * (-point[2] if mirrored else point[2])
        self.height = height if self.height is None else self.height
        if abs(height - self.height) > _FLAT:
            raise InputError(f"must be flat: a {kind} has a point at {point[0]:.6g}, "
                             f"{point[1]:.6g}, {point[2]:.6g}: export a view from above, or name "
                             "the layer of the outline with layer")
        return self.unit * point[0], self.unit * point[1]

    def _curve(self, entity: Any, kind: str) -> Iterator[Piece]:
        dxf, unit = entity.dxf, self.unit
        if kind == "LINE":
            yield Line(self._place(dxf.start, kind), self._place(dxf.end, kind))
        elif kind in ("LWPOLYLINE", "POLYLINE"):
            yield from self._polyline(entity, kind)
        elif kind in ("ARC", "CIRCLE"):
            start, end = np.radians((0.0, 360.0) if kind == "CIRCLE"
                                    else (dxf.start_angle, dxf.end_angle))
            sweep = float(np.mod(end - start, 2 * np.pi)) or 2 * np.pi
            mirrored = _mirrored(entity)
            x, y = self._place(dxf.center, kind, mirrored)
            if mirrored:
                x, start = -x, np.pi - end
            yield Arc((x, y), (unit * dxf.radius,) * 2, float(start), sweep)
        elif kind == "ELLIPSE":
            x, y = unit * dxf.major_axis[0], unit * dxf.major_axis[1]
            major = float(np.hypot(x, y))
            sweep = float(np.mod(dxf.end_param - dxf.start_param, 2 * np.pi)) or 2 * np.pi
            start = -dxf.end_param if _mirrored(entity) else dxf.start_param
            yield Arc(self._place(dxf.center, kind), (major, major * dxf.ratio), start, sweep,
                      float(np.arctan2(y, x)))
        else:
            tool = entity.construction_tool()
            poles = np.array([self._place(point, kind) for point in tool.control_points])
            weights = np.array(tool.weights()) if len(tool.weights()) else np.ones(len(poles))
            yield from pieces_of_spline(np.array(tool.knots()), poles, weights, tool.order - 1)

    def _polyline(self, entity: Any, kind: str) -> Iterator[Piece]:
        """Yield the pieces of a polyline, without the control frame of a fitted spline."""
        light = kind == "LWPOLYLINE"
        if not light:
            if not (entity.is_2d_polyline or entity.is_3d_polyline):
                self._refused(entity, "")
            entity.vertices[:] = [item for item in entity.vertices if not item.dxf.flags & 16]
        if (any(bulge for *_, bulge in entity.get_points("xyb")) if light
                else any(vertex.dxf.get("bulge", 0) for vertex in entity.vertices)):
            for part in entity.virtual_entities():
                yield from self._curve(part, part.dxftype())
            return
        points = [self._place(point, kind) for point in
                  (entity.vertices_in_wcs() if light else entity.points_in_wcs())]
        if entity.is_closed:
            points.append(points[0])
        yield from (Line(start, end) for start, end in pairwise(points))


def _mirrored(entity: Any) -> bool:
    """Whether an entity is seen from behind, its x to the left, as CAD leaves mirrored ones."""
    x, y, z = entity.dxf.extrusion
    if np.hypot(x, y) > _FLAT * abs(z):
        raise InputError(f"must be flat: a {entity.dxftype()} lies in a plane across "
                         f"{x:.6g}, {y:.6g}, {z:.6g}")
    return bool(z < 0)
