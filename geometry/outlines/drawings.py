"""Outlines from drawings: DXF and STEP files, read once and kept as pieces."""

from __future__ import annotations

import hashlib
import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np

from tympan.base.errors import InputError
from tympan.base.extras import needs
from tympan.base.fields import Key, read
from tympan.base.read_file import file_bytes
from tympan.base.reader_process import read_apart
from tympan.base.system import missing_library
from tympan.base.toml_reader import Rule, Table
from tympan.base.units import quantity
from tympan.geometry.outlines.contours import MOST_CURVES, DrawingSheet, closed_curves, piece_ends
from tympan.geometry.outlines.drawn import Drawn
from tympan.geometry.outlines.outline import OUTLINES, SIZE
from tympan.geometry.outlines.pieces import MOST_PIECES, PIECES, PLACE, Line, Piece

#: Names of curves in DXF files.
_CURVES = frozenset({b"LINE", b"ARC", b"CIRCLE", b"ELLIPSE", b"SPLINE", b"LWPOLYLINE"})

#: Head of the section of a DXF file that draws, after the definitions of layers and blocks.
_ENTITIES = re.compile(rb"SECTION\s+2\s+ENTITIES\b")

_TOLERANCE: Rule = (lambda x: 0 <= x <= 0.1, "must be from 0 to 10 cm")


@dataclass(frozen=True)
class Drawing(ABC):
    """A closed curve of a drawing, read once and kept as pieces."""

    shape: ClassVar[str]
    file: Annotated[str, Key("the drawing, from the folder of this file")]
    curve: Annotated[Literal["outer", "inner", "only"], Key(
        "which closed curve: the largest, the largest within it, or the only one")] = "only"
    inside: Annotated[tuple[float, float] | None, Key(
        "a point of the drawing: the smallest closed curve around it is taken, in place of curve",
        "length", PLACE)] = None
    tolerance: Annotated[float | None, Key(
        "widest gap that is closed, and how far lines, arcs and splines that are too many may be "
        "moved", "length",
        _TOLERANCE, default="1e-4 of the drawing's size, at most 0.05 mm")] = None

    @classmethod
    def from_table(cls, table: Table) -> Drawn:
        """Read the drawing: the chosen curve of joined pieces."""
        drawing = read(cls, table)
        file = table.beside("file")
        try:
            digest = hashlib.sha256(file_bytes(file)).hexdigest()
            return _read(str(file), digest, drawing)
        except InputError as error:
            raise table.error("file", error.allowed, str(file)) from None

    @property
    def keys(self) -> dict[str, Any]:
        """Keys that :func:`record` needs beside the file."""
        return {name: value for name, value in vars(self).items() if name != "file"}

    @abstractmethod
    def sheet(self, file: Path) -> DrawingSheet:
        """All its curves, in any order."""


@OUTLINES.register
@dataclass(frozen=True)
class StepFile(Drawing):
    """A closed curve of a STEP file: of a flat face or wire, or of a flat face of a solid."""

    shape: ClassVar[str] = "step"
    face: Annotated[Literal["largest", "top", "bottom"], Key(
        "which flat face of a solid: the largest, or the highest or lowest of those parallel to "
        "it")] = "largest"

    @classmethod
    def from_table(cls, table: Table) -> Drawn:
        needs("cadquery", "reading STEP")
        return super().from_table(table)

    def sheet(self, file: Path) -> DrawingSheet:
        from tympan.geometry.outlines.step import step_sheet

        return step_sheet(file, self.face)


@OUTLINES.register
@dataclass(frozen=True)
class DxfFile(Drawing):
    """A closed curve of a DXF file: lines, arcs, ellipses, polylines, splines, also in blocks."""

    shape: ClassVar[str] = "dxf"
    layer: Annotated[str, Key("the layer it is on; * is all that are switched on")] = "*"
    unit: Annotated[str | None, Key(
        'length of one unit of the drawing, such as "mm" or "in"',
        default="what the file says; millimetres where it says nothing")] = None

    @classmethod
    def from_table(cls, table: Table) -> Drawn:
        if (unit := table.data.get("unit")) is not None:
            try:
                quantity(f"1 {unit}", "length")
            except InputError:
                raise table.error("unit", 'must be a unit of length, such as "mm" or "in"',
                                  unit) from None
        return super().from_table(table)

    def sheet(self, file: Path) -> DrawingSheet:
        from tympan.geometry.outlines.dxf import dxf_sheet

        _few(_curves(file.read_bytes()))
        return dxf_sheet(file, self.layer, self.unit)


