"""Frame, clamp ring and plate for laser cutting or printing [mm], and drawings of them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cadquery as cq
import numpy as np

from tympan.base.arrays import AnyArray
from tympan.base.errors import InputError
from tympan.base.units import METRE
from tympan.geometry.cad.sizes import PartOptions
from tympan.geometry.cad.wires import outline_wire, pieces_wire
from tympan.geometry.outlines import Outline
from tympan.geometry.outlines.contours import closed_curves
from tympan.geometry.outlines.pieces import Arc, Line, Piece
from tympan.geometry.outlines.step import edge_pieces
from tympan.geometry.specimen import Specimen


def ring_part(frame: Outline, options: PartOptions, height: float) -> cq.Solid:
    """Ring that the film is mounted on, or the one that clamps it with the same screws."""
    inner = cq.Wire(outline_wire(frame))
    try:
        outer = cq.Wire(pieces_wire(frame.curve.beside(options.width).pieces))
    except InputError:  # around sharp corners
        outer = inner.offset2D(options.width * METRE)[0]
    holes = [_hole(centre, options.screw / 2) for centre in options.holes(frame)]
    return cq.Solid.extrudeLinear(outer, [inner, *holes], cq.Vector(0, 0, height * METRE))


def plate_part(specimen: Specimen, options: PartOptions) -> cq.Solid:
    """Plate with a screw hole in the middle of its bounding box, if there is room for it."""
    outline, offset = specimen.needed_plate().outline, specimen.needed_plate().offset
    radius = min(options.screw / 2, min(outline.semi_axes) / 6)
    depth = -float(outline.level(np.zeros(1), np.zeros(1))[0])
    holes = [_hole(np.array(offset), radius)] if depth > 2 * radius else []
    top = cq.Vector(0, 0, options.plate_height * METRE)
    return cq.Solid.extrudeLinear(cq.Wire(outline_wire(outline, offset)), holes, top)


def _hole(centre: AnyArray, radius: float) -> cq.Wire:
    x, y = METRE * centre
    return cq.Wire.assembleEdges([cq.Edge.makeCircle(METRE * radius, cq.Vector(x, y, 0))])


def flat_wires(shapes: Sequence[cq.Shape], names: Sequence[str] = ()
               ) -> list[tuple[str, cq.Wire]]:
    """Name the wires in z = 0: ``outline`` of a face, ``opening`` the longest inside, ``holes``.

    With ``names``, all wires of a shape have its name.
    """
    if names:
        return [(name, wire) for name, shape in zip(names, shapes, strict=True)
                for _, wire in flat_wires([shape])]
    wires = []
    for face in (face for shape in shapes for face in shape.Faces()):
        in_plane = abs(face.Center().z) < 1e-6 and abs(face.normalAt().z) > 0.5
        if face.geomType() != "PLANE" or not in_plane:
            continue
        inner = sorted(face.innerWires(), key=lambda wire: -wire.Length())
        wires += [("outline", face.outerWire())]
        wires += [("opening" if number == 0 else "holes", wire)
                  for number, wire in enumerate(inner)]
    return wires


def write_dxf(shapes: Sequence[cq.Shape], file: Path, names: Sequence[str] = ()) -> None:
    """Write the flat wires to one DXF file [mm], each kind, or named shape, on its own layer."""
    document = cq.exporters.DxfDocument()
    wires = flat_wires(shapes, names)
    for name in dict.fromkeys(name for name, _ in wires):
        document.add_layer(name)
    for name, wire in wires:
        document.add_shape(cq.Workplane("XY").add(wire), layer=name)
    document.document.saveas(str(file))


def write_svg(shapes: Sequence[cq.Shape], file: Path, names: Sequence[str] = ()) -> None:
    """Write the flat wires to an SVG file at their size: lines, arcs and Béziers."""
    wires = flat_wires(shapes, names)
    box = cq.Compound.makeCompound([wire for _, wire in wires]).BoundingBox()
    margin = 1.0
    width, height = box.xlen + 2 * margin, box.ylen + 2 * margin
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" '
             f'width="{width:.6f}mm" height="{height:.6f}mm" '
             f'viewBox="{box.xmin - margin:.6f} {-box.ymax - margin:.6f} '
             f'{width:.6f} {height:.6f}">',
             '<g transform="scale(1 -1)" fill="none" stroke="#ff0000" stroke-width="0.1">']
    for name, wire in wires:
        edges = [piece for edge in wire.Edges() for piece in edge_pieces(edge.wrapped)]
        loop, = closed_curves(edges).closed
        start = METRE * loop.starts[0]
        words = [word for piece in loop.pieces for word in _words(piece)]
        lines.append(f'<path class="{name}" d="M {_numbers(start)} {" ".join(words)} Z"/>')
    file.write_text("\n".join([*lines, "</g>", "</svg>", ""]), encoding="utf-8")


def _words(piece: Piece) -> list[str]:
    """SVG path commands of a piece."""
    if isinstance(piece, Line):
        return [f"L {_numbers(METRE * np.array(piece.end))}"]
    if isinstance(piece, Arc):
        # SVG takes an arc by its ends, which is unambiguous below half a turn.
        parts = max(1, int(np.ceil(abs(piece.sweep) / np.pi * 1.001)))
        ends = METRE * piece.at(np.arange(1, parts + 1) / parts)[0]
        radii, turn = _numbers(METRE * np.array(piece.radii)), float(np.degrees(piece.turn))
        return [f"A {radii} {turn:.12g} 0 {int(piece.sweep > 0)} {_numbers(end)}" for end in ends]
    value, slope, _ = (METRE * part for part in piece.at(piece.breaks))
    third = np.diff(piece.breaks)[:, None] / 3
    first, second = value[:-1] + third * slope[:-1], value[1:] - third * slope[1:]
    curves = zip(first, second, value[1:], strict=True)
    return [f"C {_numbers(np.concatenate(points))}" for points in curves]


def _numbers(values: AnyArray) -> str:
    return " ".join(f"{value:.12g}" for value in values)
