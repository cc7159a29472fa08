"""Outlines of segments given by corners lie where their corners are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tympan.base.toml_reader import Table
from tympan.fem.film.library import load_specimen
from tympan.fem.toml_writer import specimen_content
from tympan.geometry.specimen import Specimen

#: A quarter of the film by its corners.
QUARTER = '"polygon", vertices = [["0 cm", "0 cm"], ["5 cm", "0 cm"], ["5 cm", "5 cm"], ' \
          '["0 cm", "5 cm"]]'
CIRCLE = 'shape = "circle"\nradius = "4.5 cm"'
#: The frame's own corners, of which one is the origin.
SQUARE = ('shape = "polygon"\nvertices = [["0 cm", "0 cm"], ["9 cm", "0 cm"], ["9 cm", "9 cm"], '
          '["0 cm", "9 cm"]]')


def film(folder: Path, outline: str, frame: str = CIRCLE, more: str = "") -> Specimen:
    file = folder / "film.toml"
    file.write_text(
        f'name = "film"\n[frame]\n{frame}\n[plate]\nshape = "circle"\nradius = "1 cm"\n'
        '[membrane]\nthickness = "1 mm"\nprestretch = 2.236\nmaterial = "vhb-4910"\n'
        f'[[electrode.segment]]\nname = "A"\noutline = {{ shape = {outline}{more} }}\n')
    return load_specimen(file)


def covered(specimen: Specimen, x: float, y: float) -> bool:
    places = np.array([x]), np.array([y])
    return bool(specimen.electrode.segment_at(*places, specimen.frame)[0] == 0)


@pytest.mark.parametrize("outline", [
    QUARTER,
    '"spline", through = [["0.5 cm", "0.5 cm"], ["4 cm", "0.5 cm"], ["3 cm", "3 cm"], '
    '["0.5 cm", "4 cm"]]'])
def test_a_part_by_corners_lies_where_they_are(outline: str, tmp_path: Path) -> None:
    made = film(tmp_path, outline)
    assert covered(made, 20e-3, 20e-3)
    for x, y in ((-20e-3, 20e-3), (-20e-3, -20e-3), (20e-3, -20e-3)):
        assert not covered(made, x, y)
    assert load_specimen(Table("", specimen_content(made))).electrode == made.electrode


def test_corners_count_from_the_origin_of_the_frame_s(tmp_path: Path) -> None:
    made = film(tmp_path, QUARTER, SQUARE)
    # From the frame's centre, at 4.5 cm of its corners, the quarter ends at 0.5 cm.
    assert covered(made, -20e-3, -20e-3)
    assert not covered(made, 20e-3, 20e-3)
    assert not covered(made, 6e-3, -20e-3)


def test_an_offset_places_the_centre_of_the_box(tmp_path: Path) -> None:
    made = film(tmp_path, QUARTER, more=', offset = ["-2.5 cm", "2.5 cm"]')
    assert covered(made, -20e-3, 20e-3)
    assert not covered(made, 20e-3, 20e-3)


def test_a_turned_part_turns_about_the_centre_of_its_box(tmp_path: Path) -> None:
    made = film(tmp_path, QUARTER, more=', rotation = "90 deg"')
    assert covered(made, 20e-3, 20e-3)
    assert not covered(made, -20e-3, 20e-3)


def test_an_electrode_that_is_centred_says_so(tmp_path: Path) -> None:
    file = tmp_path / "film.toml"
    film(tmp_path, QUARTER)
    text = file.read_text().replace('[[electrode.segment]]\nname = "A"\noutline',
                                    "[electrode]\noutline")
    file.write_text(text)
    remark, = load_specimen(file).drawn_elsewhere
    assert remark.startswith("electrode.outline: is centred in the frame, but was drawn at 25, 25")