_KINDS: dict[str, type[Drawing]] = {kind.shape: kind for kind in (DxfFile, StepFile)}


@lru_cache(maxsize=64)
def _read(file: str, digest: str, drawing: Drawing) -> Drawn:
    """Read a drawing once; a changed file has another digest, and is read again."""
    answer = read_apart(drawing.shape, file, drawing.keys)
    if "library" in answer:
        raise missing_library(ImportError(answer["library"]))
    if "error" in answer:
        raise InputError(answer["error"])
    table = Table("", answer, plain=True)
    return Drawn(tuple(map(_piece, table.tables("pieces"))), tuple(answer["remarks"]), file)


def _piece(table: Table) -> Piece:
    try:
        piece: Piece = PIECES.read(table)
    except InputError as error:
        raise InputError(f"{error.key}: given {error.given!r}: {error.allowed}") from None
    return piece


def record(kind: str, file: str, keys: dict[str, Any]) -> dict[str, Any]:
    """Read an outline: its ``pieces`` and ``remarks``, an ``error``, or the missing ``library``."""
    try:
        drawing: Drawing = _KINDS[kind](file, **keys)
        sheet = drawing.sheet(Path(file))
        _few(len(sheet.pieces))
        _in_range(sheet)
        contours = closed_curves(sheet.pieces, drawing.tolerance)
        contours = contours.chosen(drawing.curve, drawing.inside)
        curve, = contours.closed
        width, height = (high - low for low, high in curve.box)
        if not SIZE[0](width / 2) or not SIZE[0](height / 2):
            raise InputError(f"is {1e3 * width:.4g} x {1e3 * height:.4g} mm: its half extents "
                             f"{SIZE[1]}{sheet.units}")
        if len(curve.pieces) > MOST_PIECES:
            raise InputError(f"has {len(curve.pieces)} lines, arcs and splines: at most "
                             f"{MOST_PIECES} make an outline; a larger tolerance, such as "
                             f'tolerance = "0.2 mm", makes them fewer')
        return {"pieces": [PIECES.write(piece, plain=True) for piece in curve.pieces],
                "remarks": [*sheet.remarks, *contours.remarks]}
    except InputError as error:
        return {"error": str(error)}
    except ImportError as error:
        return {"library": str(error)}
    except MemoryError:
        raise  # ends the process, of which the message is one on its limits
    except Exception:  # the libraries raise whatever they meet, in words of Python and of the file
        return {"error": f"is no {kind.upper()} file that can be read: it is damaged, or of "
                         "another kind; export it again from the program that drew it"}


def _in_range(sheet: DrawingSheet) -> None:
    """Refuse numbers too large or too small for computing a curve."""
    try:
        for piece in sheet.pieces:
            if not isinstance(piece, Line):
                _piece(Table("", {"piece": PIECES.write(piece, plain=True)}, plain=True)
                       .table("piece"))
    except InputError as error:
        raise InputError(f"{error}{sheet.units}") from None
    ends = piece_ends(sheet.pieces)
    if not np.abs(ends).max() <= 1e3:
        x, y = ends.reshape(-1, 2)[np.flatnonzero(~(np.abs(ends).max(axis=2) <= 1e3).ravel())[0]]
        raise InputError(f"has a line that ends at {x:.4g}, {y:.4g} m: its ends {PLACE[1]}"
                         f"{sheet.units}")


def _few(count: int) -> None:
    if count > MOST_CURVES:
        raise InputError(f"has {count} lines, arcs and splines: at most {MOST_CURVES} are read")


def _curves(dxf: bytes) -> int:
    """Count the curves outside of blocks in the text of a DXF file, before any library reads it."""
    section = _ENTITIES.search(dxf)
    drawn = dxf[section.end():] if section else b""
    lines = [line.strip() for line in drawn.splitlines()]
    return sum(code == b"0" and name in _CURVES for code, name in pairwise(lines))


def load_reader(kind: str) -> None:
    """Load the library that reads drawings of a kind."""
    if kind == "dxf":
        import tympan.geometry.outlines.dxf
    else:
        import tympan.geometry.outlines.step  # noqa: F401
