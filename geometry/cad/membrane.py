"""The specimen's film in cadquery [mm], for meshing and masks, and the wires of its outlines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np

from tympan.geometry.errors import InputError
from tympan.geometry.outlines import Circle, Ellipse, Outline
from tympan.geometry.outlines.pieces import Arc, Line, Piece, Spline
from tympan.geometry.specimen import Electrode, Region, Specimen
from tympan.geometry.system import missing_library
from tympan.geometry.units import METRE

try:
    import cadquery as cq
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace
    from OCP.Geom import Geom_Circle, Geom_Ellipse
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pln, gp_Pnt
    from OCP.ShapeFix import ShapeFix_Face
except ImportError as error:
    if ".so" not in str(error):
        raise
    raise missing_library(error) from None

Pair = tuple[float, float]

#: Electrodes on all of the film.
_WHOLE = Electrode()

#: How near an axis a piece ends that ends on it, relative to the outline.
_MEET = 1e-12


def membrane_faces(specimen: Specimen, planes: frozenset[str]) -> dict[str, list[cq.Face]]:
    """The flat film, ``covered`` and ``bare``, cut along axes through its centre, the plate's.

    Faces lie in the plane z = 0 [mm]; neighbours share their common edges in shape, not in
    topology. ``planes`` are coordinates about whose zero the film is mirrored: only the part where
    they are positive is built. An electrode's outline that leaves slivers or no electrode at all is
    an :class:`InputError`.
    """
    quarter = _quarter(specimen) if len(planes) == 2 and specimen.electrode == _WHOLE else None
    if quarter is not None:
        return {"covered": [quarter], "bare": []}
    x, y = _millimetres(*specimen.centre)
    size = 4 * METRE * max(specimen.frame.semi_axes)
    cuts = [cq.Face.makePlane(size, size, (x, y, 0), normal) for normal in ((1, 0, 0), (0, 1, 0))]

    def kept(face: cq.Face) -> bool:
        return all(getattr(face.Center(), plane) > centre
                   for plane, centre in (("x", x), ("y", y)) if plane in planes)

    return {name: [face for whole in faces for face in whole.split(*cuts).Faces() if kept(face)]
            for name, faces in _coverage(specimen).items()}


def _quarter(specimen: Specimen) -> cq.Face | None:
    """The film where both coordinates are positive, if its outlines have pieces that end there."""
    outer = _first_quadrant(specimen.frame)
    if outer is None:
        return None
    (a, _), (_, b) = outer.at(np.array([0.0, 1.0]))[0].tolist()
    if specimen.plate is None:
        return _planar(_pieces_wire((outer, Line((0.0, b), (0.0, 0.0)),
                                     Line((0.0, 0.0), (a, 0.0))), (0.0, 0.0)))
    inner = _first_quadrant(specimen.plate.outline)
    if inner is None:
        return None
    (c, _), (_, d) = inner.at(np.array([0.0, 1.0]))[0].tolist()
    return _planar(_pieces_wire((outer, Line((0.0, b), (0.0, d)), inner.backwards(),
                                 Line((c, 0.0), (a, 0.0))), (0.0, 0.0)))


def _first_quadrant(outline: Outline) -> Piece | None:
    """The piece from the x axis to the y axis; None where no piece begins or ends there."""
    piece, *others = outline.curve.pieces
    whole = isinstance(piece, Arc) and not others and piece.sweep == 2 * np.pi
    if isinstance(piece, Arc) and whole:
        piece = replace(piece, sweep=np.pi / 2)
    ends = piece.at(np.array([0.0, 1.0]))[0]
    close = _MEET * max(outline.semi_axes)
    meets = abs(ends[0, 1]) < close and abs(ends[1, 0]) < close and (ends.sum(axis=1) > 0).all()
    return piece if meets and (whole or len(others) == 3) else None


def membrane_part(specimen: Specimen) -> cq.Face:
    """The film as one face within the frame, and around the plate where there is one."""
    hole = () if specimen.plate is None else (
        outline_wire(specimen.plate.outline, specimen.plate.offset),)
    return _planar(outline_wire(specimen.frame), *hole)


def electrode_part(specimen: Specimen) -> cq.Compound:
    """The film under the electrode as faces, for masks."""
    return cq.Compound.makeCompound(_coverage(specimen)["covered"])


def write_step(shapes: Sequence[cq.Shape], file: Path) -> None:
    """Shapes as one STEP file [mm]."""
    cq.Compound.makeCompound(shapes).exportStep(str(file))


def brep(shapes: Sequence[cq.Shape]) -> bytes:
    """Shapes as another program that builds on OpenCASCADE reads them, half of one ends it [mm]."""
    content = BytesIO()
    cq.Compound.makeCompound(shapes).exportBrep(content)
    return content.getvalue()


def _coverage(specimen: Specimen) -> dict[str, list[cq.Face]]:
    """The whole film as ``covered`` and ``bare`` faces, cut along the electrode's edges only."""
    electrode, plate = specimen.electrode, specimen.plate
    wires = [outline_wire(specimen.frame)]
    if electrode.margin_frame > 0:
        wires.append(offset_wire(specimen.frame, (0.0, 0.0), -electrode.margin_frame))
    if plate is not None:
        if electrode.margin_plate > 0:
            wires.append(offset_wire(plate.outline, plate.offset, electrode.margin_plate))
        wires.append(outline_wire(plate.outline, plate.offset))
    rings = [_planar(outer, inner) for outer, inner in pairwise(wires)]
    if plate is None:
        rings.append(_planar(wires[-1]))
    covered = [rings.pop(1 if electrode.margin_frame > 0 else 0)]
    if electrode.outline is None:
        return {"covered": covered, "bare": rings}
    return _clipped(specimen, covered[0], electrode.outline)


