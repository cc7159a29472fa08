"""Outlines from DXF and STEP files, parts for making, and what is refused of them, with its place.
"""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import cadquery as cq
import ezdxf
import numpy as np
import pytest

from tests.support.specimens import circular
from tympan.base import reader_process
from tympan.base.errors import InputError
from tympan.base.toml_reader import Table
from tympan.base.units import quantity
from tympan.cli import main
from tympan.commands.export import SIZES
from tympan.fem.film.library import load_specimen
from tympan.geometry.cad import membrane as cad
from tympan.geometry.cad import parts
from tympan.geometry.cad.sizes import PartOptions
from tympan.geometry.cad.wires import outline_wire, planar
from tympan.geometry.outlines import (
    OUTLINES,
    Circle,
    Drawn,
    Outline,
    Polygon,
    area,
    check_outline,
    drawings,
    examples,
)
from tympan.geometry.outlines.contours import closed_curves
from tympan.geometry.outlines.drawn import ClosedSpline
from tympan.geometry.outlines.dxf import dxf_sheet
from tympan.geometry.outlines.step import edge_pieces
from tympan.geometry.specimen import Film, Plate, Specimen
from tympan.studies.case import Case
from tympan.studies.shipped import FILES

EXAMPLES = examples()
PLATE = Plate(Circle(10e-3), (2e-3, 1e-3))


def specimen(frame: Outline) -> Specimen:
    film: Film = circular().membrane
    return Specimen("film", frame, PLATE, film)


