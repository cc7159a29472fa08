"""Faces, wires and solids of STEP files, in any plane."""

from __future__ import annotations

from pathlib import Path

import cadquery as cq

from benchmarks.trials.drawings.case import Rng, Truth, case
from benchmarks.trials.drawings.dxf import Rounded, ellipse


def _rounded(plane: cq.Plane, shape: Rounded) -> cq.Workplane:
    return (cq.Workplane(plane).rect(shape.width, shape.height)
            .extrude(3).edges(cq.selectors.ParallelDirSelector(plane.zDir)).fillet(shape.radius))


PLANES = {"from above": cq.Plane.named("XY", (3, 4, 5)),
          "from the front": cq.Plane.named("XZ", (3, 4, 5)),
          "from the side": cq.Plane.named("YZ", (3, 4, 5)),
          "askew": cq.Plane((3, 4, 5), (1, 2, 0), (0.3, -0.15, 1))}


def _face(file: Path, rng: Rng, plane: cq.Plane) -> Truth:
    shape = Rounded(rng)
    top = max(_rounded(plane, shape).faces().vals(),
              key=lambda face: plane.toLocalCoords(face).Center().z)
    cq.exporters.export(cq.Workplane(top), str(file), "STEP")
    return shape.truth


def _solid(file: Path, rng: Rng, plane: cq.Plane) -> Truth:
    shape = Rounded(rng)
    cq.exporters.export(_rounded(plane, shape), str(file), "STEP")
    return shape.truth


for _name, _plane in PLANES.items():
    case(f"face seen {_name}", suffix="step")(
        lambda file, rng, plane=_plane: _face(file, rng, plane))
    case(f"solid seen {_name}", suffix="step")(
        lambda file, rng, plane=_plane: _solid(file, rng, plane))


@case("wire", suffix="step")
def _wire(file: Path, rng: Rng) -> Truth:
    shape = Rounded(rng)
    wire = _rounded(cq.Plane.named("XZ"), shape).faces("<Y").wires()
    cq.exporters.export(wire, str(file), "STEP")
    return shape.truth


def _ring(file: Path, rng: Rng) -> Truth:
    a, b = rng.uniform(30, 50, 2)
    ring = cq.Workplane("XY").circle(60).ellipse(a, b).extrude(3)
    ring = ring.faces(">Z").workplane().polarArray(55, 0, 360, 6).hole(3.2)
    cq.exporters.export(ring, str(file), "STEP")
    return ellipse(a, b)


case("ring with screw holes", suffix="step", keys={"curve": "inner"})(_ring)
case("ring with screw holes, no curve named", suffix="step", refused="has 8 closed curves",
     advice={"curve": "inner"})(_ring)


def _tapered(file: Path, rng: Rng, side: str) -> Truth:
    radii = rng.uniform(20, 50, 2)
    cone = cq.Workplane(cq.Solid.makeCone(*radii, 10))
    cq.exporters.export(cone, str(file), "STEP")
    radius = radii[int(side == "top")]
    return ellipse(radius, radius)


for _side in ("top", "bottom"):
    case(f"{_side} of a cone", suffix="step", keys={"face": _side})(
        lambda file, rng, side=_side: _tapered(file, rng, side))


def _disc(file: Path, rng: Rng) -> Truth:
    radius = rng.uniform(20, 50)
    cq.exporters.export(cq.Workplane().circle(radius), str(file), "STEP")
    return ellipse(radius, radius)


@case("ball", suffix="step", refused="has no flat face: export the .* wire", redraw=_disc)
def _ball(file: Path, rng: Rng) -> Truth:
    radius = rng.uniform(20, 50)
    cq.exporters.export(cq.Workplane().sphere(radius), str(file), "STEP")
    return ellipse(radius, radius)
