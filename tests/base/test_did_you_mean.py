"""What was meant: keys, shapes, names and arguments near those that exist, in files and in Python.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import tympan
from tests.support.specimens import OVAL, VHB, circular, specimen_toml
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.library import load_specimen
from tympan.options import parse_quantities

AXES = 'semi_axes = ["6 cm", "4.5 cm"]'


@pytest.mark.parametrize(("old", "new", "words"), [
    (AXES, 'width = "12 cm"\nheight = "9 cm"',
     "frame.semi_axes: is missing: did you mean it by 'width' and 'height'? "
     "It holds half extents along x and y"),
    (AXES, 'semi_axis = ["6 cm", "4.5 cm"]',
     "frame.semi_axes: is missing: did you mean it by 'semi_axis'?"),
    (AXES, f'{AXES}\nwidth = "12 cm"',
     "frame.width: unknown key: did you mean 'semi_axes' (half extents along x and y)? known here"),
    ('radius = "1 cm"', 'diameter = "2 cm"', "plate.radius: is missing: did you mean it by 'diam"),
    ("[membrane]", "[film]", "membrane: is missing: did you mean it by 'film'?"),
    ("[plate]", "[disc]", "disc: unknown key: did you mean 'plate' (the rigid plate; left out"),
    ('"ellipse"', '"oval"', "drawn, dxf, ellipse, "),
    ('"ellipse"', '"oval"', "; did you mean 'ellipse'?"),
    ('"ellipse"', '"square"', "; did you mean 'rounded_rectangle'?"),
    ('"vhb-4910"', '"vhb4910"', "; did you mean 'vhb-4910'?"),
    ('"vhb-4910"', '"VHB 4910"', "; did you mean 'vhb-4910'?"),
    ('"vhb-4910"', '"VHB 4905"', "; did you mean 'vhb-4905'?"),
    ('radius = "1 cm"', 'radius = "1,5 cm"',
     'radius: given \'1,5 cm\': must have a decimal point, no comma: "1.5 cm"'),
    ("relative_permittivity", "permittivity",
     "membrane.permittivity: unknown key: did you mean 'relative_permittivity' (ε_r of the mounte"),
    (AXES, f'{AXES}\nname = "x"',
     "frame.name: unknown key: it belongs to the top of the file, above the tables there; known"),
])
def test_a_key_is_asked_about(tmp_path: Path, old: str, new: str, words: str) -> None:
    file = tmp_path / "oval.toml"
    assert old in specimen_toml()
    file.write_text(specimen_toml().replace(old, new, 1))
    with pytest.raises(InputError) as wrong:
        load_specimen(file)
    assert str(wrong.value).startswith(f"{file}: ")
    assert words in str(wrong.value)


@pytest.mark.parametrize(("option", "given", "words"), [
    ("--voltage", "3 KV", "unknown unit: did you mean 'kV'? must be a voltage"),
    ("--voltage", "3 xyz", "unknown unit: must be a voltage"),
    ("--mass", "20 gramm", "unknown unit: did you mean 'g'? must be a mass"),
    ("--mass", "20 Kg", "unknown unit: did you mean 'kg'? must be a mass"),
    ("--voltage", "3,5 kV", 'must have a decimal point, no comma: "3.5 kV"'),
    ("--voltage", "1,000 V", 'must have a decimal point, no comma: "1.000 V" or "1000 V"'),
    ("--voltage", "1,000,5 V", "unknown unit: must be a voltage"),
])
def test_a_unit_or_a_decimal_comma_is_asked_about(tmp_path: Path, option: str, given: str,
                                                  words: str,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml())
    assert main(["solve", str(tmp_path / "oval.toml"), "--mass", "20 g", option, given]) == 2
    assert words in capsys.readouterr().err


def test_quantities_without_blanks_between_are_read() -> None:
    assert parse_quantities("0 kV,3.5 kV, 4 kV", "voltage", "--voltage") == (0, 3500, 4000)
    with pytest.raises(InputError, match=r'no comma: "3\.5 kV"'):
        parse_quantities("0 kV, 3,5 kV", "voltage", "--voltage")


def test_a_missing_file_is_looked_for_in_its_folder(tmp_path: Path) -> None:
    (tmp_path / "oval.toml").write_text(specimen_toml())
    (tmp_path / "ovl.csv").touch()
    for name, words in (("ovl.toml", "; did you mean 'oval.toml'?"), ("rigid.toml", "directory"),
                        ("none/oval.toml", "directory")):
        with pytest.raises(InputError) as wrong:
            load_specimen(tmp_path / name)
        assert str(wrong.value).endswith(words)


RECTANGLE = 'shape = "rounded_rectangle"\ncorner_radius = "1 cm"\n'


def rectangle(folder: Path, sizes: str, first: str = RECTANGLE) -> tympan.RoundedRectangle:
    """The frame of a specimen file that gives the sizes of a rectangle so."""
    file = folder / "rectangle.toml"
    file.write_text(specimen_toml().replace(OVAL, first + sizes))
    frame: tympan.RoundedRectangle = load_specimen(file).frame
    return frame


def test_a_rectangle_may_have_width_and_height(tmp_path: Path) -> None:
    frame = rectangle(tmp_path, 'width = "12 cm"\nheight = "90 mm"')
    assert frame == rectangle(tmp_path, AXES) == tympan.RoundedRectangle((0.06, 0.045), 0.01)
    assert frame == tympan.RoundedRectangle(width="12 cm", height=0.09, corner_radius="1 cm")


@pytest.mark.parametrize(("sizes", "words"), [
    ({"width": "12 cm"}, "height: is missing"),
    ({"width": "12 cm", "height": "9 cm", "semi_axes": ["6 cm", "4.5 cm"]},
     "width: given '12 cm': give width and height, or semi_axes, not both"),
    ({"width": "12 g", "height": "9 cm"}, "width: given '12 g': wrong dimension"),
    ({"width": "12 cm", "hight": "9 cm"}, "did you mean"),
    ({}, "semi_axes: is missing"),
])
def test_a_rectangle_has_one_kind_of_size(tmp_path: Path, sizes: dict[str, object],
                                          words: str) -> None:
    with pytest.raises(InputError) as wrong:
        rectangle(tmp_path, "\n".join(f"{name} = {value!r}" for name, value in sizes.items()))
    assert words in str(wrong.value)
    with pytest.raises(InputError) as wrong:
        tympan.RoundedRectangle(corner_radius=0.01, **sizes)
    assert words in str(wrong.value)


def test_half_a_width_must_be_a_size(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"frame.width: given '30 m': half of it must be positive"):
        rectangle(tmp_path, 'width = "30 m"\nheight = "9 cm"')


def test_what_is_far_from_any_key_is_not_guessed(tmp_path: Path) -> None:
    file = tmp_path / "oval.toml"
    file.write_text(specimen_toml().replace(OVAL, 'shape = "ellipse"\ncolour = "red"'))
    with pytest.raises(InputError, match=r"frame.semi_axes: is missing \(half extents [^?]*\)$"):
        load_specimen(file)


def test_a_missing_key_says_what_it_holds(tmp_path: Path) -> None:
    for ask in (lambda: rectangle(tmp_path, AXES, 'shape = "rounded_rectangle"\n'),
                lambda: tympan.RoundedRectangle(width="6 cm", height="6 cm")):
        with pytest.raises(InputError, match=r'corner_radius: is missing .*"0 mm" leaves them sh'):
            ask()


def film(**values: object) -> tympan.Film:
    return tympan.Film(**({"thickness": "1 mm", "prestretch": 2, "material": "vhb-4910"} | values))


@pytest.mark.parametrize(("ask", "words"), [
    (lambda: tympan.Film(thicknes="1 mm"), "thicknes: unknown name: did you mean 'thickness'?"),
    (lambda: tympan.Film("1 mm"), "prestretch: is missing"),
    (lambda: tympan.Film("1 mm", thickness="1 mm"), "thickness: is given twice"),
    (lambda: tympan.Circle(diameter="9 cm"), "diameter: unknown name: did you mean 'radius' (its"),
    (lambda: tympan.Ellipse("6 cm", "4 cm"), "given '4 cm': of what is given without a name there"),
    (lambda: tympan.Ellipse("6 cm"), "semi_axes: given '6 cm': must be 2 numbers"),
    (lambda: tympan.Ellipse(("6 cm", "4 g")), "semi_axes: given '4 g': wrong dimension"),
    (lambda: film(prestretch=(2, 2, 2)), "prestretch: given (2, 2, 2): must be 2 numbers"),
    (lambda: film(prestretch="2"), "prestretch: given '2': must be one number"),
    (lambda: film(thickness=np.array([1e-3, 2e-3])),
     "must be one number with its unit or in m; call once for each of several"),
    (lambda: film(thickness=None), "thickness: must be one number"),
    (lambda: film(material="vhb4910"), "; did you mean 'vhb-4910'?"),
    (lambda: film(material="ogden"), "material: given 'ogden': must be one of ecoflex-00-30, "),
    (lambda: film(material=tympan.NeoHooke("20 kPa")),
     "relative_permittivity: is missing: the library lists none for this material"),
    (lambda: tympan.material("chewing gum"), "material: given 'chewing gum': must be one of "),
    (lambda: tympan.Specimen("oval", tympan.Circle("4 cm"), film=film()),
     "film: unknown name: did you mean 'membrane' (the film)?"),
    (lambda: tympan.solve(circular(), masss="20 g"), "masss: unknown name: did you mean 'mass'?"),
    (lambda: tympan.solve(circular(), setings=None), "did you mean 'settings'?"),
    (lambda: tympan.solve(circular(), voltage=np.linspace(0, 3e3, 4)),
     "must be one: this question is about one state; curve, force and sweep take several"),
    (lambda: tympan.solve(circular(), mass=["20 g", 1]), "must be one: this question is"),
    (lambda: tympan.solve(mass="20 g"), "specimen: is missing"),
    (lambda: tympan.curve(circular(), mass="20 g", sttings=1), "did you mean 'settings'?"),
    (lambda: tympan.transient(circular(), hihg="3 kV"), "did you mean 'high'?"),
    (lambda: tympan.optimise(fil="x.toml"), "fil: unknown name: did you mean 'file'?"),
])
def test_an_argument_is_asked_about(ask: Callable[[], object], words: str) -> None:
    with pytest.raises(InputError) as wrong:
        ask()
    assert words in str(wrong.value)
    assert "\n" not in str(wrong.value)


def test_one_prestretch_is_that_of_both_axes(tmp_path: Path) -> None:
    file = tmp_path / "oval.toml"
    both = specimen_toml(film=VHB)
    file.write_text(both.replace("[2.236, 2.236]", "2.236"))
    assert load_specimen(file).membrane == film(prestretch=2.236)
    assert film(prestretch=2.236).prestretch == (2.236, 2.236)
    assert film(prestretch=np.array([2.2, 2.1])) == film(prestretch=[2.2, 2.1])


def test_numbers_of_numpy_are_numbers() -> None:
    assert film(thickness=np.float32(2**-10)).thickness == 2**-10
    assert film(thickness=np.array(1e-3)).thickness == 1e-3