def _clipped(specimen: Specimen, ring: cq.Face, region: Region) -> dict[str, list[cq.Face]]:
    """The ring's part within the region, and what is left of the film."""
    disc = _planar(outline_wire(region.outline, region.offset))
    inside, film = ring.intersect(disc).Faces(), membrane_part(specimen)
    # A margin's edge that the region does not reach is none of the electrode's.
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


def _planar(outer: cq.Wire, *inner: cq.Wire) -> cq.Face:
    """A face in the plane z = 0; cadquery's own repairs what outlines, checked, do not need."""
    builder = BRepBuilderAPI_MakeFace(gp_Pln(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), outer.wrapped, True)
    for wire in inner:
        builder.Add(wire.wrapped)
    oriented = ShapeFix_Face(builder.Face())
    oriented.FixOrientation()
    return cq.Face(oriented.Face())


def outline_wire(outline: Outline, centre: Pair = (0.0, 0.0)) -> cq.Wire:
    """The outline in the plane z = 0 [mm], its centre at the given place [m]."""
    return _pieces_wire(outline.curve.pieces, centre)


def offset_wire(outline: Outline, centre: Pair, distance: float) -> cq.Wire:
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


def _smooth_offset(outline: Circle | Ellipse, centre: Pair, distance: float) -> cq.Wire:
    """As a periodic spline."""
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


def _pieces_wire(pieces: Sequence[Piece], centre: Pair) -> cq.Wire:
    x, y = _millimetres(*centre)
    return cq.Wire.assembleEdges([_edge(piece).moved(cq.Location((x, y, 0.0))) for piece in pieces])


def _edge(piece: Piece) -> cq.Edge:
    if isinstance(piece, Line):
        return cq.Edge.makeLine(cq.Vector(*_millimetres(*piece.start)),
                                cq.Vector(*_millimetres(*piece.end)))
    return _arc(piece) if isinstance(piece, Arc) else _spline(piece)


def _arc(arc: Arc) -> cq.Edge:
    if arc.sweep < 0:
        arc = arc.backwards()
    x, y, a, b = _millimetres(*arc.centre, *arc.radii)
    first = arc.turn if a >= b else arc.turn + np.pi / 2
    start = arc.start if a >= b else arc.start - np.pi / 2
    axes = gp_Ax2(cq.Vector(x, y, 0).toPnt(), cq.Vector(0, 0, 1).toDir(),
                  cq.Vector(np.cos(first), np.sin(first), 0).toDir())
    curve = Geom_Circle(axes, a) if a == b else Geom_Ellipse(axes, max(a, b), min(a, b))
    if arc.sweep > 2 * np.pi - 1e-12:
        return cq.Edge(BRepBuilderAPI_MakeEdge(curve).Edge())
    return cq.Edge(BRepBuilderAPI_MakeEdge(curve, start, start + arc.sweep).Edge())


def _spline(spline: Spline) -> cq.Edge:
    points, slopes = (np.pad(np.array(pairs) * METRE, ((0, 0), (0, 1)))
                      for pairs in (spline.points, spline.slopes))
    return cq.Edge.makeSpline([cq.Vector(*point) for point in points],
                              [cq.Vector(*slope) for slope in slopes],
                              parameters=spline.knots, scale=False, tol=1e-9)


def _millimetres(*metres: float) -> tuple[float, ...]:
    """Rounded to the femtometre, so that equal sizes in any unit give equal CAD."""
    return tuple(round(metre * METRE, 12) for metre in metres)
