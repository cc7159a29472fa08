"""Drawings."""

from __future__ import annotations

import tempfile
from pathlib import Path

import ezdxf

from benchmarks.trials.fuzz.kind import Kind, register
from tympan.base.toml_reader import Table
from tympan.geometry.outlines import OUTLINES, check_outline


def _dxf() -> bytes:
    """A drawing of a line, an arc, a polyline with a bulge, an ellipse and a spline."""
    document = ezdxf.new(units=ezdxf.units.MM)
    space = document.modelspace()
    space.add_line((0, 0), (50, 0))
    space.add_arc((0, 0), 50, 0, 90)
    space.add_lwpolyline([(0, 50, 0.3), (-5, 20, 0), (0, 0, 0)], format="xyb")
    space.add_ellipse((0, 0), (30, 0), 0.5, dxfattribs={"layer": "other"})
    space.add_spline([(0, 0), (9, 4), (20, 3), (30, 0)], dxfattribs={"layer": "third"})
    with tempfile.TemporaryDirectory() as folder:
        document.saveas(Path(folder) / "a.dxf")
        text = (Path(folder) / "a.dxf").read_bytes()
    # Its head and its objects say nothing of the curves.
    place = text.index(b"  2\nENTITIES")
    return b"  0\nSECTION\n" + text[place: text.index(b"ENDSEC", place)] + b"ENDSEC\n  0\nEOF\n"


def _drawing(folder: Path) -> None:
    table = Table(folder / "specimen.toml", {"shape": "dxf", "file": "a.dxf"}, "frame")
    check_outline(OUTLINES.read(table), "frame")


#: Its curves lie apart.
register("drawing", Kind("a.dxf", (_dxf(),), _drawing, refused=True))
