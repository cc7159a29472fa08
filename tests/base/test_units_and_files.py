"""Quantities and specimen files at the border: what is accepted, and one clear message for what is
not."""

from __future__ import annotations

import contextlib
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tympan.base.errors import InputError
from tympan.base.units import (
    DIMENSIONS,
    USUAL,
    AnglePerTime,
    WrongDimension,
    pint_factor,
    quantity,
    unit_factor,
)
from tympan.cli import main
from tympan.fem.film.laws import Ogden
from tympan.fem.film.library import load_specimen
from tympan.fem.rig import Rig
from tympan.geometry.outlines import Ellipse
from tympan.studies.shipped import FILES, actuators

GOOD = """
name = "good"
[frame]
shape = "ellipse"
semi_axes = ["6 cm", "45 mm"]
[plate]
shape = "circle"
radius = "1 cm"
offset = ["2 mm", "0 mm"]
[membrane]
thickness = "1 mm"
prestretch = [2.2360679775, 2.2]
relative_permittivity = 4.7
[membrane.material]
law = "ogden"
mu = ["16 kPa", "0.02 kPa"]
alpha = [2, 4]
[electrode]
margin_frame = "1 mm"
"""

OGDEN = GOOD[GOOD.index('law = "ogden"') : GOOD.index("[electrode]")].rstrip()

#: (what is replaced, by what, the key the message must name, a word of the rule it must state)
BAD = [
    ('name = "good"', 'name = "good"\nnme = 1', "nme", "unknown key: did you mean 'name'"),
    ('name = "good"', 'name = "../good"', "name", "file name"),
    ('name = "good"', 'name = ""', "name", "non-empty"),
    ('radius = "1 cm"', "radius = 1", "plate.radius", "unit"),
    ('radius = "1 cm"', 'radius = "1"', "plate.radius", "unit"),
    ('radius = "1 cm"', 'radius = "1 kg"', "plate.radius", "wrong dimension"),
    ('radius = "1 cm"', 'radius = "1 florin"', "plate.radius", "unknown unit"),
    ('radius = "1 cm"', 'radius = "1 mm +"', "plate.radius", "unit"),
    ('radius = "1 cm"', 'radius = "-1 cm"', "plate.radius", "positive"),
    ('radius = "1 cm"', 'radius = "nan cm"', "plate.radius", "length"),
    ('radius = "1 cm"', "", "plate.radius", "missing"),
    ('radius = "1 cm"', 'radius = "5 cm"', "plate", "inside the frame"),
    ('"2 mm", "0 mm"', '"52 mm", "0 mm"', "plate", "inside the frame"),
    ('"2 mm", "0 mm"', '"2 mm"', "plate.offset", "list of 2"),
    ("2.2360679775, 2.2", "0, 2.2", "membrane.prestretch", "stretch between"),
    ("2.2360679775, 2.2", "-2, 2", "membrane.prestretch", "stretch between"),
    ("2.2360679775, 2.2", "true, 2", "membrane.prestretch", "number"),
    ('thickness = "1 mm"', 'thickness = "-1 mm"', "membrane.thickness", "positive"),
    ('thickness = "1 mm"', 'thickness = "inf mm"', "membrane.thickness", "positive"),
    ("relative_permittivity = 4.7", "relative_permittivity = 0.5", "membrane.relative_permittivity",
     "at least 1"),
    ('shape = "circle"', 'shape = "heart"', "plate.shape", "circle, drawn"),
    ('"0.02 kPa"]', '"-3 kPa"]', "membrane.material", "admissible"),
    ("alpha = [2, 4]", "alpha = [2]", "membrane.material.mu", "same length"),
    ("alpha = [2, 4]", "alpha = [2, 0]", "membrane.material.alpha", "zero"),
    ('law = "ogden"', 'law = "jelly"', "membrane.material.law", "ogden"),
    (OGDEN, 'law = "neo_hooke"\nmu = "-1 kPa"', "membrane.material.mu",
     "given '-1 kPa': must be positive"),
    (OGDEN, 'law = "neo_hooke"\nmu = "1 kPa"\nalpha = 2', "membrane.material.alpha", "unknown key"),
    (OGDEN, 'law = "mooney_rivlin"\nc10 = "8 kPa"', "membrane.material.c01", "missing"),
    (OGDEN, 'law = "mooney_rivlin"\nc10 = "8 kPa"\nc01 = "-1 kPa"', "membrane.material",
     "admissible"),
    (OGDEN, 'law = "yeoh"\nc = []', "membrane.material.c", "list"),
    (OGDEN, 'law = "yeoh"\nc = ["8 kPa", "-1 kPa"]', "membrane.material", "admissible"),
    (OGDEN, 'law = "gent"\nmu = "18 kPa"\nj_lim = 0', "membrane.material.j_lim", "positive"),
    (OGDEN, 'law = "gent"\nmu = "18 kPa"\nj_lim = "110 kPa"', "membrane.material.j_lim",
     "without a unit"),
    (OGDEN, 'law = "gent"\nmu = "18 kPa"\nj_lim = 6', "membrane.prestretch", "locks before it"),
    (OGDEN, 'law = "arruda_boyce"\nmu = "18 kPa"\nlambda_lock = 1', "membrane.material.lambda_lock",
     "above 1"),
    ('margin_frame = "1 mm"', 'margin_frame = "40 mm"', "electrode", "margins"),
    ('margin_frame = "1 mm"', 'margin_frame = "-1 mm"', "electrode.margin_frame", "negative"),
    ("[membrane]", "[membrane", "", "not valid TOML"),
]


