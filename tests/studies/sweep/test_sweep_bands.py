"""Bands of films that scatter in a sweep: those of each of its films alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tympan
from tympan.base.errors import InputError
from tympan.geometry.outlines import Circle
from tympan.studies.tolerance.given import LengthScatter, Scatter, Tolerances

FILM = """
name = "oval"
[frame]
shape = "ellipse"
semi_axes = ["6 cm", "4.5 cm"]
[plate]
shape = "circle"
radius = "1 cm"
[membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
material = "vhb-4910"
"""

SWEEP = """
specimen = "oval.toml"
mass = ["10 g", "20 g"]
voltage = ["0 kV", "3 kV", "20 kV"]
[grid]
"plate.radius" = ["1 cm", "1.4 cm"]
"""

GIVEN = Tolerances(thickness=Scatter(batch=0.03), load=Scatter(film=0.01))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "oval.toml").write_text(FILM)
    (tmp_path / "SWEEP.toml").write_text(SWEEP)
    return tmp_path / "SWEEP.toml"


@pytest.mark.study(seconds=18)
def test_bands_of_a_sweep_are_those_of_each_film(file: Path) -> None:
    table = tympan.sweep(file, tolerances=GIVEN).table
    film = tympan.load(file.parent / "oval.toml")
    assert film.plate is not None
    wide = replace(film, plate=replace(film.plate, outline=Circle(14e-3)))
    for number, (specimen, mass) in enumerate(((film, 10e-3), (wide, 20e-3))):
        case = table.isel({"specimen": 0, "plate.radius": number, "mass": number, "voltage": 1})
        known = tympan.solve(specimen, mass=mass, voltage=3e3, tolerances=GIVEN).bands
        for edge in ("low", "median", "high"):
            assert case[f"deflection_{edge}_m"].item() == pytest.approx(
                getattr(known["deflection_m"], edge), rel=2e-4)
    assert (table["deflection_low_m"] < table["deflection_m"])[..., :2].all()
    assert (table["deflection_high_m"] > table["deflection_m"])[..., :2].all()
    # No film bears 20 kV.
    assert np.isnan(table["deflection_low_m"][..., 2]).all()
    assert "there is no band" in table["bands_warnings"].values[0, 0, 0, 2]
    assert table["deflection_low_m"].attrs["units"] == "m"


@pytest.mark.study(seconds=5)
def test_a_file_may_ask_for_bands_and_others_keep_their_cases(file: Path) -> None:
    """A sweep without bands has the same cases; one of other tolerances is not mistaken."""
    text = SWEEP.replace('voltage = ["0 kV", "3 kV", "20 kV"]', 'voltage = "3 kV"')
    file.write_text(text.replace('["1 cm", "1.4 cm"]', '["1 cm"]'))
    plain = tympan.sweep(file, folder=file.parent / "out")
    assert "deflection_low_m" not in plain.table
    file.write_text('ask = ["bands"]\n' + file.read_text())
    usual = tympan.sweep(file, folder=file.parent / "out")
    given = tympan.sweep(file, folder=file.parent / "out", tolerances=GIVEN)
    again = tympan.sweep(file, folder=file.parent / "out", tolerances=GIVEN)
    assert [each.kept for each in (plain, usual, given, again)] == [0, 0, 0, 2]
    assert (usual.table["id"] == plain.table["id"]).all()
    assert (again.table["deflection_low_m"] == given.table["deflection_low_m"]).all()
    assert (usual.table["deflection_low_m"] < given.table["deflection_low_m"]).all()


def test_tolerances_of_what_a_film_has_not_are_refused(file: Path) -> None:
    with pytest.raises(InputError, match=r"tolerances\.margin: must be left out"):
        tympan.sweep(file, tolerances=Tolerances(margin=LengthScatter(film=1e-4)))
