"""Outlines and drawings."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path

import ezdxf
from ezdxf.layouts import Modelspace

from benchmarks.trials.hostile.case import Case, Cases, group
from benchmarks.trials.hostile.inputs import BODY, GOOD, SOLVE, SPECIMEN, VHB

CORNERS = ((0, 0), (90, 0), (90, 80), (0, 80))


def _points(*places: tuple[object, object]) -> str:
    return str([[f"{x} mm", f"{y} mm"] for x, y in places])


def _frame(name: str, frame: str, words: str, plate: str = "", status: int = 2) -> Case:
    body = BODY.replace('radius = "1 cm"\noffset = ["2 mm", "0 mm"]', plate) if plate else BODY
    return Case(name, SOLVE, {"specimen.toml": f'name = "film"\n[frame]\n{frame}\n{body}{VHB}'},
                words, status)


def _dxf(name: str, draw: Callable[[Modelspace], object], words: str,
         change: tuple[bytes, bytes] = (b"", b"")) -> Case:
    document = ezdxf.new(units=ezdxf.units.MM)
    draw(document.modelspace())
    with tempfile.TemporaryDirectory() as folder:
        document.saveas(Path(folder) / "a.dxf")
        content = (Path(folder) / "a.dxf").read_bytes()
    assert change[0] in content
    specimen = f'name = "film"\n[frame]\nshape = "dxf"\nfile = "a.dxf"\n{BODY}{VHB}'
    return Case(name, SOLVE, {"specimen.toml": specimen, "a.dxf": content.replace(*change, 1)},
                words)


def _circle(radius: float, space: Modelspace) -> None:
    space.add_circle((0, 0), radius)


def _lines(*places: tuple[float, float]) -> Callable[[Modelspace], None]:
    def draw(space: Modelspace) -> None:
        for start, end in pairwise(places):
            space.add_line(start, end)

    return draw


def _spline(count: int, weights: tuple[float, ...] = ()) -> Callable[[Modelspace], None]:
    def draw(space: Modelspace) -> None:
        spline = space.add_open_spline([(0, 0, 0), (30, 0, 0), (30, 30, 0), (0, 0, 0)])
        spline.control_points = list(spline.control_points)[:count]
        spline.weights = weights

    return draw


def _step(name: str, old: str, new: str, words: str) -> Case:
    """A rectangle with two of its numbers swapped, or one that is none."""
    import cadquery as cq

    from tympan.geometry.cad import membrane as cad
    from tympan.geometry.cad.wires import outline_wire, planar
    from tympan.geometry.outlines import Polygon

    corners = ((55e-3, 25e-3), (-55e-3, 25e-3), (-55e-3, -25e-3), (55e-3, -25e-3))
    with tempfile.TemporaryDirectory() as folder:
        cad.write_step([cq.Face(planar(outline_wire(Polygon(corners))))], Path(folder) / "a.step")
        content = (Path(folder) / "a.step").read_text(encoding="utf-8")
    assert old in content
    specimen = f'name = "film"\n[frame]\nshape = "step"\nfile = "a.step"\n{BODY}{VHB}'
    return Case(name, SOLVE, {"specimen.toml": specimen, "a.step": content.replace(old, new, 1)},
                words)


@group("disk full")
def disk_full() -> Cases:
    outlined = SPECIMEN + '[electrode.outline]\nshape = "circle"\nradius = "3 cm"\n'
    yield Case("no temporary files", SOLVE, {"specimen.toml": outlined}, "temporary files",
               largest_file=1000)
    yield Case("no room for the picture", "force specimen.toml --to '1 mm' --points 3 -o out",
               GOOD, "out/oval-force.*cannot be written: File too large", largest_file=8000,
               seconds=60.0, check=lambda folder: "files" if (folder / "out").exists() else "")


@group("outlines")
def outlines() -> Cases:
    twice, closed = (*CORNERS[:2], *CORNERS[1:]), (*CORNERS, CORNERS[0])
    for shape, key in (("polygon", "vertices"), ("spline", "through")):
        begin = f'shape = "{shape}"\n{key} = '
        yield _frame(f"{shape}: a point twice", begin + _points(*twice), "is there twice")
        yield _frame(f"{shape}: first point last", begin + _points(*closed), "", status=0)
    same = _points(*3 * [(1, 1)])
    yield _frame("one point", f'shape = "polygon"\nvertices = {same}', "vertices")
    yield _frame("radius 1e300 mm", 'shape = "circle"\nradius = "1e300 mm"', "frame.radius")
    arc = ('shape = "drawn"\n[[frame.segments]]\nkind = "arc"\ncentre = ["0 mm", "0 mm"]\n'
           'radii = ["45 mm", "45 mm"]\nsweep = "0 deg"')
    yield _frame("arc of 0 deg", arc, r"frame.segments.0.sweep")


@group("dxf")
def dxf() -> Cases:
    rectangle = _lines((0, 0), (50, 0), (50, 40), (0, 40), (0, 0))
    for radius in (float("nan"), 0.0, -30.0):
        yield _dxf(f"radius {radius}", partial(_circle, radius), "radii_m")
    for name, count, weights in (("weight 0", 4, (1, 0, 0, 1)), ("spline of 1 point", 1, ()),
                                 ("spline of no point", 0, ())):
        yield _dxf(name, _spline(count, weights), "weights positive|can be read")
    yield _dxf("units 99", rectangle, "INSUNITS is 99", (b"$INSUNITS\n 70\n4",
                                                         b"$INSUNITS\n 70\n99"))
    yield _dxf("a word as number", rectangle, "no DXF file", (b"\n50.0\n", b"\nfifty\n"))
    yield _dxf("bulge 1e200", lambda space: space.add_lwpolyline(
        [(3, 2, 1e200), (3, 6, 0), (-3, 6, 1)], format="xyb", close=True), "a.dxf")
    end = b"  0\nENDSEC\n  0\nSECTION\n  2\nOBJECTS"
    yield _dxf("100001 lines", rectangle, "at most 100000",
               (end, b"  0\nLINE\n" * 100_001 + end))


@group("step")
def step() -> Cases:
    yield _step("first corner NaN", "(55.,-25.,0.)", "(NaN,-25.,0.)", "a.step.*damaged")
    yield _step("other corner NaN", "(-55.,-25.,0.)", "(NaN,-25.,0.)",
                "a.step.*far more time|damaged")
    yield _step("corner swapped", "(55.,-25.,0.)", "(-25.,55.,0.)", "a.step")


@group("room for a plate")
def room_for_a_plate() -> Cases:
    yield _frame("stadium", 'shape = "stadium"\nsemi_axes = ["25 mm", "40 mm"]', "", status=0)
    square = ('shape = "rounded_rectangle"\nsemi_axes = ["12.7 mm", "12.7 mm"]\n'
              'corner_radius = "0.3 mm"')
    for size in ("0.3 mm", "0.6 mm"):
        yield _frame(f"plate of {size}", square, "", f'radius = "{size}"', status=0)
