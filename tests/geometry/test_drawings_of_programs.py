"""Drawings as CAD programs write them: those of the trial, and files that users could not read."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from scipy.special import ellipe

from benchmarks.trials.drawings import CASES, Case
from tympan.base.errors import InputError
from tympan.base.toml_reader import Table
from tympan.fem.film.library import load_specimen
from tympan.geometry.outlines import OUTLINES, Outline, area, drawings, perimeter
from tympan.geometry.outlines.contours import closed_curves
from tympan.geometry.outlines.pieces import Arc, Line

FILES = Path(__file__).parent / "drawings"
#: An ellipse of 120 x 80 mm.
OVAL = np.pi * 60 * 40, 4 * 60 * ellipe(1 - (40 / 60) ** 2)


@pytest.fixture(autouse=True)
def _at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawings are read in this process, which is quicker than starting another one."""
    monkeypatch.setattr(drawings, "read_apart", drawings.record)


def read(name: str, **keys: object) -> Outline:
    table = {"shape": Path(name).suffix[1:], "file": name} | keys
    return OUTLINES.read(Table(FILES / "specimen.toml", table, "frame"))


def sizes(outline: Outline) -> tuple[float, float]:
    """Area [mm²] and perimeter [mm]."""
    return 1e6 * area(outline), 1e3 * perimeter(outline)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("case", [case for case in CASES if not case.large],
                         ids=lambda case: f"{case.suffix}: {case.name}")
def test_a_drawing_is_read_right_or_refused_with_advice_that_works(case: Case, tmp_path: Path
                                                                   ) -> None:
    fault, said = case.fault(tmp_path, seed=1)
    assert not fault, said


def test_a_gap_of_a_rounding_is_closed_and_told() -> None:
    outline = read("gap.dxf")
    assert sizes(outline) == pytest.approx((80 * 80 + np.pi * 40**2 - 40 * 80,
                                            2 * 40 + 2 * np.pi * 40), rel=1e-5)
    assert outline.remarks == ("closed 2 gaps, the widest 0.0003 mm at -20.0003, -40 mm of the "
                               "drawing",)
    with pytest.raises(InputError, match=r'0.0003 mm apart: .* tolerance = "0.00031 mm"'):
        read("gap.dxf", tolerance="0.0001 mm")
    assert read("gap.dxf", tolerance="0.00031 mm") == outline


def test_a_block_is_expanded() -> None:
    assert sizes(read("block.dxf")) == pytest.approx(OVAL)


def test_a_centre_line_is_left_out_and_told() -> None:
    outline = read("centreline.dxf")
    assert sizes(outline) == pytest.approx(OVAL)
    assert outline.remarks == ("left out 1 open curve, from -65, 0 mm to 65, 0 mm",)


def test_the_window_of_a_ring_with_screw_holes() -> None:
    for keys in ({"curve": "inner"}, {"inside": ["10 mm", "0 mm"]}):
        outline = read("ring_holes.dxf", **keys)
        assert sizes(outline) == pytest.approx(OVAL)
        assert outline.remarks[-1].startswith("left out 9 other closed curves: 150 x 110 mm")
    with pytest.raises(InputError, match=r'150 x 110 mm .* and 7 more. Choose .*curve = "inner"'):
        read("ring_holes.dxf", curve="only")
    with pytest.raises(InputError, match="no closed curve around 500, 0 mm"):
        read("ring_holes.dxf", inside=["500 mm", "0 mm"])


def test_a_wrong_unit_is_told_and_overridden() -> None:
    with pytest.raises(InputError, match=r'its numbers are in meters .* add unit = "mm"'):
        read("metres.dxf")
    assert sizes(read("metres.dxf", unit="mm")) == pytest.approx(OVAL)
    with pytest.raises(InputError, match=r"frame.unit: given 'kg': must be a unit of length"):
        read("metres.dxf", unit="kg")


def test_a_face_of_a_solid_frame() -> None:
    for face in ("largest", "top", "bottom"):
        outline = read("ring_solid.step", curve="inner", face=face)
        assert sizes(outline) == pytest.approx(OVAL)
        assert f"took the {face} flat face" in outline.remarks[0]
    with pytest.raises(InputError, match=r'has 2 closed curves.*curve = "inner"'):
        read("ring_solid.step")


def test_a_frame_with_a_gap_is_refused_though_a_hole_in_it_is_closed(tmp_path: Path) -> None:
    """The hole must not be taken for the outline."""
    document = ezdxf.new(units=ezdxf.units.MM)
    document.modelspace().add_circle((0, 0), 5)
    document.modelspace().add_lwpolyline([(-30, -20), (30, -20), (30, 20), (-30, 20), (-30, -19.8)])
    document.saveas(tmp_path / "frame.dxf")
    table = Table(tmp_path / "a.toml", {"shape": "dxf", "file": "frame.dxf"}, "frame")
    with pytest.raises(InputError, match=r"open at -30, -20 mm and -30, -19.8 mm .* 0.2 mm apart"):
        OUTLINES.read(table)


def test_ends_that_are_moved_together_meet() -> None:
    """Also those of arcs; nothing else moves by more than the gap."""
    gap = 0.02e-3
    pieces = [Line((0.0, 0.0), (0.04, 0.0)), Arc((0.04, 0.01), (0.01, 0.01), -np.pi / 2, np.pi),
              Line((0.04 - gap, 0.02), (0.0, 0.02)), Arc((0.0, 0.01 - gap), (0.01, 0.01),
                                                         np.pi / 2, np.pi)]
    curve, = closed_curves(pieces, 1.1 * gap).closed
    ends = np.array([piece.at(np.array([0.0, 1.0]))[0] for piece in curve.pieces])
    assert np.abs(ends[:, 1] - np.roll(ends[:, 0], -1, axis=0)).max() < 1e-15
    exact = closed_curves([*pieces[:2], Line((0.04, 0.02), (0.0, 0.02)),
                           Arc((0.0, 0.01), (0.01, 0.01), np.pi / 2, np.pi)]).closed[0]
    assert np.abs(exact.level(*curve.points(400))).max() < 1.01 * gap


