"""Breakdown: strength laws by hand, the margin in closed form on the flat film, its place, and what
files may say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

from tests.support.models import model
from tests.support.specimens import NEO_HOOKE, PATCH_TOML, ROOT5, circular
from tympan.base.errors import InputError
from tympan.fem.film.breakdown import (
    STRENGTH_LIBRARY,
    STRENGTHS,
    ConstantStrength,
    PowerStrength,
)
from tympan.fem.film.library import MATERIALS, load_specimen
from tympan.fem.results.fields import cell_fields
from tympan.geometry.mesh import ELEMENTS
from tympan.geometry.specimen import Electrode, Region
from tympan.studies.case import Case, Settings, solve
from tympan.studies.film_surface import film_surface

VHB = STRENGTH_LIBRARY["vhb-4910"].strength
WEIGHT = 17.9e-3


@pytest.mark.parametrize("name", STRENGTH_LIBRARY)
def test_library(name: str) -> None:
    """Every strength has a source and a caveat, and does not fall with the stretch at one virgin
    thickness; one that depends on the stretch grows.
    """
    entry = STRENGTH_LIBRARY[name]
    assert entry.source
    assert entry.caveat
    stretch = np.linspace(1, 6, 11)
    fields = entry.strength.field(stretch, stretch, 1e-3 / stretch**2)
    assert np.all(np.diff(fields) > 0) or isinstance(entry.strength, ConstantStrength)
    assert np.all(np.diff(fields) >= 0)
    assert 1e6 < fields[0] <= fields[-1] < 1e9


def test_sources_agree_on_the_exponent_at_one_virgin_thickness() -> None:
    """E_b ∝ h^−0.25 λ^0.63 with h = H/λ² is ∝ λ^1.13: that of Koh et al."""
    stretch = np.array([1.5, 3.0])
    for name in ("vhb-4910", "vhb-4910-embedded"):
        entry = STRENGTH_LIBRARY[name]
        first, last = entry.strength.field(stretch, stretch, 1e-3 / stretch**2)
        assert np.log(last / first) / np.log(2.0) == pytest.approx(1.13, rel=1e-12)


def test_laws_by_hand() -> None:
    assert VHB.field(5.0, 5.0, 1.0) == pytest.approx(30.6e6 * 6.1637, rel=1e-4)  # 5^1.13 = 6.1637
    assert ConstantStrength(20e6).field(2.0, 3.0, 1e-4) == 20e6
    assert PowerStrength(10e6, 2.0, 1.0, 2e-4).field(8.0, 2.0, 1e-4) == pytest.approx(10e6 * 16 * 2)


def test_margin_of_the_flat_film_is_that_of_a_plate_capacitor() -> None:
    specimen = circular(strength=PowerStrength(30e6, 0.8, 0.3, 5e-4))
    made = model(specimen)
    [fields] = cell_fields(made, [made.mounted(4000.0**2)], ELEMENTS[4].doflocs.T)
    field, strength = 4000.0 / 0.2e-3, 30e6 * ROOT5**0.8 * (0.2 / 0.5) ** -0.3
    assert np.allclose(fields.breakdown_share, field / strength, rtol=1e-12)


def test_smallest_margin_and_its_place() -> None:
    """Under load the film is thinnest at the plate, where a constant strength is used up first."""
    case = Case(circular(strength=ConstantStrength(40e6)), mass=WEIGHT, voltage=5000.0)
    result = solve(case, Settings())
    assert result.max_field_V_per_m is not None
    assert result.breakdown_margin == pytest.approx(40e6 / result.max_field_V_per_m, rel=1e-12)
    assert np.hypot(result.breakdown_x_m, result.breakdown_y_m) == pytest.approx(10e-3, rel=1e-9)
    assert not result.warnings


def test_margin_is_sought_under_the_electrode_only() -> None:
    region = Region(circular().plate.outline, (30e-3, 0.0))
    specimen = replace(circular(strength=ConstantStrength(40e6)),
                       electrode=Electrode(outline=region))
    result = solve(Case(specimen, mass=WEIGHT, voltage=4000.0), Settings())
    assert region.level(result.breakdown_x_m, result.breakdown_y_m) < 1e-9


@pytest.mark.parametrize(("strength", "words"),
                         [(20e6, "breakdown at"), (30e6, "near breakdown (margin 1."),
                                                 (40e6, None)])
def test_warnings(strength: float, words: str | None) -> None:
    result = solve(Case(circular(strength=ConstantStrength(strength)),
                        mass=WEIGHT, voltage=5000.0), Settings())
    assert result.status == "equilibrium"
    warnings = [text for text in result.warnings if "break" in text]
    assert bool(warnings) == bool(words)
    if words:
        assert words in warnings[0]
        assert f"of {strength / 1e6:g} MV/m" in warnings[0]


@pytest.mark.parametrize(("strength", "voltage"), [(None, 3000.0), (VHB, 0.0)])
def test_no_margin_without_law_or_voltage(strength: PowerStrength | None, voltage: float) -> None:
    result = solve(Case(circular(strength=strength), mass=WEIGHT, voltage=voltage), Settings())
    assert result.breakdown_margin is result.breakdown_x_m is result.breakdown_y_m is None


def test_stored_fields(tmp_path: Path) -> None:
    made = model(circular(NEO_HOOKE, strength=VHB), refine=0.7, order=2)
    film_surface(made, made.mounted(3000.0**2)).save(tmp_path / "film.vtu")
    stored = meshio.read(tmp_path / "film.vtu").point_data
    share = stored["electric_field"] / VHB.field(stored["stretch_1"], stored["stretch_2"],
                                                 stored["thickness"])
    assert np.allclose(stored["breakdown_share"], share, rtol=1e-12)


def test_default_goes_with_the_library_material(tmp_path: Path) -> None:
    file = tmp_path / "film.toml"
    file.write_text(PATCH_TOML)
    assert load_specimen(file).membrane.strength == VHB
    for name in MATERIALS:
        file.write_text(PATCH_TOML.replace("vhb-4910", name))
        assert (load_specimen(file).membrane.strength == VHB) == name.startswith("vhb-49")
    material = 'material = { law = "neo_hooke", mu = "20 kPa" }'
    file.write_text(PATCH_TOML.replace('material = "vhb-4910"', material))
    assert load_specimen(file).membrane.strength is None


@pytest.mark.parametrize(("line", "strength"), [
    ('breakdown = "vhb-4910-embedded"', STRENGTH_LIBRARY["vhb-4910-embedded"].strength),
    ('breakdown = { law = "constant", strength = "20 kV/mm" }', ConstantStrength(20e6)),
    ('breakdown = { law = "power", strength = "30.6 MV/m", exponent = 1.13 }', VHB),
    ('breakdown = { law = "power", strength = "51 MV/m", exponent = 0.63, '
     'thickness_exponent = 0.25, thickness = "1 mm" }',
     STRENGTH_LIBRARY["vhb-4910-embedded"].strength),
])
def test_strength_in_a_file(tmp_path: Path, line: str,
                            strength: PowerStrength | ConstantStrength) -> None:
    file = tmp_path / "film.toml"
    file.write_text(PATCH_TOML.replace("thickness =", f"{line}\nthickness ="))
    assert load_specimen(file).membrane.strength == strength


@pytest.mark.parametrize(("line", "key", "words"), [
    ('breakdown = "air"', "membrane.breakdown", "must be one of .*vhb-4910"),
    ("breakdown = 3", "membrane.breakdown", "must be a table"),
    ('breakdown = { law = "weibull" }', "membrane.breakdown.law", "must be one of constant, power"),
    ('breakdown = { law = "constant", strength = 20 }', "membrane.breakdown.strength",
     'such as "30 MV/m"'),
    ('breakdown = { law = "constant", strength = "20 kV" }', "membrane.breakdown.strength",
     "wrong dimension"),
    ('breakdown = { law = "constant", strength = "20 V/m" }', "membrane.breakdown.strength",
     "from 0.01"),
    ('breakdown = { law = "power", strength = "20 MV/m" }', "membrane.breakdown.exponent",
     "is missing"),
    ('breakdown = { law = "power", strength = "20 MV/m", exponent = 1, thickness_exponent = 0.2 }',
     "membrane.breakdown.thickness", "is missing"),
    ('breakdown = { law = "power", strength = "20 MV/m", exponent = 1, thickness = "1 mm" }',
     "membrane.breakdown.thickness", "unknown key"),
])
def test_bad_strengths_are_named(tmp_path: Path, line: str, key: str, words: str) -> None:
    file = tmp_path / "film.toml"
    file.write_text(PATCH_TOML.replace("thickness =", f"{line}\nthickness ="))
    with pytest.raises(InputError, match=words) as caught:
        load_specimen(file)
    assert (caught.value.file, caught.value.key) == (file, key)


def test_registered_laws_name_themselves() -> None:
    assert {name: kind.law for name, kind in STRENGTHS.items()} == {"constant": "constant",
                                                                    "power": "power"}
