"""The specimen's parts in cadquery [mm]: membrane face for meshing, frame and plate for making."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from geometry.errors import InputError
from geometry.outlines import FullEllipse, Outline
from geometry.specimen import Specimen
from geometry.system import missing_library

try:
    import cadquery as cq
except ImportError as error:
    if ".so" not in str(error):
        raise
    raise missing_library(error) from None

METRE = 1e3  #: cadquery's model unit is the millimetre


def membrane_faces(specimen: Specimen, planes: frozenset[str]) -> list[cq.Face]:
    """The flat film as faces cut along the axes through the plate's centre and along the electrode's edges.

    Parameters
    ----------
    planes
        Coordinates about whose zero the film is mirrored: only the part where they are positive is built.

    Returns
    -------
    list of cq.Face
        Faces in the plane z = 0 [mm]; neighbours share their common edges in shape, not in topology.
    """
    x, y = _millimetres(*specimen.plate.offset)
    size = 4 * METRE * max(specimen.frame.semi_axes)
    cuts = [cq.Face.makePlane(size, size, (x, y, 0), normal) for normal in ((1, 0, 0), (0, 1, 0))]
    faces = [face for outer, inner in _bands(specimen) for face in _annulus(outer, inner).split(*cuts).Faces()]
    return [face for face in faces
            if all(getattr(face.Center(), plane) > centre for plane, centre in (("x", x), ("y", y)) if plane in planes)]


def frame_part(specimen: Specimen, width: float = 8e-3, height: float = 4e-3) -> cq.Solid:
    """A frame ring of the given width and height [m] around the film."""
    inner = _wire(specimen.frame)
    outer = inner.offset2D(width * METRE)[0]
    return cq.Solid.extrudeLinear(outer, [inner], cq.Vector(0, 0, height * METRE))


def plate_part(specimen: Specimen, height: float = 2e-3) -> cq.Solid:
    """The plate as a disc of the given height [m]."""
    rim = _wire(specimen.plate.outline, specimen.plate.offset)
    return cq.Solid.extrudeLinear(rim, [], cq.Vector(0, 0, height * METRE))


def membrane_part(specimen: Specimen) -> cq.Face:
    """The film as one face between frame and plate."""
    return _annulus(_wire(specimen.frame), _wire(specimen.plate.outline, specimen.plate.offset))


def write_step(shapes: list[cq.Face] | list[cq.Solid], file: Path) -> None:
    """Shapes as one STEP file [mm]."""
    cq.exporters.export(cq.Workplane(obj=cq.Compound.makeCompound(shapes)), str(file), exportType="STEP")


def write_dxf(shapes: list[cq.Face] | list[cq.Solid], file: Path) -> None:
    """Outlines of the shapes' faces in the plane z = 0 as one DXF file [mm]."""
    flat = [face for shape in shapes for face in shape.Faces() if abs(face.BoundingBox().zmax) < 1e-9]
    wires = [wire for face in flat for wire in face.Wires()]
    cq.exporters.exportDXF(cq.Workplane("XY").add(wires), str(file))


def _wire(outline: Outline, centre: tuple[float, float] = (0.0, 0.0)) -> cq.Wire:
    """The outline in the plane z = 0 [mm], its centre at the given place [m]."""
    return cq.Wire.assembleEdges([_edge(primitive, centre) for primitive in outline.primitives()])


def _edge(primitive: FullEllipse, centre: tuple[float, float]) -> cq.Edge:
    x, y, a, b = _millimetres(*centre, *primitive.semi_axes)
    place, up = cq.Vector(x, y, 0), cq.Vector(0, 0, 1)
    if a == b:
        return cq.Edge.makeCircle(a, place, up)
    along = cq.Vector(1, 0, 0) if a > b else cq.Vector(0, 1, 0)
    return cq.Edge.makeEllipse(max(a, b), min(a, b), place, up, xdir=along, sense=1)


def _millimetres(*metres: float) -> tuple[float, ...]:
    """Rounded to the femtometre, so that equal sizes in any unit give equal CAD."""
    return tuple(round(metre * METRE, 12) for metre in metres)


def _annulus(outer: cq.Wire, inner: cq.Wire) -> cq.Face:
    return cq.Face.makeFromWires(outer, [inner])


def _bands(specimen: Specimen) -> list[tuple[cq.Wire, cq.Wire]]:
    """(outer, inner) wires of the rings between frame, electrode edges and plate, from the frame inwards."""
    frame = _wire(specimen.frame)
    plate = _wire(specimen.plate.outline, specimen.plate.offset)
    wires = [frame]
    if specimen.electrode.margin_frame > 0:
        wires.append(_offset(specimen.frame, (0.0, 0.0), -specimen.electrode.margin_frame))
    if specimen.electrode.margin_plate > 0:
        wires.append(_offset(specimen.plate.outline, specimen.plate.offset, specimen.electrode.margin_plate))
    wires.append(plate)
    return list(pairwise(wires))


def _offset(outline: Outline, centre: tuple[float, float], distance: float) -> cq.Wire:
    """The parallel curve at a distance [m], outwards if positive, as a periodic spline within 1e-8 of its size.

    OpenCASCADE's own offset curves do not survive STEP into gmsh.
    """
    points = outline.points(96)
    ahead, behind = np.roll(points, -1, axis=1), np.roll(points, 1, axis=1)
    tangent = (ahead - behind) / np.hypot(*(ahead - behind))
    moved = points + distance * np.array([tangent[1], -tangent[0]])
    if np.any(np.sum((np.roll(moved, -1, axis=1) - moved) * tangent, axis=0) <= 0):
        raise InputError("an electrode margin must stay below the outline's radius of curvature",
                         key="electrode", given=f"{abs(distance) * METRE:.4g} mm")
    x, y = (moved + np.array(centre)[:, None]) * METRE
    vectors = [cq.Vector(*xy, 0) for xy in zip(x, y, strict=True)]
    return cq.Wire.assembleEdges([cq.Edge.makeSpline(vectors, periodic=True)])