@pytest.fixture
def write(tmp_path: Path):
    def _write(text: str) -> Path:
        file = tmp_path / "specimen.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return _write


def test_good_file(write) -> None:
    specimen = load_specimen(write(GOOD))
    assert specimen.frame == Ellipse((60e-3, 45e-3))
    assert specimen.plate.offset == (2e-3, 0)
    assert specimen.membrane.material == Ogden((16e3, 20.0), (2, 4))
    assert specimen.electrode.margin_frame == 1e-3
    assert specimen.mirror_planes == {"y"}


@pytest.mark.parametrize(("old", "new", "key", "words"), BAD)
def test_bad_files_end_with_one_message_and_status_2(write, capsys, old, new, key, words) -> None:
    file = write(GOOD.replace(old, new, 1))
    assert GOOD.count(old) >= 1
    assert main(["solve", str(file), "--mass", "1 g"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert f"{file}: {key}" in err
    assert words in err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--mass", "17.9"], "--mass: given '17.9': has no unit"),
        (["--mass", "-1 g"], "--mass"),
        (["--mass", "1 g", "--voltage", "3 A"], "--voltage: given '3 A': wrong dimension"),
        (["--mass", "1 g", "--refine", "0"], "--refine"),
        (["--mass", "1 g", "--rig", "nowhere.toml"], "nowhere.toml: cannot be read"),
    ],
)
def test_bad_options(write, capsys, arguments, words) -> None:
    assert main(["solve", str(write(GOOD)), *arguments]) == 2
    assert words in capsys.readouterr().err


def test_missing_and_binary_files(tmp_path, capsys) -> None:
    assert main(["solve", str(tmp_path / "none.toml"), "--mass", "1 g"]) == 2
    assert "none.toml: cannot be read: No such file" in capsys.readouterr().err
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    assert main(["solve", str(tmp_path / "b.toml"), "--mass", "1 g"]) == 2
    assert "b.toml: is not UTF-8" in capsys.readouterr().err


def test_paper_constants_are_refused_with_the_reason(write, capsys) -> None:
    text = GOOD[: GOOD.index("[membrane.material]")] + 'material = "paper-table-1"\n'
    assert main(["solve", str(write(text)), "--mass", "1 g"]) == 2
    assert "stress falls with stretch" in capsys.readouterr().err


