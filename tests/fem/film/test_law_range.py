"""The range of a law counts for every stretch that a film visits, the thickness included."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.cli import main
from tympan.fem.film.admissibility import beyond_range
from tympan.fem.film.laws import NeoHooke
from tympan.fem.film.library import load_specimen
from tympan.fem.toml_writer import specimen_to_toml
from tympan.geometry.specimen import Film
from tympan.studies.case import Case, Settings, solve
from tympan.studies.data.coupon import Coupons
from tympan.studies.signals import Pieces
from tympan.studies.transient import TransientCase, respond

ROOT5 = 5**0.5
COARSE = ("--refine", "0.5")
#: A film by a law that strips gave, to stretch 6: their thinnest is 6^-½.
FILM = """name = "zhao"
frame = {shape = "circle", radius = "45 mm"}
plate = {shape = "circle", radius = "1 cm"}
[membrane]
thickness = "1 mm"
prestretch = [2.236, 2.236]
relative_permittivity = 4.7
[membrane.material]
law = "neo_hooke"
mu = "16 kPa"
"""


def words(low: float, high: float, l1: float, l2: float) -> str:
    film = Film(1e-3, (1.0, 1.0), NeoHooke(16e3), 4.7, law_range=(low, high))
    return " ".join(beyond_range(film, np.array([[0.01, 0.02, 0.0]]), np.array([l1]),
                                 np.array([l2])))


@pytest.mark.parametrize(("low", "high", "l1", "l2", "said"), [
    (0.4082, 6, ROOT5, ROOT5, "a thickness stretch of 0.2 at x 10.0 mm, y 20.0 mm"),
    (0.4082, 6, 1.2, 1.2, ""),
    (0.4082, 6, 6.5, 0.6, "a stretch in its plane of 6.5"),
    (0.4082, 6, 2.0, 0.3, "a stretch in its plane of 0.3"),
    (0.04, 5, ROOT5, ROOT5, ""),
    (0.4082, 6, 6.0, 6**-0.5, ""),   # four digits of a strip's own end
    (1, 3, 2.0, 2.0, ""),            # a range in the plane alone: no test stays above 1 throughout
    (1, 3, 3.5, 2.0, "a stretch in its plane of 3.5"),
])
def test_each_principal_stretch_counts(low, high, l1, l2, said) -> None:
    text = words(low, high, l1, l2)
    assert said in text
    assert bool(text) == bool(said)


def test_ranges_of_tests_hold_the_thickness() -> None:
    none = np.full(2, "")
    for mode, low in (("uniaxial", 4**-0.5), ("pure_shear", 1 / 4), ("equibiaxial", 1 / 16)):
        data = Coupons(np.full(2, mode), np.array([2.0, 4.0]), np.ones(2), none, none,
                       np.full(2, np.nan))
        assert data.stretch_range == pytest.approx((low, 4.0))


def test_solve_and_sweep_warn_of_a_film_beyond_its_law(tmp_path: Path, capsys,
                                                       monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    texts = {"fitted": FILM + "range = [0.4082, 6]\n", "wide": FILM + "range = [0.1, 6]\n",
             "plain": FILM}
    warned = {}
    for name, text in texts.items():
        Path(f"{name}.toml").write_text(text, encoding="utf-8")
        assert main(["solve", f"{name}.toml", "--mass", "5 g", "--json", *COARSE]) == 0
        warned[name] = " ".join(json.loads(capsys.readouterr().out)["warnings"])
    assert "used outside its range 0.408 to 6" in warned["fitted"]
    assert "a thickness stretch of 0.2 at x" in warned["fitted"]
    assert "range" not in warned["wide"] + warned["plain"]
    assert main(["solve", "plain.toml", "--mass", "2 kg", "--json", *COARSE]) == 0
    torn, = json.loads(capsys.readouterr().out)["warnings"]
    assert "beyond 6, to which laws are tested: a real film tears before" in torn
    assert main(["limits", "fitted.toml", "--mass", "5 g", "--json", *COARSE]) == 0
    said, = json.loads(capsys.readouterr().out)["warnings"]
    assert "used outside its range 0.408 to 6" in said
    Path("s.toml").write_text('specimen = "fitted.toml"\nmass = "5 g"\nvoltage = "1 kV"\n'
                              '[grid]\n"membrane.thickness" = ["1 mm"]\n', encoding="utf-8")
    assert main(["sweep", "s.toml", "-o", "out", "--workers", "1", *COARSE]) == 0
    assert "used outside its range" in (next(Path("out").glob("*.csv"))).read_text("utf-8")


def test_python_and_files_say_the_same(tmp_path: Path) -> None:
    specimen = circular()
    film = replace(specimen.membrane, law_range=(0.5, 3.0))
    ranged = replace(specimen, membrane=film)
    assert any("outside its range" in text for text in
               solve(Case(ranged, mass=5e-3), Settings()).warnings)
    assert not any("range" in text for text in solve(Case(specimen, mass=5e-3),
                                                     Settings()).warnings)
    file = tmp_path / "x.toml"
    file.write_text(specimen_to_toml(ranged), encoding="utf-8")
    assert load_specimen(file) == ranged
    with pytest.raises(InputError, match="the smaller first"):
        replace(specimen, membrane=replace(film, law_range=(3.0, 1.0)))


def test_a_film_in_time_is_asked_where_it_deflects_most() -> None:
    """Released from 5 kV: within the range at its end, beyond it in the beginning."""
    film = circular()
    signal = Pieces(np.array([0.0, 1.0, 2.0]), np.array([5e3, 5e3, 0.0]))
    most, end = (solve(Case(film, mass=0.1, voltage=voltage), Settings())
                 for voltage in (5e3, 0.0))
    assert most.max_stretch is not None
    assert end.max_stretch is not None
    assert end.max_stretch * 1.1 < most.max_stretch
    between = (end.max_stretch * most.max_stretch) ** 0.5
    warned = []
    for high in (between, most.max_stretch):
        ranged = replace(film, membrane=replace(film.membrane, law_range=(0.05, high)))
        case = TransientCase(ranged, signal, mass=0.1)
        response, done = respond(case, Settings(), 0.1)
        assert done.farthest <= 1.0
        warned.append([words for words in response.warnings if "range" in words])
    said, = warned[0]
    assert said.startswith("at 0 s, where it deflects most, the film's law is used outside its ")
    assert f"a stretch in its plane of {most.max_stretch:.3g} at" in said
    assert warned[1] == []
