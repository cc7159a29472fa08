"""Outlines from drawings.

``shape = "dxf"`` and ``shape = "step"``, read once and kept as pieces.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from tympan.geometry.errors import InputError
from tympan.geometry.fields import Key, read
from tympan.geometry.outlines.outline import OUTLINES
from tympan.geometry.outlines.pieces import Piece
from tympan.geometry.outlines.shapes.drawn import Drawn, joined
from tympan.geometry.toml_reader import Table

Side = Literal["outer", "inner", "only"]


@OUTLINES.register
@dataclass(frozen=True)
class DxfFile:
    """Lines, arcs, ellipses, polylines and splines of a DXF file."""

    shape: ClassVar[str] = "dxf"
    file: Annotated[str, Key("the drawing, from the folder of this file")]
    layer: Annotated[str, Key("the layer it is on; * is all")] = "*"
    curve: Annotated[Side, Key("which of two closed curves")] = "only"

    @classmethod
    def from_table(cls, table: Table) -> Drawn:
        """Its pieces, joined."""
        # CAD is needed for drawings alone.
        from tympan.geometry.outlines.drawings import dxf_pieces

        drawing = read(cls, table)
        return _joined(table, drawing.file, drawing.curve,
                       lambda file: dxf_pieces(file, drawing.layer))


@OUTLINES.register
@dataclass(frozen=True)
class StepFile:
    """Edges of a flat face or wire in a STEP file."""

    shape: ClassVar[str] = "step"
    file: Annotated[str, Key("the drawing, from the folder of this file")]
    curve: Annotated[Side, Key("which of two closed curves")] = "only"

    @classmethod
    def from_table(cls, table: Table) -> Drawn:
        """Its pieces, joined."""
        from tympan.geometry.outlines.drawings import step_pieces

        drawing = read(cls, table)
        return _joined(table, drawing.file, drawing.curve, step_pieces)


def _joined(table: Table, name: str, side: Side, pieces: Callable[[Path], list[Piece]]) -> Drawn:
    file = Path(table.file).parent / name
    if not file.is_file():
        raise table.error("file", "is no file", str(file))
    try:
        return joined(pieces(file), None if side == "only" else side)
    except InputError as error:
        raise table.error("file", error.allowed, str(file)) from None
