"""A material of the library is the same through both doors: a specimen file's and Python's."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

import tympan
from tests.support.specimens import circular, specimen_toml
from tympan.fem.film.breakdown import STRENGTH_LIBRARY
from tympan.fem.film.library import MATERIALS, REFUSED, load_specimen
from tympan.geometry.errors import InputError
from tympan.geometry.specimen import Film
from tympan.studies.case import Settings

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
    assert tympan.material(name).source == entry.source


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
    result = tympan.solve(specimen, Settings(), voltage="3 kV")
    field = 3e3 * 2.236**2 / 1e-3
    assert result.breakdown_margin == pytest.approx(30.6e6 * 2.236**1.13 / field, rel=1e-9)
