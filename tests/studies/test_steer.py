"""Maps of deflection and tilts over the voltages of segments, against finite elements."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

import tympan
from tests.support.specimens import NEO_HOOKE, circular
from tympan.base.errors import InputError
from tympan.geometry.electrode import Electrode, Segment
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Case, Settings, solve
from tympan.studies.films.box import Box
from tympan.studies.steer import SteerCase, SteerResult, steer

COARSE = Settings(MeshSettings().refined(0.6))
MASS = 0.0179
QUARTERS = Electrode(gap=1e-3, segments=tuple(
    Segment(name=name, sector=(number * pi / 2, (number + 1) * pi / 2))
    for number, name in enumerate("ABCD")))


def quarters() -> Specimen:
    return replace(circular(NEO_HOOKE), electrode=QUARTERS)


@pytest.fixture(scope="module")
def mapped() -> SteerResult:
    return steer(SteerCase(quarters(), mass=MASS, voltages={
        "A": "0 kV..2 kV in 9", "B": "0 kV..2 kV in 9", "C": "0.5 kV"}))


def test_drawn_rows_are_those_of_finite_elements(mapped: SteerResult) -> None:
    volts = np.column_stack(list(mapped.voltages.values()))
    assert volts.shape == (81, 4)
    assert set(mapped.by) == {"reduced"}
    assert all(mapped.holds)
    largest = mapped.largest_tilt_rad
    for row in np.random.default_rng(3).choice(81, 8, replace=False).tolist():
        driven = dict(zip("ABCD", volts[row].tolist(), strict=True))
        electrode, top = QUARTERS.driven(driven)
        film = replace(quarters(), electrode=electrode)
        exact = solve(Case(film, mass=MASS, voltage=top), Settings())
        off = [getattr(exact, name) - getattr(mapped, name)[row]
               for name in ("deflection_m", "tilt_x_rad", "tilt_y_rad")]
        assert abs(off[0]) < 1e-4 * exact.deflection_m
        assert np.hypot(*off[1:]) < 1e-3 * largest
        # Row and solution have meshes of their own: that of the row has no mirror plane.
        assert abs(off[0]) < mapped.deflection_error_m[row] + 1e-5 * exact.deflection_m


def test_a_map_has_the_symmetry_of_its_segments() -> None:
    """To exchange A and B mirrors the film in x; the mesh is symmetric to some 1e-3."""
    even = steer(SteerCase(quarters(), mass=MASS, voltages={
        "A": "0 kV..2 kV in 5", "B": "0 kV..2 kV in 5"}))
    along_x, along_y, deflection = (even.values(name).reshape(5, 5) for name in (
        "tilt_x_rad", "tilt_y_rad", "deflection_m"))
    small = 2e-3 * even.largest_tilt_rad
    assert np.abs(along_x + along_x.T).max() < small
    assert np.abs(along_y - along_y.T).max() < small
    assert np.abs(deflection - deflection.T).max() < 1e-5 * deflection.max()
    assert np.nanmax(even.largest_tilts()) <= even.largest_tilt_rad * (1 + 1e-12)


def test_the_mesh_of_a_map_has_only_the_planes_of_all_its_films() -> None:
    box = Box(quarters(), ("electrode.segments.0.share", "electrode.segments.1.share"),
              np.zeros(2), np.ones(2))
    assert not box.general.mirror_planes
    assert quarters().mirror_planes == {"x", "y"}


def test_rows_beyond_a_limit_name_the_segment() -> None:
    """The driven segment pushes bare film together until that loses its tension."""
    film = replace(circular(NEO_HOOKE, prestretch=(1.2, 1.2)), electrode=QUARTERS)
    slack = steer(SteerCase(film, mass=MASS, voltages="A = 10 kV..13 kV in 7, D = 1 kV"), COARSE)
    assert slack.ended[0] == ""
    assert slack.ended[-1] == "loss of tension in bare film"
    assert slack.holds == tuple(not words for words in slack.ended)


def test_both_doors_give_one_map(tmp_path: Path) -> None:
    voltage = "A = 0 kV..2 kV in 3, B = 1 kV"
    found = tympan.steer(quarters(), mass="17.9 g", voltage=voltage, settings=COARSE)
    again = steer(SteerCase(quarters(), mass=MASS, voltages=voltage), COARSE)
    assert found.deflection_m == again.deflection_m
    found.save(tmp_path)
    assert {file.suffix for file in tmp_path.iterdir()} >= {".json", ".csv", ".png", ".svg"}
    assert tympan.Result.load(tmp_path).tilt_y_rad == pytest.approx(again.tilt_y_rad, rel=1e-6)
    assert len(found.to_pandas()) == 3


@pytest.mark.parametrize(("voltages", "words"), [
    ("A = 1 kV", "several values"), ("E = 0 kV..1 kV", "name of a segment"),
    ("A = 1 kV, 0 kV", "ascend"), ({"A": "0 kV..1 kV in 600", "B": "0 kV..1 kV in 600"},
                                   "combinations")])
def test_wrong_voltages_are_named(voltages: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        steer(SteerCase(quarters(), mass=MASS, voltages=voltages), COARSE)
