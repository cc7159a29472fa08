"""DXF files with the features of programs: versions, curves, blocks, units, slips."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import ezdxf
import numpy as np
from ezdxf.layouts import BaseLayout
from scipy.interpolate import BSpline
from scipy.special import ellipe

from benchmarks.trials.drawings.case import Rng, Truth, case

#: The units of a header [per mm].
PER_MM = {"mm": 1.0, "cm": 0.1, "m": 1e-3, "in": 1 / 25.4}
UNITS = {"mm": 4, "cm": 5, "m": 6, "in": 1, "none": 0}


def document(version: str = "R2010", units: str = "mm") -> ezdxf.document.Drawing:
    made = ezdxf.new(version)
    made.header["$INSUNITS"] = UNITS[units]
    return made


class Rounded:
    """A rectangle with round corners, somewhere and turned, in a unit."""

    def __init__(self, rng: Rng, scale: float = 1.0) -> None:
        self.width, self.height = rng.uniform(60, 140), rng.uniform(40, 90)
        self.radius = rng.uniform(4, 15)
        self.shift, self.angle = rng.uniform(-200, 200, 2), rng.uniform(0, 2 * np.pi)
        self.scale = scale

    @property
    def truth(self) -> Truth:
        w, h, r = self.width, self.height, self.radius
        return Truth(w * h - (4 - np.pi) * r**2, 2 * (w + h) - 8 * r + 2 * np.pi * r)

    def place(self, x: float, y: float) -> tuple[float, float]:
        c, s = np.cos(self.angle), np.sin(self.angle)
        return (self.scale * (c * x - s * y + self.shift[0]),
                self.scale * (s * x + c * y + self.shift[1]))

    def corners(self) -> list[tuple[float, float]]:
        """Where lines and arcs meet: a line follows the first, an arc the second, and so on."""
        a, b, r = self.width / 2, self.height / 2, self.radius
        return [self.place(*p) for p in ((-a + r, -b), (a - r, -b), (a, -b + r), (a, b - r),
                                         (a - r, b), (-a + r, b), (-a, b - r), (-a, -b + r))]

    def polyline(self) -> list[tuple[float, float, float]]:
        quarter = np.tan(np.pi / 8)
        return [(*p, quarter * (k % 2)) for k, p in enumerate(self.corners())]

    def lines(self, space: BaseLayout, layer: str = "0", digits: int = 15,
              short: float = 0.0) -> None:
        """Lines and arcs; the first line ends ``short`` of its arc."""
        on, p = {"layer": layer}, self.corners()
        a, b, r = self.width / 2, self.height / 2, self.radius
        for k in range(4):
            start, end = np.array(p[2 * k]), np.array(p[2 * k + 1])
            end = end - (short if k == 0 else 0) * (end - start) / np.linalg.norm(end - start)
            space.add_line(np.round(start, digits), np.round(end, digits), dxfattribs=on)
        for k, (x, y) in enumerate(((a - r, -b + r), (a - r, b - r), (-a + r, b - r),
                                    (-a + r, -b + r))):
            start = np.degrees(self.angle) + 90 * k - 90
            space.add_arc(np.round(self.place(x, y), digits), round(self.scale * r, digits),
                          round(start % 360, digits), round((start + 90) % 360, digits),
                          dxfattribs=on)


def ellipse(a: float, b: float) -> Truth:
    a, b = max(a, b), min(a, b)
    return Truth(np.pi * a * b, 4 * a * ellipe(1 - (b / a) ** 2))


Draw = Callable[[ezdxf.document.Drawing, Rounded], object]


def rounded(name: str, draw: Draw, version: str = "R2010", units: str = "mm", drawn_in: str = "",
            **more: object) -> None:
    """A case of one rounded rectangle."""
    def write(file: Path, rng: Rng) -> Truth:
        made = document(version, units)
        shape = Rounded(rng, PER_MM[drawn_in or ("mm" if units == "none" else units)])
        draw(made, shape)
        made.saveas(file)
        return shape.truth

    case(name, **more)(write)


def _lines(made: ezdxf.document.Drawing, shape: Rounded) -> None:
    shape.lines(made.modelspace())


for _version in ("R12", "R2000", "R2004", "R2010", "R2018"):
    rounded(f"lines and arcs, {_version}", _lines, version=_version)
rounded("numbers of 4 decimals", lambda made, shape: shape.lines(made.modelspace(), digits=4),
        within=1e-4)
rounded("numbers of 2 decimals", lambda made, shape: shape.lines(made.modelspace(), digits=2),
        within=1e-3)
rounded("gap of 20 um", lambda made, shape: shape.lines(made.modelspace(), short=4e-3),
        within=1e-3)
rounded("gap of 0.2 mm", lambda made, shape: shape.lines(made.modelspace(), short=0.2),
        refused="is open at .* 0.2 mm apart", advice={"tolerance": ""}, within=1e-2)
rounded("R12 polyline with bulges", lambda made, shape: made.modelspace().add_polyline2d(
    shape.polyline(), format="xyb", close=True), version="R12")
rounded("LWPOLYLINE with bulges", lambda made, shape: made.modelspace().add_lwpolyline(
    shape.polyline(), format="xyb", close=True))
rounded("LWPOLYLINE with width and height", lambda made, shape: made.modelspace().add_lwpolyline(
    shape.polyline(), format="xyb", close=True, dxfattribs={"const_width": 0.5, "elevation": 7.0}))
rounded("polyline that repeats its first point", lambda made, shape:
        made.modelspace().add_lwpolyline([*shape.polyline(), shape.polyline()[0]], format="xyb"))
rounded("everything drawn twice", lambda made, shape: [_lines(made, shape), _lines(made, shape)])
rounded("in inches", _lines, units="in")
rounded("in centimetres", _lines, units="cm")
rounded("in metres", _lines, units="m")
rounded("no units", _lines, units="none")
rounded("header in metres, numbers in mm", _lines, units="m", drawn_in="mm",
        refused="numbers are in meters", advice={"unit": ""})
rounded("header in inches, numbers in mm", _lines, units="in", drawn_in="mm", keys={"unit": "mm"})


def _annotated(made: ezdxf.document.Drawing, shape: Rounded) -> None:
    space = made.modelspace()
    _lines(made, shape)
    p = shape.corners()
    space.add_linear_dim(base=(0, -300), p1=p[0], p2=p[1]).render()
    space.add_text("FRAME 1:1", height=5)
    space.add_mtext("PMMA 3 mm")
    space.add_leader([p[0], (0, 0), (10, 0)])
    hatch = space.add_hatch(color=2)
    hatch.paths.add_polyline_path(shape.polyline(), is_closed=True)
    space.add_point(p[3])


def _centre_lines(made: ezdxf.document.Drawing, shape: Rounded) -> None:
    _lines(made, shape)
    for x, y in ((1.2 * shape.width / 2, 0), (0, 1.2 * shape.height / 2)):
        made.modelspace().add_line(shape.place(-x, -y), shape.place(x, y))


def _dashes(made: ezdxf.document.Drawing, shape: Rounded) -> None:
    _lines(made, shape)
    for x in np.arange(-0.6, 0.6, 0.04) * shape.width:
        made.modelspace().add_line(shape.place(x, 0), shape.place(x + 0.03 * shape.width, 0))


def _tail(made: ezdxf.document.Drawing, shape: Rounded) -> None:
    _lines(made, shape)
    made.modelspace().add_line(shape.corners()[0], (500, 500))


def _layers(made: ezdxf.document.Drawing, shape: Rounded, off: bool = False) -> None:
    shape.lines(made.modelspace(), layer="Umriß")
    Rounded(np.random.default_rng(99)).lines(made.modelspace(), layer="construction")
    made.layers.add("construction")
    if off:
        made.layers.get("construction").off()


def _surface(made: ezdxf.document.Drawing, shape: Rounded) -> None:
    shape.lines(made.modelspace(), layer="outline")
    made.modelspace().add_3dface([(0, 0), (1, 0), (1, 1)], dxfattribs={"layer": "solid"})


def _raised(made: ezdxf.document.Drawing, shape: Rounded) -> None:
    shape.lines(made.modelspace(), layer="outline")
    made.modelspace().add_line((0, 0, 0), (0, 0, 5), dxfattribs={"layer": "solid"})


def _diagonal(made: ezdxf.document.Drawing, shape: Rounded) -> None:
    shape.lines(made.modelspace(), layer="outline")
    made.modelspace().add_line(shape.corners()[0], shape.corners()[4], dxfattribs={"layer": "aux"})


rounded("dimension, text, leader, hatch, point", _annotated)
rounded("centre lines", _centre_lines)
rounded("centre line in dashes", _dashes)
rounded("a line that leaves the outline", _tail)
rounded("layers", _layers, keys={"layer": "Umriß"})
rounded("layers, one of them off", lambda made, shape: _layers(made, shape, off=True))
rounded("layers, none named", _layers, refused="has 2 closed curves", advice={"layer": "Umriß"})
rounded("a surface beside it", _surface, refused="3DFACE", advice={"layer": "outline"})
rounded("a line that rises", _raised, refused="must be flat", advice={"layer": "outline"})
rounded("a diagonal", _diagonal, refused="branches", advice={"layer": "outline"})


def _block(made: ezdxf.document.Drawing, shape: Rounded, deep: int = 1, **how: object) -> None:
    shape.lines(made.blocks.new("part 1"))
    for level in range(2, deep + 1):
        made.blocks.new(f"part {level}").add_blockref(f"part {level - 1}", (3, 4))
    made.modelspace().add_blockref(f"part {deep}", (10, -20), dxfattribs=how)


rounded("in a block", _block)
rounded("in a block, turned and mirrored", lambda made, shape: _block(
    made, shape, rotation=30, xscale=-1))
rounded("in a block of a block of a block", lambda made, shape: _block(made, shape, 3))
rounded("in a block on a layer", lambda made, shape: [
    _block(made, shape, layer="cut"), made.modelspace().add_circle((0, 0), 5)],
    keys={"layer": "cut"})


@case("block with two scales")
def _scaled(file: Path, rng: Rng) -> Truth:
    made, (a, b) = document(), rng.uniform(20, 70, 2)
    made.blocks.new("circle").add_circle((1, 2), 1)
    made.modelspace().add_blockref("circle", (10, 0), dxfattribs={"xscale": a, "yscale": b})
    made.saveas(file)
    return ellipse(a, b)


@case("two copies of a block by one reference", refused="has 2 closed curves",
      advice={"inside": ["100 mm", "2 mm"]})
def _array(file: Path, rng: Rng) -> Truth:
    made, radius = document(), rng.uniform(20, 40)
    made.blocks.new("circle").add_circle((0, 0), radius)
    made.modelspace().add_blockref("circle", (0, 0), dxfattribs={"column_count": 2,
                                                                 "column_spacing": 100})
    made.saveas(file)
    return ellipse(radius, radius)


def _half_ellipses(file: Path, rng: Rng) -> Truth:
    made, (a, b) = document(), np.sort(rng.uniform(20, 70, 2))[::-1]
    made.modelspace().add_ellipse((5, 6), (a, 0), b / a, 0, np.pi)
    # Mirrored twice, as programs leave what they turn over.
    made.modelspace().add_ellipse((5, 6), (a, 0), b / a, 0, np.pi,
                                  dxfattribs={"extrusion": (0, 0, -1)})
    made.saveas(file)
    return ellipse(a, b)


case("two half ellipses, one mirrored")(_half_ellipses)


@case("one turned ellipse")
def _ellipse(file: Path, rng: Rng) -> Truth:
    made, (a, b) = document(), np.sort(rng.uniform(20, 70, 2))[::-1]
    turn = rng.uniform(0, np.pi)
    made.modelspace().add_ellipse((5, 6), (a * np.cos(turn), a * np.sin(turn)), b / a)
    made.saveas(file)
    return ellipse(a, b)


@case("rational spline of degree 2")
def _rational(file: Path, rng: Rng) -> Truth:
    made, (a, b), w = document(), rng.uniform(20, 70, 2), 0.5**0.5
    poles = [(a, 0), (a, b), (0, b), (-a, b), (-a, 0), (-a, -b), (0, -b), (a, -b), (a, 0)]
    knots = np.repeat(np.arange(5.0), [3, 2, 2, 2, 3])
    made.modelspace().add_rational_spline(poles, [1, w] * 4 + [1], degree=2, knots=knots)
    made.saveas(file)
    return ellipse(a, b)


@case("spline by fit points", within=1e-4)
def _fit_points(file: Path, rng: Rng) -> Truth:
    made, (a, b) = document(), rng.uniform(20, 70, 2)
    t = np.linspace(0, 2 * np.pi, 121)
    made.modelspace().add_spline(np.column_stack([a * np.cos(t), b * np.sin(t)]))
    made.saveas(file)
    return ellipse(a, b)


@case("closed spline of degree 3", within=1e-6)
def _periodic(file: Path, rng: Rng) -> Truth:
    made, count = document(), 9
    t = 2 * np.pi * np.arange(count) / count
    poles = rng.uniform(35, 55, count)[:, None] * np.column_stack([np.cos(t), np.sin(t)])
    made.modelspace().add_spline().set_closed(np.column_stack([poles, 0 * t]), degree=3)
    made.saveas(file)
    curve = BSpline(np.arange(count + 7.0), np.vstack([poles, poles[:3]]), 3)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    place = (np.arange(3, count + 3)[:, None] + (nodes + 1) / 2).ravel()
    (x, y), (u, v) = curve(place).T, curve(place, 1).T
    weight = np.tile(weights / 2, count)
    return Truth(weight @ (x * v - y * u) / 2, weight @ np.hypot(u, v))


@case("R12 polyline that a spline was fitted to", within=1e-3)
def _fitted(file: Path, rng: Rng) -> Truth:
    made, radius = document("R12"), rng.uniform(20, 60)
    line = made.modelspace().add_polyline2d([], close=True)
    for count, flags, size in ((8, 16, 1.1 * radius), (256, 8, radius)):
        for t in 2 * np.pi * np.arange(count) / count:
            line.append_vertex((size * np.cos(t), size * np.sin(t)), dxfattribs={"flags": flags})
    made.saveas(file)
    return ellipse(radius, radius)


def _ring(file: Path, rng: Rng, part: str) -> Truth:
    made, (a, b) = document(), rng.uniform(30, 60, 2)
    space = made.modelspace()
    space.add_ellipse((0, 0), (a, 0), b / a) if a >= b else space.add_ellipse((0, 0), (0, b), a / b)
    space.add_lwpolyline([(-90, -90), (90, -90), (90, 90), (-90, 90)], close=True)
    for t in 2 * np.pi * np.arange(8) / 8:
        space.add_circle((75 * np.cos(t), 75 * np.sin(t)), 1.6)
    made.saveas(file)
    return ellipse(a, b) if part == "window" else Truth(180.0**2, 720.0)


case("window of a ring with screw holes", keys={"curve": "inner"})(
    lambda file, rng: _ring(file, rng, "window"))
case("rim of a ring with screw holes", keys={"curve": "outer"})(
    lambda file, rng: _ring(file, rng, "rim"))
case("a point in the window", keys={"inside": ["3 mm", "1 mm"]})(
    lambda file, rng: _ring(file, rng, "window"))
case("a ring with screw holes, no curve named", refused="has 10 closed curves",
     advice={"curve": "inner"})(lambda file, rng: _ring(file, rng, "window"))


def _traced(file: Path, rng: Rng) -> Truth:
    made, shape = document(), Rounded(rng)
    made.modelspace().add_lwpolyline(shape.polyline(), format="xyb", close=True)
    made.saveas(file)
    return shape.truth


@case("a filled area alone", refused="1 HATCH.* draw the outline with .* polylines",
      redraw=_traced)
def _hatch(file: Path, rng: Rng) -> Truth:
    made, shape = document(), Rounded(rng)
    made.modelspace().add_hatch().paths.add_polyline_path(shape.polyline(), is_closed=True)
    made.saveas(file)
    return shape.truth


def _dense(file: Path, rng: Rng, count: int, joined: bool) -> Truth:
    made, (a, b) = document(), rng.uniform(30, 60, 2)
    t = 2 * np.pi * np.arange(count) / count
    points = np.column_stack([a * np.cos(t), b * np.sin(t)]).tolist()
    space = made.modelspace()
    if joined:
        space.add_lwpolyline(points, close=True)
    else:
        for start, end in zip(points, points[1:] + points[:1], strict=True):
            space.add_line(start, end)
    made.saveas(file)
    return ellipse(a, b)


case("3,000 lines", within=1e-3)(lambda file, rng: _dense(file, rng, 3000, False))
case("polyline of 100,000 points", within=1e-3, large=True)(
    lambda file, rng: _dense(file, rng, 100_000, True))
case("20,000 lines", within=1e-3, large=True)(lambda file, rng: _dense(file, rng, 20_000, False))
