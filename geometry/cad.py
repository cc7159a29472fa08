"""The specimen's parts in cadquery [mm]: membrane face for meshing, frame and plate for making."""

from __future__ import annotations

from pathlib import Path

import cadquery as cq
import numpy as np

from geometry.errors import InputError
from geometry.outlines import METRE, Outline, millimetres
from geometry.specimen import Specimen


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
    x, y = millimetres(*specimen.plate.offset)
    size = 4 * METRE * max(specimen.frame.semi_axes)
    cuts = [cq.Face.makePlane(size, size, (x, y, 0), normal) for normal in ((1, 0, 0), (0, 1, 0))]
    faces = [face for outer, inner in _bands(specimen) for face in _annulus(outer, inner).split(*cuts).Faces()]
    return [face for face in faces
            if all(getattr(face.Center(), plane) > centre for plane, centre in (("x", x), ("y", y)) if plane in planes)]


def frame_part(specimen: Specimen, width: float = 8e-3, height: float = 4e-3) -> cq.Solid:
    """A frame ring of the given width and height [m] around the film."""
    inner = specimen.frame.wire((0.0, 0.0))
    outer = inner.offset2D(width * METRE)[0]
    return cq.Solid.extrudeLinear(outer, [inner], cq.Vector(0, 0, height * METRE))


def plate_part(specimen: Specimen, height: float = 2e-3) -> cq.Solid:
    """The plate as a disc of the given height [m]."""
    return cq.Solid.extrudeLinear(specimen.plate.outline.wire(specimen.plate.offset), [], cq.Vector(0, 0, height * METRE))


def membrane_part(specimen: Specimen) -> cq.Face:
    """The film as one face between frame and plate."""
    return _annulus(specimen.frame.wire((0.0, 0.0)), specimen.plate.outline.wire(specimen.plate.offset))


def write_step(shapes: list[cq.Face] | list[cq.Solid], file: Path) -> None:
    """Shapes as one STEP file [mm]."""
    cq.exporters.export(cq.Workplane(obj=cq.Compound.makeCompound(shapes)), str(file), exportType="STEP")


def _annulus(outer: cq.Wire, inner: cq.Wire) -> cq.Face:
    return cq.Face.makeFromWires(outer, [inner])


def _bands(specimen: Specimen) -> list[tuple[cq.Wire, cq.Wire]]:
    """(outer, inner) wires of the rings between frame, electrode edges and plate, from the frame inwards."""
    frame = specimen.frame.wire((0.0, 0.0))
    plate = specimen.plate.outline.wire(specimen.plate.offset)
    wires = [frame]
    if specimen.electrode.margin_frame > 0:
        wires.append(_offset(specimen.frame, (0.0, 0.0), -specimen.electrode.margin_frame))
    if specimen.electrode.margin_plate > 0:
        wires.append(_offset(specimen.plate.outline, specimen.plate.offset, specimen.electrode.margin_plate))
    wires.append(plate)
    return list(zip(wires[:-1], wires[1:], strict=True))


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
