"""The specimen's film in cadquery [mm], for meshing and masks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from OCP.TopoDS import TopoDS_Wire

from tympan.base.errors import InputError
from tympan.base.system import missing_library
from tympan.base.units import METRE, millimetres
from tympan.geometry.cad.wires import outline_wire, piece_edge, pieces_wire, planar
from tympan.geometry.outlines.curve import Curve
from tympan.geometry.sectors import rings
from tympan.geometry.specimen import Region, Specimen

try:
    import cadquery as cq
except ImportError as error:
    if ".so" not in str(error):
        raise
    raise missing_library(error) from None


#: Distance of triangles from a face, over its size: its largest triangle is then inside it.
_COARSE = 1e-3


def membrane_faces(specimen: Specimen, planes: frozenset[str]) -> dict[str, list[cq.Face]]:
    """Cut the flat film along the axes through the plate's centre; its covered and bare faces.

    Faces lie in the plane z = 0 [mm]. Common edges of neighbours coincide, but are not shared.
    ``planes`` names the coordinates in which the film is mirrored: only the part where they are
    positive is built.

    Raises
    ------
    InputError
        When the electrode's outline covers no film, or cuts slivers from it.
    """
    x, y = millimetres(*specimen.centre)
    size = 4 * METRE * max(specimen.frame.semi_axes)
    cuts = [cq.Face.makePlane(size, size, (x, y, 0), normal) for normal in ((1, 0, 0), (0, 1, 0))]

    def kept(face: cq.Face) -> bool:
        return all(getattr(face.Center(), plane) > centre
                   for plane, centre in (("x", x), ("y", y)) if plane in planes)

    parts: dict[str, list[cq.Face]] = {}
    for name, faces in _coverage(specimen).items():
        quarters = [face for whole in faces for face in whole.split(*cuts).Faces()]
        parts[name] = [face for face in quarters if kept(face)]
    return parts


def membrane_part(specimen: Specimen) -> cq.Face:
    """Film as one face: within the frame, and around the plate where there is one."""
    hole = () if specimen.plate is None else (
        outline_wire(specimen.plate.outline, specimen.plate.offset),)
    return _planar(outline_wire(specimen.frame), *hole)


def electrode_part(specimen: Specimen) -> cq.Compound:
    """Film under the electrode as faces, for masks."""
    return cq.Compound.makeCompound(_coverage(specimen)["covered"])


def segment_parts(specimen: Specimen) -> dict[str, cq.Compound]:
    """Film under each segment of the electrode as faces, by the segments' names, for masks."""
    electrode, frame = specimen.electrode, specimen.frame
    edges = [cq.Edge(piece_edge(piece)) for piece in electrode.edges(frame)]
    cut = [face for whole in _coverage(specimen)["covered"]
           for face in (whole.split(*edges).Faces() if edges else [whole])]
    x, y = (np.array([_within(face)[axis] for face in cut]) / METRE for axis in range(2))
    number = electrode.segment_at(x, y, frame)
    return {name: _joined([face for face, found in zip(cut, number.tolist(), strict=True)
                           if found == segment])
            for segment, name in enumerate(electrode.names)}


def _within(face: cq.Face) -> tuple[float, float]:
    """Find a place within a face [mm]: the middle of a triangle of it."""
    corners, triangles = face.tessellate(_COARSE * face.BoundingBox().DiagonalLength)
    places = np.array([[corner.x, corner.y] for corner in corners])[np.array(triangles)]
    (ax, ay), (bx, by) = (places[:, 1] - places[:, 0]).T, (places[:, 2] - places[:, 0]).T
    x, y = places[int(np.argmax(np.abs(ax * by - ay * bx)))].mean(axis=0).tolist()
    return x, y


def _joined(faces: list[cq.Face]) -> cq.Compound:
    """Join faces that share edges to one."""
    first, *others = faces
    joined = first.fuse(*others).clean() if others else first
    return cq.Compound.makeCompound(joined.Faces())


def write_step(shapes: Sequence[cq.Shape], file: Path) -> None:
    """Write shapes to one STEP file [mm]."""
    cq.Compound.makeCompound(shapes).exportStep(str(file))


def _coverage(specimen: Specimen) -> dict[str, list[cq.Face]]:
    """Cut the whole film along the electrode's edges only: ``covered`` and ``bare`` faces."""
    faces = {name: [_ring(*pair) for pair in pairs] for name, pairs in rings(specimen).items()}
    if specimen.electrode.outline is None:
        return faces
    return _clipped(specimen, faces["covered"][0], specimen.electrode.outline)


def _clipped(specimen: Specimen, ring: cq.Face, region: Region) -> dict[str, list[cq.Face]]:
    """Cut a ring by a region: the part inside is covered, the rest of the film is bare."""
    disc = _planar(outline_wire(region.outline, region.offset))
    inside, film = ring.intersect(disc).Faces(), membrane_part(specimen)
    # The rest of the film includes the margins, which the region does not reach.
    outside = film.cut(*inside).Faces() if inside else []
    faces = (*inside, *outside)
    missing = film.Area() - sum(face.Area() for face in faces)
    narrowest = min((2 * face.Area() / sum(wire.Length() for wire in face.Wires())
                     for face in faces), default=0.0)
    if not inside or abs(missing) > 1e-6 * film.Area() or narrowest < 0.01 * specimen.gap * METRE:
        raise InputError("must cover some of the film and cut no slivers from it: the electrode "
                         "and what it leaves bare must be wider than 1 % of the gap between frame "
                         "and plate, or centre", key="electrode.outline", given=str(region))
    return {"covered": inside, "bare": outside}


def _ring(outer: Curve, inner: Curve | None) -> cq.Face:
    edges = (outer,) if inner is None else (outer, inner)
    return _planar(*(pieces_wire(edge.pieces) for edge in edges))


def _planar(outer: TopoDS_Wire, *inner: TopoDS_Wire) -> cq.Face:
    return cq.Face(planar(outer, *inner))