def test_unknown_material_lists_the_library(write, capsys) -> None:
    text = GOOD[: GOOD.index("[membrane.material]")] + 'material = "chewing gum"\n'
    assert main(["solve", str(write(text)), "--mass", "1 g"]) == 2
    assert "vhb-4910" in capsys.readouterr().err


def test_shipped_actuators_load() -> None:
    axes = {specimen.name: specimen.frame.semi_axes for specimen in actuators()}
    assert axes == {"circular": (0.045, 0.045), "elliptical-small": (0.06, 0.045),
                    "elliptical-large": (0.075, 0.045)}
    assert list(axes) == list(FILES)


def test_rig_file(tmp_path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text('gravity = "9.81 m/s^2"\nspring = "5 N/m"\n'
                    'sag_voltage = "20 kV"\nsensor_zero = "-3 um"\n')
    rig = Rig.read(file)
    assert rig == Rig(gravity=9.81, spring=5, sag_voltage=20e3, sensor_zero=-3e-6)
    assert rig.reading(1e-3) == pytest.approx(0.997e-3)
    file.write_text("sensor_gain = -1\n")
    with pytest.raises(InputError, match="sensor_gain"):
        Rig.read(file)


@given(st.floats(-1e6, 1e6),
       st.sampled_from([("length", "mm", 1e-3), ("mass", "g", 1e-3), ("stress", "kPa", 1e3),
                                              ("voltage", "kV", 1e3), ("stress", "g/mm/s^2", 1.0)]))
def test_quantities_are_read_as_written(number: float, unit: tuple[str, str, float]) -> None:
    dimension, name, factor = unit
    assert quantity(f"{number!r} {name}", dimension) == pytest.approx(number * factor, rel=1e-14,
                                                                      abs=1e-300)


@given(st.text(max_size=12), st.sampled_from(sorted(DIMENSIONS)))
def test_no_text_breaks_the_reader(text: str, dimension: str) -> None:
    with contextlib.suppress(InputError):
        assert isinstance(quantity(text, dimension), float)


@pytest.mark.parametrize("unit", USUAL)
def test_usual_units_are_those_of_pint(unit: str) -> None:
    """Alone and as a factor of every dimension that has one like it."""
    agreed = 0
    for dimension, item in DIMENSIONS.items():
        names = re.findall(r"[A-Za-z]+", item.si)
        for written in {unit, *(item.si.replace(name, unit, 1) for name in names)}:
            try:
                expected = pint_factor(written, dimension)
            except WrongDimension:
                continue
            except AnglePerTime:
                with pytest.raises(InputError, match="unit of frequency"):
                    unit_factor(written, dimension)
                continue
            assert unit_factor(written, dimension) == pytest.approx(expected, rel=1e-15)
            agreed += 1
    assert agreed > 0


@pytest.mark.parametrize("unit", ["rad/s", "deg/hour", "krad/s", "mrad/hour", "arcmin/s", "rpm",
                                  "cycle/s", "cps"])
def test_an_angle_per_time_is_no_frequency(unit: str) -> None:
    """Whether the table of usual units knows it, or pint, with whatever prefix."""
    with pytest.raises(InputError, match="unit of frequency"):
        unit_factor(unit, "frequency")


def test_usual_units_need_no_table_of_all_others(tmp_path: Path) -> None:
    code = ("import sys; from tympan.base.units import quantity\n"
            "for text, kind in (('4.5 cm', 'length'), ('1 um/min', 'speed'), ('5°', 'angle'),\n"
            "                   ('960 kg/m³', 'density'), ('62.4 kPa s', 'viscosity')):\n"
            "    quantity(text, kind)\n"
            "print('pint' in sys.modules)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
    assert quantity("1 inch", "length") == pytest.approx(25.4e-3)
