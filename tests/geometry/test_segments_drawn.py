"""Segments of an electrode from the layers of one drawing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import ezdxf
import numpy as np
import pytest

from tests.support.segmented import driven_quarters
from tympan.base.errors import InputError
from tympan.fem.film.library import load_specimen
from tympan.geometry.electrode import Region
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, solve

#: Frame, gap between segments and their outer radius [mm]; the frame's place in the drawing.
RADIUS, GAP, OUTER, AT = 45.0, 1.0, 44.0, (120.0, -35.0)
FILM = """
name = "drawn"
[frame]
shape = "dxf"
file = "film.dxf"
layer = "FRAME"
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = 2.236
relative_permittivity = 4.7
material = { law = "ogden", mu = ["25 kPa"], alpha = [2] }
[electrode]
"""
SEGMENT = """
[[electrode.segment]]
name = "%s"
outline = { shape = "dxf", file = "film.dxf", layer = "%s"%s }
"""


def draw(folder: Path) -> None:
    """Draw a frame and four quarters, each on its layer, with the middle far from the origin."""
    document = ezdxf.new(units=ezdxf.units.MM)
    space = document.modelspace()
    space.add_circle(AT, RADIUS, dxfattribs={"layer": "FRAME"})
    along = np.sqrt(OUTER**2 - (GAP / 2) ** 2)
    angle = np.arctan2(GAP / 2, along)
    for number, name in enumerate("ABCD"):
        turn = np.exp(1j * np.pi / 2 * number)
        corners = turn * np.array([GAP / 2 * (1 + 1j), along + 1j * GAP / 2, GAP / 2 + 1j * along])
        bulge = np.tan((np.pi / 2 - 2 * angle) / 4)
        space.add_lwpolyline([(point.real + AT[0], point.imag + AT[1], bulge * (row == 1))
                              for row, point in enumerate(corners)], format="xyb", close=True,
                             dxfattribs={"layer": name})
    document.saveas(folder / "film.dxf")


def drawn(folder: Path, more: str = "", names: str = "ABCD") -> Specimen:
    draw(folder)
    (folder / "film.toml").write_text(
        FILM + "".join(SEGMENT % (name, name, more) for name in names))
    return load_specimen(folder / "film.toml")


@pytest.fixture(scope="module")
def specimen(tmp_path_factory) -> Specimen:
    return drawn(tmp_path_factory.mktemp("drawing"))


def test_each_segment_is_where_the_drawing_has_it(specimen: Specimen) -> None:
    for number, segment in enumerate(specimen.electrode.segments):
        assert segment.outline is not None
        middle = np.exp(1j * np.pi / 4 * (2 * number + 1))
        assert np.sign(segment.outline.offset).tolist() == [*np.sign([middle.real, middle.imag])]
        # The box of a quarter reaches from half the gap to its edge.
        half = (GAP / 2 + np.sqrt(OUTER**2 - (GAP / 2) ** 2)) / 2
        assert np.abs(segment.outline.offset) == pytest.approx(half * 1e-3, rel=1e-9)
    assert specimen.drawn_elsewhere == ()


def test_drawn_quarters_are_the_sectors_of_the_same_size(specimen: Specimen) -> None:
    sectors = driven_quarters(gap=GAP * 1e-3, margin_frame=(RADIUS - OUTER) * 1e-3)
    angle, away = np.meshgrid(np.linspace(0, 2 * np.pi, 733), np.linspace(10.1e-3, 44.9e-3, 59))
    x, y = away * np.cos(angle), away * np.sin(angle)
    found = specimen.electrode.segment_at(x, y, specimen.frame)
    expected = np.where(away < OUTER * 1e-3,
                        sectors.electrode.segment_at(x, y, sectors.frame), -1)
    assert (found == expected).all()
    drive = {"A": 3e3, "B": 1e3}
    one, other = (solve(Case(replace(film, electrode=film.electrode.driven(drive)[0]), mass=20e-3,
                             voltage=3e3), Settings()) for film in (specimen, replace(
        sectors, membrane=specimen.membrane)))
    for key in ("deflection_m", "tilt_x_rad", "tilt_y_rad", "capacitance_F"):
        assert getattr(one, key) == pytest.approx(getattr(other, key), rel=2e-4)


def test_an_offset_that_is_given_places_the_segment(tmp_path: Path) -> None:
    moved = drawn(tmp_path, more=', offset = ["2 cm", "1 cm"]', names="A")
    outline = moved.electrode.segments[0].outline
    assert outline is not None
    assert outline.offset == pytest.approx((0.02, 0.01))


def test_a_specimen_that_is_made_again_keeps_the_places(specimen: Specimen) -> None:
    again = replace(specimen, name="again")
    assert again.electrode == specimen.electrode
    bare = tuple(replace(segment, outline=Region(segment.outline.outline))
                 for segment in specimen.electrode.segments if segment.outline is not None)
    made = replace(specimen, electrode=replace(specimen.electrode, segments=bare))
    assert made.electrode == specimen.electrode


def test_a_layer_that_is_not_there_is_named(tmp_path: Path) -> None:
    draw(tmp_path)
    (tmp_path / "film.toml").write_text(FILM + SEGMENT % ("A", "Z", ""))
    with pytest.raises(InputError, match="A, B, C, D") as refused:
        load_specimen(tmp_path / "film.toml")
    assert str(refused.value.key).startswith("electrode.segment.0.outline")