def imported(folder: Path, **keys: str) -> Outline:
    return OUTLINES.read(Table(folder / "specimen.toml", keys, "frame"))


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawings are read in this process, which is quicker than starting another one."""
    monkeypatch.setattr(drawings, "read_apart", drawings.record)


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("name", EXAMPLES)
def test_what_was_written_reads_back_as_the_same_outline(name: str, tmp_path: Path) -> None:
    frame = EXAMPLES[name]
    film = cad.membrane_part(specimen(frame))
    cad.write_step([film], tmp_path / "film.step")
    parts.write_dxf([film], tmp_path / "film.dxf")
    size = max(frame.semi_axes)
    points = frame.points(1500)
    for keys in ({"shape": "step", "file": "film.step", "curve": "outer"},
                 {"shape": "dxf", "file": "film.dxf", "layer": "outline"},
                 {"shape": "dxf", "file": "film.dxf", "curve": "outer"}):
        again = imported(tmp_path, **keys)
        assert np.abs(again.curve.level(*points)).max() < 1e-9 * size
        assert np.abs(frame.curve.level(*again.points(1500))).max() < 1e-9 * size
        assert area(again) == pytest.approx(area(frame), rel=1e-9)
    hole = imported(tmp_path, shape="dxf", file="film.dxf", layer="opening")
    assert np.abs(hole.level(*Circle(10e-3).points(300))).max() < 1e-12


@pytest.mark.parametrize("name", EXAMPLES)
def test_parts_have_their_holes_and_heights(name: str, tmp_path: Path) -> None:
    made, options = specimen(EXAMPLES[name]), PartOptions()
    holes = options.holes(made.frame)
    assert len(holes) == max(4, np.ceil(made.frame.curve.length / options.spacing))
    assert np.allclose(made.frame.curve.level(*holes.T), options.width / 2, rtol=2e-2)
    for height in (4.0, 2.0):
        ring = parts.ring_part(made.frame, options, height * 1e-3)
        assert ring.isValid()
        wires = parts.flat_wires([ring])
        kinds = [kind for kind, _ in wires]
        assert [kinds.count(kind) for kind in ("outline", "opening", "holes")] == [1, 1, len(holes)]
        assert ring.BoundingBox().zlen == pytest.approx(height, abs=1e-5)
        # OpenCASCADE's areas and volumes within splines err by up to 0.4 %, the curves themselves
        # do not.
        outline, opening = (closed_curves([piece for edge in wire.Edges()
                                           for piece in edge_pieces(edge.wrapped)]).closed[0]
                            for _, wire in wires[:2])
        assert opening.area == pytest.approx(area(made.frame), rel=1e-9)
        # Steiner's formula, which holds around convex outlines.
        steiner = (area(made.frame) + made.frame.curve.length * options.width
                   + np.pi * options.width**2)
        assert outline.area == pytest.approx(steiner, rel=1e-7 if name != "polygon" else 5e-3)
    plate = parts.plate_part(made, options)
    assert plate.Volume() == pytest.approx(2 * np.pi * (10**2 - 1.6**2), rel=1e-6)
    parts.write_svg([ring], tmp_path / "frame.svg")
    text = (tmp_path / "frame.svg").read_text(encoding="utf-8")
    assert text.count("<path") == len(holes) + 2
    width = float(re.search(r'width="([\d.]+)mm"', text)[1])
    assert width == pytest.approx(2e3 * (made.frame.semi_axes[0] + options.width) + 2, abs=0.01)
    assert re.search(rf'viewBox="\S+ \S+ {width:.6f} ', text)


@pytest.mark.parametrize(("outline", "words"), [
    (Polygon(((0.0, 0.0), (0.1, 0.1), (0.1, 0.0), (0.0, 0.1))), "crosses itself at 0, 0 mm"),
    (ClosedSpline(((0.05, 0.0), (-0.05, 0.03), (-0.05, -0.03), (0.05, 0.03), (0.06, -0.01))),
     "crosses itself at"),
    (Polygon(((0.0, 0.0), (0.0, 0.1), (0.1, 0.1), (0.1, 0.0))), "runs clockwise.*at -50, -50 mm"),
    (Polygon(((0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.09998, 0.1), (0.0, 0.1))),
     "0.02 mm long.* at 50, 50 mm"),
    (Polygon(((0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)), 2e-5), "less than 0.001.* at"),
    (Polygon(((-0.1, -0.1), (0.1, -0.1), (0.0, 5e-5), (0.1, 0.1), (-0.1, 0.1), (0.0, -5e-5))),
     "crosses itself|neck"),
    (Polygon(((-0.1, -0.1), (0.1, -0.1), (1e-5, 0.0), (0.1, 0.1), (-0.1, 0.1), (-1e-5, 0.0))),
     "neck narrower .* at"),
])
def test_what_cannot_be_an_outline_is_refused_with_its_place(outline: Outline, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        check_outline(outline, "frame")
    assert caught.value.key == "frame"


def test_a_plate_beyond_a_frame_that_bends_inwards_is_refused_with_its_place() -> None:
    notched = Polygon(((-40e-3, -40e-3), (0.0, -5e-3), (40e-3, -40e-3), (40e-3, 40e-3),
                       (-40e-3, 40e-3)))
    with pytest.raises(InputError, match=r"beyond it at x 0.00 mm, y -5.00 mm"):
        Specimen("film", notched, Plate(Circle(12e-3)), circular().membrane)


def test_fillets_that_do_not_fit_are_refused_with_their_side() -> None:
    with pytest.raises(InputError, match="the side from 0, 0 mm is 10 mm long, "
                                         "the arcs at its ends need 12 mm"):
        check_outline(Polygon(((0.0, 0.0), (0.01, 0.0), (0.01, 0.05), (0.0, 0.05)), 6e-3), "frame")


def _lines(*points: tuple[float, ...]) -> Callable[[ezdxf.layouts.Modelspace], None]:
    def draw(space: ezdxf.layouts.Modelspace) -> None:
        for start, end in pairwise(points):
            space.add_line(start, end)

    return draw


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize(("draw", "words"), [
    (_lines((0, 0), (50, 0), (50, 40), (0, 40)), "is open at (0, 40|50, 40|0, 0)"),
    (_lines((0, 0), (50, 0), (50, 40), (0, 0), (0, 40), (50, 40)),
     "branches at (0, 0|50, 40) mm of the drawing, where more than two lines end: delete"),
    (_lines((0.2, 0), (50, 0), (50, 40), (0, 0)),
     "is open at .*0.2 mm apart: close .* tolerance = \"0.21 mm\""),
    (lambda space: [space.add_circle((0, 0), 30), space.add_circle((0, 0), 10)],
     "has 2 closed curves: 60 x 60 mm about 0, 0 mm; 20 x 20 mm"),
    (_lines((0, 0, 0), (50, 0, 5), (50, 40, 0), (0, 0, 0)),
     "must be flat: a LINE has a point at 50, 0, 5"),
    (lambda space: space.add_circle((0, 0), 40, dxfattribs={"extrusion": (1, 0, 0)}),
     "must be flat: a CIRCLE lies in a plane across 1, 0, 0"),
    (lambda space: space.add_text("nothing"), "no lines, arcs or splines"),
    (lambda space: space.add_3dface([(0, 0), (1, 0), (1, 1)]), "holds 3DFACE"),
])
def test_drawings_that_are_no_outline_are_refused(draw: Callable, words: str,
                                                  tmp_path: Path) -> None:
    document = ezdxf.new(units=ezdxf.units.MM)
    draw(document.modelspace())
    document.saveas(tmp_path / "egg.dxf")
    with pytest.raises(InputError, match=words) as caught:
        imported(tmp_path, shape="dxf", file="egg.dxf")
    assert caught.value.key == "frame.file"
    assert str(caught.value.file).endswith("specimen.toml")


def _spline(poles: list[tuple[float, float]], weights: tuple[float, ...] = ()) -> Callable:
    def draw(space: ezdxf.layouts.Modelspace) -> None:
        spline = space.add_spline(degree=3)
        spline.control_points, spline.weights = poles, weights
        spline.knots = [0.0] * len(poles) + [1.0] * len(poles)

    return draw


def _zigzag(count: int) -> Callable:
    """A rectangle whose lower side goes up and down by a millimetre."""
    teeth = [(0.5 * k, k % 2) for k in range(count + 1)]
    return _lines(*teeth, (0.5 * count, 100), (0, 100), (0, 0))


SQUARE = _lines((0, 0), (50, 0), (50, 40), (0, 40), (0, 0))
POLES = [(0.0, 0.0), (30.0, 0.0), (30.0, 30.0), (0.0, 0.0)]


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize(("draw", "change", "words"), [
    (lambda space: space.add_circle((0, 0), float("nan")), (b"", b""), "radii_m.* finite"),
    (lambda space: space.add_circle((0, 0), 0), (b"", b""), "radii_m: given .* from 1 um"),
    (lambda space: space.add_circle((0, 0), -30), (b"", b""), "radii_m: given .* from 1 um"),
    (lambda space: space.add_circle((0, 0), 1e300), (b"", b""), "radii_m: given .* at most 1e"),
    (_spline([]), (b"", b""), "can be read: it is damaged"),
    (_spline(POLES[:1]), (b"", b""), "can be read: it is damaged"),
    (_spline(POLES, (1, 0, 0, 1)), (b"", b""), "weights positive"),
    (_spline(POLES, (1, -1, 1, 1)), (b"", b""), "weights positive"),
    (lambda space: space.add_lwpolyline([(3, 2, 1e200), (3, 6, 0), (-3, 6, 0)], format="xyb",
                                        close=True), (b"", b""), "finite|within 1 km|can be read"),
    (SQUARE, (b"$INSUNITS\n 70\n4", b"$INSUNITS\n 70\n99"), r"\$INSUNITS is 99"),
    (SQUARE, (b"\n50.0\n", b"\nfifty\n"), "is no DXF file that can be read"),
    (lambda space: [space.add_arc((np.cos(t), np.sin(t)), 5e-3, 0, 100)
                    for t in np.linspace(0, 6, 1500)], (b"", b""), "is open at"),
    (_zigzag(1500), (b"", b""), "has 1503 lines, arcs and splines: at most 1000"),
    (_lines((1, 1), (1, 1)), (b"", b""), "all its lines are points"),
], ids=range(14))
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_hostile_dxf_files_are_refused(draw: Callable, change: tuple[bytes, bytes], words: str,
                                       tmp_path: Path) -> None:
    document = ezdxf.new(units=ezdxf.units.MM)
    draw(document.modelspace())
    document.saveas(tmp_path / "egg.dxf")
    content = (tmp_path / "egg.dxf").read_bytes()
    assert change[0] in content
    (tmp_path / "egg.dxf").write_bytes(content.replace(*change, 1))
    with pytest.raises(InputError, match=words):
        imported(tmp_path, shape="dxf", file="egg.dxf")


@pytest.mark.usefixtures("at_once")
def test_a_layer_in_latin_1_and_lines_without_length(tmp_path: Path) -> None:
    document = ezdxf.new(units=ezdxf.units.MM)
    for start, end in pairwise([(0, 0), (50, 0), (50, 0), (50, 40), (0, 0)]):
        document.modelspace().add_line(start, end, dxfattribs={"layer": "Umriß"})
    document.saveas(tmp_path / "egg.dxf")
    content = (tmp_path / "egg.dxf").read_bytes()
    (tmp_path / "egg.dxf").write_bytes(content.replace("ß".encode(), "ß".encode("latin-1")))
    drawn = imported(tmp_path, shape="dxf", file="egg.dxf", layer="Umriß")
    assert area(drawn) == pytest.approx(50e-3 * 40e-3 / 2)
    with pytest.raises(InputError, match="its layers are Umriß"):
        imported(tmp_path, shape="dxf", file="egg.dxf", layer="Umriss")


def test_a_drawing_that_crashes_its_reader_is_refused(tmp_path: Path) -> None:
    """Each in a process of its own: OpenCASCADE ends with a segmentation fault on the second."""
    face = cq.Face(planar(outline_wire(EXAMPLES["rounded_rectangle"])))
    cad.write_step([face], tmp_path / "egg.step")
    drawn = imported(tmp_path, shape="step", file="egg.step")
    assert area(drawn) == pytest.approx(area(EXAMPLES["rounded_rectangle"]))
    text = (tmp_path / "egg.step").read_text(encoding="utf-8")
    assert "(55.,-25.,0.)" in text
    (tmp_path / "egg.step").write_text(text.replace("(55.,-25.,0.)", "(NaN,-25.,0.)", 1),
                                       encoding="utf-8")
    with pytest.raises(InputError, match="cannot be read: it is damaged"):
        imported(tmp_path, shape="step", file="egg.step")


def test_a_drawing_that_keeps_its_reader_busy_is_refused_soon(tmp_path: Path) -> None:
    """OpenCASCADE never ends on it; a process that waits for it is used, and none is left."""
    corners = [(55e-3, 25e-3), (-55e-3, 25e-3), (-55e-3, -25e-3), (55e-3, -25e-3)]
    cad.write_step([cq.Face(planar(outline_wire(Polygon(tuple(corners)))))], tmp_path / "egg.step")
    text = (tmp_path / "egg.step").read_text(encoding="utf-8")
    assert "(-55.,-25.,0.)" in text
    (tmp_path / "egg.step").write_text(text.replace("(-55.,-25.,0.)", "(NaN,-25.,0.)", 1),
                                       encoding="utf-8")
    named = tmp_path / "specimen.toml"
    named.write_text('[frame]\nshape = "step"\n', encoding="utf-8")
    with reader_process.ready_for([named]):
        (waiting,) = reader_process._waiting
        begun = os.times().children_user
        with pytest.raises(InputError, match="takes far more time than others of its size"):
            imported(tmp_path, shape="step", file="egg.step")
        assert os.times().children_user - begun < reader_process._SECONDS / 2
        assert waiting.returncode == -signal.SIGPROF


def test_a_process_waits_only_for_files_that_name_a_step_drawing(tmp_path: Path) -> None:
    contents = {"circle.toml": 'shape = "circle"', "drawing.step": 'shape = "step"',
                "inline.toml": "frame = {shape = 'step'}"}
    for name, content in contents.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
    others = [tmp_path, tmp_path / "none.toml", tmp_path / "circle.toml", tmp_path / "drawing.step"]
    with reader_process.ready_for(others):
        assert not reader_process._waiting
    with reader_process.ready_for([*others, tmp_path / "inline.toml"]):
        (waiting,) = reader_process._waiting
        assert waiting.poll() is None
    assert waiting.returncode == -signal.SIGKILL
    assert not reader_process._waiting


@pytest.mark.usefixtures("at_once")
def test_polylines_with_bulges_and_other_units(tmp_path: Path) -> None:
    document = ezdxf.new(units=ezdxf.units.CM)
    document.modelspace().add_lwpolyline([(3, 2, 1), (3, 6, 0), (-3, 6, 1), (-3, 2, 0)],
                                         format="xyb", close=True)
    document.saveas(tmp_path / "stadium.dxf")
    outline = imported(tmp_path, shape="dxf", file="stadium.dxf")
    assert outline.semi_axes == pytest.approx((50e-3, 20e-3))
    assert area(outline) == pytest.approx(60e-3 * 40e-3 + np.pi * 20e-3**2, rel=1e-12)


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("curve", ["arc", "ellipse", "polyline"])
def test_curves_that_cad_mirrored_lie_where_they_are_seen(tmp_path: Path, curve: str) -> None:
    """Seen from behind: with x to the left where they are written so, and running the other way."""
    document, behind = ezdxf.new(units=ezdxf.units.MM), {"extrusion": (0, 0, -1)}
    space = document.modelspace()
    space.add_line((-10, 30), (50, 30))
    if curve == "arc":
        space.add_arc((-20, 30), 30, 180, 360, dxfattribs=behind)
    elif curve == "ellipse":
        space.add_ellipse((20, 30), (30, 0), 0.5, 0, np.pi, dxfattribs=behind)
    else:
        space.add_lwpolyline([(-50, 30), (-50, 10), (10, 10), (10, 30)], dxfattribs=behind)
    document.saveas(tmp_path / "mirrored.dxf")
    outline = imported(tmp_path, shape="dxf", file="mirrored.dxf")
    exact = {"arc": np.pi * 30**2 / 2, "ellipse": np.pi * 30 * 15 / 2, "polyline": 60 * 20}[curve]
    assert area(outline) == pytest.approx(1e-6 * exact, rel=1e-6)


@pytest.mark.usefixtures("at_once")
@pytest.mark.parametrize("head", ["", "0\nSECTION\n2\nHEADER\n0\nENDSEC\n"], ids=["none", "empty"])
def test_a_drawing_whose_head_names_no_units_is_in_millimetres(tmp_path: Path, head: str) -> None:
    (tmp_path / "circle.dxf").write_text(
        f"{head}0\nSECTION\n2\nENTITIES\n0\nCIRCLE\n8\n0\n10\n0\n20\n0\n40\n40\n0\nENDSEC\n0\nEOF\n",
        encoding="utf-8")
    assert imported(tmp_path, shape="dxf", file="circle.dxf").semi_axes == pytest.approx(
        (40e-3, 40e-3))


@pytest.mark.usefixtures("at_once")
def test_step_files_that_are_no_outline_are_refused(tmp_path: Path) -> None:
    cad.write_step([cq.Solid.makeSphere(10, angleDegrees1=-90)], tmp_path / "ball.step")
    cad.write_step([cq.Edge.makeLine(cq.Vector(0, 0, 0), cq.Vector(10, 0, 0))],
                   tmp_path / "open.step")
    (tmp_path / "none.step").write_text("no", encoding="utf-8")
    for name, words in (("ball", "has no flat face"), ("open", "is open at 0, 0 mm and 10, 0 mm"),
                        ("none", "is no STEP file"),
                        ("missing", "cannot be read: No such file")):
        with pytest.raises(InputError, match=words):
            imported(tmp_path, shape="step", file=f"{name}.step")


@pytest.mark.usefixtures("at_once")
def test_splines_of_other_degrees_come_close(tmp_path: Path) -> None:
    document = ezdxf.new(units=ezdxf.units.MM)
    space = document.modelspace()
    space.add_rational_spline([(30, 0), (30, 30), (0, 30)], [1, 0.5**0.5, 1], degree=2)
    space.add_arc((0, 0), 30, 90, 360)
    document.saveas(tmp_path / "circle.dxf")
    outline = imported(tmp_path, shape="dxf", file="circle.dxf")
    assert isinstance(outline, Drawn)
    assert np.abs(outline.level(*Circle(30e-3).points(500))).max() < 1e-9 * 30e-3
    assert len(dxf_sheet(tmp_path / "circle.dxf", "*", None).pieces) == 2


def test_the_command_takes_the_sizes_of_the_parts(tmp_path: Path,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    command = ["export", str(FILES["circular"]), "-o", str(tmp_path), "--refine", "0.5"]
    assert main([*command, "--screw", "3 mm", "--width", "12 mm", "--spacing", "30 mm",
                 "--plate-height", "3 mm"]) == 0
    plate = cq.importers.importStep(str(tmp_path / "circular-plate.step")).val()
    assert plate.Volume() == pytest.approx(3 * np.pi * (10**2 - 1.5**2), rel=1e-6)
    frame = cq.importers.importStep(str(tmp_path / "circular-frame.step")).val()
    count = np.ceil(2 * np.pi * 45 / 30)
    assert frame.Volume() == pytest.approx(4 * np.pi * (57**2 - 45**2 - count * 1.5**2), rel=1e-6)
    capsys.readouterr()
    assert main([*command, "--screw", "6 mm"]) == 2
    assert capsys.readouterr().err == ("tympan: --screw: given '6 mm': "
                                       "must be at most half the width of the ring\n")
    assert main([*command, "--width", "-1 mm"]) == 2
    assert "--width: given '-1 mm': must be from 10 um to 10 m" in capsys.readouterr().err


def test_the_command_s_default_sizes_are_the_parts_own() -> None:
    assert PartOptions(**{name: quantity(text, "length")
                          for name, (text, _) in SIZES.items()}) == PartOptions()


def test_curves_are_counted_before_a_library_reads_them(tmp_path: Path) -> None:
    """Those of blocks, which draw nothing by themselves, are not, nor a layer named alike."""
    document = ezdxf.new()
    document.layers.add("ENTITIES")
    block = document.blocks.new("many")
    for number in range(5):
        block.add_line((0, 0), (number + 1, 0))
    document.modelspace().add_circle((0, 0), 30)
    document.modelspace().add_line((0, 0), (1, 0), dxfattribs={"layer": "ENTITIES"})
    document.saveas(tmp_path / "few.dxf")
    assert drawings._curves((tmp_path / "few.dxf").read_bytes()) == 2


@pytest.mark.usefixtures("at_once")
def test_a_plate_drawn_off_the_centre_of_its_frame_is_told(tmp_path: Path) -> None:
    """Followed, the advice ends the remark; stated, drawn apart or beside, there is none."""
    document = ezdxf.new()
    document.units = ezdxf.units.MM
    for layer, x, radius in (("frame", 200.0, 40.0), ("plate", 205.08, 8.0), ("away", 300.0, 8.0),
                             ("centred", 200.001, 8.0)):
        document.modelspace().add_circle((x, 50.0), radius, {"layer": layer})
    for name in ("one.dxf", "copy.dxf"):
        document.saveas(tmp_path / name)

    def film(layer: str, file: str = "one.dxf", **more: Any) -> Specimen:
        plate = {"shape": "dxf", "file": file, "layer": layer, **more}
        content = {"name": "film", "plate": plate,
                   "frame": {"shape": "dxf", "file": "one.dxf", "layer": "frame"},
                   "membrane": {"thickness": "1 mm", "prestretch": 2, "material": "vhb-4910"}}
        return load_specimen(Table(tmp_path / "film.toml", content))

    told, = film("plate").drawn_elsewhere
    assert told == ("plate: is centred in the frame, but was drawn at 5.08, 0 mm from its centre: "
                    'if it belongs there, write offset = ["5.08 mm", "0 mm"] below [plate]')
    assert told in film("plate").remarks
    assert told in Case(film("plate")).remarks
    assert film("plate").centre == (0, 0)
    for other in (film("plate", offset=["5.08 mm", "0 mm"]), film("plate", "copy.dxf"),
                  film("away"), film("centred"), film("plate", offset=["1 mm", "2 mm"])):
        assert other.drawn_elsewhere == ()
