"""A material of the library is the same through both doors: a specimen file's and Python's."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

import tympan
from benchmarks.external import library_laws
from tests.support.specimens import circular, specimen_toml
from tympan.base.errors import InputError
from tympan.fem.film.breakdown import STRENGTH_LIBRARY
from tympan.fem.film.library import MATERIALS, REFUSED, load_specimen
from tympan.geometry.mesher import MeshSettings
from tympan.geometry.specimen import Film
from tympan.studies.case import Case, Settings, solve

COARSE = Settings(MeshSettings(order=3).refined(0.5))

GIVEN = "relative_permittivity = 4.7\n"


@pytest.mark.parametrize("name", MATERIALS)
def test_a_film_is_the_same_through_both_doors(tmp_path: Path, name: str) -> None:
    entry, file = MATERIALS[name], tmp_path / "film.toml"
    text = specimen_toml(film=f'material = "{name}"')
    listed = entry.relative_permittivity is not None
    file.write_text(text.replace(GIVEN, "") if listed else text)
    given = {} if listed else {"relative_permittivity": 4.7}
    of_file = load_specimen(file).membrane
    for material in (tympan.material(name), name):
        of_python = tympan.Film("1 mm", 2.236, material, **given)
        for field in fields(Film):
            assert getattr(of_python, field.name) == getattr(of_file, field.name), field.name
    # What the library's entry holds, so that both are not wrong alike.
    assert of_file.material == entry.material
    assert of_file.branches == entry.branches
    assert of_file.strength == (STRENGTH_LIBRARY[entry.breakdown].strength if entry.breakdown
                                else None)
    assert of_file.relative_permittivity == (entry.relative_permittivity or 4.7)
    assert of_file.law_range == entry.law_range
    assert tympan.material(name).source == entry.source


#: Prestretch, virgin thickness [m] and load [kg] of a film of each kind that moves a plate.
FILMS = {"vhb": (2.236, 1e-3, 0.01), "ecoflex": (2.0, 0.5e-3, 0.01),
         "elastosil": (1.2, 100e-6, 0.01), "sylgard": (1.06, 50e-6, 0.01),
         "natural": (1.5, 200e-6, 0.02)}


@pytest.mark.parametrize("name", MATERIALS)
def test_a_film_of_each_mounts_solves_and_finds_its_limits(name: str) -> None:
    prestretch, thickness, mass = FILMS[name.partition("-")[0]]
    entry = MATERIALS[name]
    given = {} if entry.relative_permittivity else {"relative_permittivity": 3.0}
    film = tympan.Film(thickness, prestretch, name, **given)
    specimen = tympan.Specimen(name, tympan.Circle("4.5 cm"), circular().plate, film)
    rest = solve(Case(specimen, mass=mass), COARSE)
    charged = solve(Case(specimen, mass=mass, voltage=1000.0), COARSE)
    assert rest.deflection_m is not None
    assert charged.deflection_m is not None
    assert 5e-4 < rest.deflection_m < charged.deflection_m < 0.02
    assert not [text for text in rest.warnings if "range" in text]
    limits = tympan.limits(specimen, settings=COARSE, mass=mass).limits
    assert limits.limit is not None
    assert 100.0 < limits.limit.voltage_V < 20e3
    assert (limits.breakdown is not None) <= bool(entry.breakdown)


@pytest.mark.parametrize("name", MATERIALS)
def test_scatter_has_a_source_and_is_a_share(name: str) -> None:
    scatter = MATERIALS[name].scatter
    shares = [scatter.thickness, scatter.stiffness, scatter.permittivity]
    assert bool(scatter.source) == any(share is not None for share in shares)
    assert all(share is None or 0 < share < 0.5 for share in shares)


def test_laws_of_silicones_and_rubber_are_those_of_their_script() -> None:
    """And what they were not fitted to: another mode, another rubber, hardness."""
    constants, errors = library_laws.rubber()
    law = MATERIALS["natural-rubber"].material
    assert [*law.mu, *law.alpha] == pytest.approx(constants.tolist(), rel=1e-5)
    assert errors["pure_shear"] < 0.02
    assert all(0.97 < factor < 1.05
               for factor in library_laws.other_rubber(constants).values())
    line, error = library_laws.sylgard()
    assert MATERIALS["sylgard-184"].material.c == pytest.approx(line.c, rel=1e-5)
    assert error < 0.011
    assert MATERIALS["elastosil-2030"].material == library_laws.ELASTOSIL
    off = {check.what: check.off for check in library_laws.checks()}
    assert off["initial modulus, from Shore A 27 [Pa]"] == pytest.approx(0.08, abs=0.01)
    assert off["nominal stress at break, stretch 2.4 [Pa]"] == pytest.approx(-0.27, abs=0.01)


def test_a_film_beyond_its_law_s_tests_is_told() -> None:
    film = tympan.Film(100e-6, 1.6, "elastosil-2030")
    specimen = tympan.Specimen("far", tympan.Circle("4.5 cm"), circular().plate, film)
    assert any("outside its range 0.52 to 1.38" in text
               for text in solve(Case(specimen, mass=0.01), COARSE).warnings)


def test_what_a_film_says_itself_counts() -> None:
    strength = STRENGTH_LIBRARY["vhb-4910-embedded"].strength
    film = tympan.Film("1 mm", 2.236, tympan.material("vhb-4910-viscous"), 3.2, strength=strength,
                       branches=())
    assert (film.relative_permittivity, film.strength, film.branches) == (3.2, strength, ())
    assert film == tympan.Film("1 mm", 2.236, "vhb-4910-viscous", 3.2, branches=[],
                               strength="vhb-4910-embedded")


def test_without_permittivity_in_library_or_file_there_is_no_film(tmp_path: Path) -> None:
    unknown = [name for name, entry in MATERIALS.items() if entry.relative_permittivity is None]
    assert unknown
    file = tmp_path / "film.toml"
    file.write_text(specimen_toml(film=f'material = "{unknown[0]}"').replace(GIVEN, ""))
    with pytest.raises(InputError, match=r"membrane.relative_permittivity: is missing: the libr"):
        load_specimen(file)


def test_a_material_that_is_refused_is_refused_in_python() -> None:
    for name, reason in REFUSED.items():
        with pytest.raises(InputError, match="cannot be a membrane material") as refused:
            tympan.material(name)
        assert reason in str(refused.value)


def test_the_margin_to_breakdown_of_a_film_made_in_python() -> None:
    """The margin is strength over field: closed form on the flat film, E = U λ²/T."""
    film = tympan.Film("1 mm", 2.236, tympan.material("vhb-4910"))
    specimen = tympan.Specimen("flat", tympan.Circle("4.5 cm"), circular().plate, film)
    result = tympan.solve(specimen, mass="0 g", settings=Settings(), voltage="3 kV")
    field = 3e3 * 2.236**2 / 1e-3
    assert result.breakdown_margin == pytest.approx(30.6e6 * 2.236**1.13 / field, rel=1e-9)