def test_lines_are_thinned_within_the_tolerance_and_only_where_they_are_too_many() -> None:
    def circle(count: int) -> list[Line]:
        t = 2 * np.pi * np.arange(count + 1) / count
        p = 0.05 * np.column_stack([np.cos(t), np.sin(t)])
        return [Line((a[0], a[1]), (b[0], b[1])) for a, b in pairwise(p.tolist())]

    few, many = closed_curves(circle(900)), closed_curves(circle(20_000))
    assert len(few.closed[0].pieces) == 900
    assert not few.remarks
    assert 50 < len(many.closed[0].pieces) < 400
    assert "thinned 20000 lines to" in many.remarks[0]
    radii = np.linalg.norm(many.closed[0].points(3000), axis=0)
    assert radii.min() > 0.05 - 1.01e-5
    assert radii.max() <= 0.05 + 1e-12


def test_arcs_that_are_too_many_become_lines_within_the_tolerance() -> None:
    """A circle of 1,500 arcs, and a wavy one of 3,000, half of them short splines or lines."""
    turn = 2 * np.pi / 1500
    arcs = [Arc((0.0, 0.0), (0.05, 0.05), k * turn, turn) for k in range(1500)]
    contours = closed_curves(arcs)
    assert contours.remarks[0].startswith("replaced 1500 arcs, splines and lines by ")
    outline = contours.closed[0]
    assert len(outline.pieces) < 400
    radii = np.linalg.norm(outline.points(5000), axis=0)
    assert radii.min() > 0.05 - 1.01e-5
    assert radii.max() < 0.05 + 1.01e-5
    mixed = [piece for k, arc in enumerate(arcs) for piece in (
        arc.part(0.0, 0.5), arc.part(0.5, 1.0) if k % 2 else Line(
            *(tuple(end) for end in arc.part(0.5, 1.0).at(np.array([0.0, 1.0]))[0].tolist())))]
    coarse = closed_curves(mixed, 0.2e-3).closed[0]
    assert len(coarse.pieces) < len(outline.pieces)
    radii = np.linalg.norm(coarse.points(5000), axis=0)
    assert radii.min() > 0.05 - 0.201e-3


def test_an_arc_that_takes_too_many_lines_stays_an_arc() -> None:
    angle = np.linspace(np.pi, 2 * np.pi, 1101)
    corners = np.column_stack([np.cos(angle), np.sin(angle)])
    corners[[0, -1]] = [[-1, 0], [1, 0]]
    below = [Line((u, v), (x, y)) for (u, v), (x, y) in pairwise(corners.tolist())]
    curve, = closed_curves([Arc((0.0, 0.0), (1.0, 1.0), 0.0, np.pi), *below], 1e-9).closed
    assert len(curve.pieces) == 1101
    assert curve.area == pytest.approx(np.pi, rel=1e-5)


def test_advice_on_too_many_arcs_helps(tmp_path: Path) -> None:
    """A coil-like rim of 1,200 deep arcs: refused, and read with the tolerance that is named."""
    document = ezdxf.new(units=ezdxf.units.MM)
    turn = 2 * np.pi * np.arange(1201) / 1200
    rim = 45 + 0.08 * (np.arange(1201) % 2)
    points = [(r * np.cos(t), r * np.sin(t), 0.5) for r, t in zip(rim, turn, strict=True)][:-1]
    document.modelspace().add_lwpolyline(points, format="xyb", close=True)
    document.saveas(tmp_path / "rim.dxf")

    def read_with(**keys: object) -> Outline:
        table = {"shape": "dxf", "file": "rim.dxf"} | keys
        return OUTLINES.read(Table(tmp_path / "a.toml", table, "frame"))

    with pytest.raises(InputError, match=r'at most 1000 .* tolerance = "0.2 mm", makes them few'):
        read_with()
    outline = read_with(tolerance="0.2 mm")
    assert sizes(outline)[0] == pytest.approx(np.pi * 45.04**2, rel=0.01)


@pytest.mark.parametrize(("unit", "said"), [(None, 'its numbers look like metres, unit = "m"'),
                                            ("m", "")])
def test_a_drawing_in_metres_that_does_not_say_so(tmp_path: Path, unit: str | None,
                                                  said: str) -> None:
    """The message on the plate, which does not fit into 0.09 mm, names unit and guess."""
    document = ezdxf.new(units=0)
    document.modelspace().add_circle((0, 0), 0.045)
    document.saveas(tmp_path / "frame.dxf")
    stated = f', unit = "{unit}"' if unit else ""
    (tmp_path / "film.toml").write_text(
        f'name = "x"\nframe = {{ shape = "dxf", file = "frame.dxf"{stated} }}\n'
        'plate = { shape = "circle", radius = "1 cm" }\n[membrane]\nthickness = "1 mm"\n'
        'prestretch = [2, 2]\nmaterial = "vhb-4910"\n', encoding="utf-8")
    if said:
        with pytest.raises(InputError, match="must lie inside the frame") as refused:
            load_specimen(tmp_path / "film.toml")
        assert said in str(refused.value)
    else:
        assert load_specimen(tmp_path / "film.toml").frame.semi_axes[0] == pytest.approx(0.045)
