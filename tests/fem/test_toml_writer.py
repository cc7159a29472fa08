"""Specimens and rigs written as TOML read back equal, whatever they are made of."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.oracles.laws import SAMPLES
from tests.support.biases import DECLARED as MECHANISMS
from tests.support.specimens import circular, elliptical, skewed
from tympan.base.errors import InputError
from tympan.base.units import DIMENSIONS, LARGEST, quantity, quantity_text
from tympan.fem.film.breakdown import STRENGTHS, ConstantStrength, PowerStrength
from tympan.fem.film.laws import LAWS, Ogden
from tympan.fem.film.library import EXAMINED, MATERIALS, load_specimen, material_name
from tympan.fem.membrane.biases import BIASES
from tympan.fem.rig import Rig
from tympan.fem.toml_writer import rig_to_toml, specimen_to_toml
from tympan.geometry.outlines import Circle, Rotated, examples
from tympan.geometry.specimen import Electrode, Film, Plate, Region

OUTLINES = examples()
FIELDS = {"constant": (ConstantStrength(31e6),),
          "power": (PowerStrength(30.6e6, 1.13), PowerStrength(51e6, 0.63, 0.25, 2e-3))}

#: No field has its default.
RIG = Rig(gravity=9.81, unaccounted_mass=1e-3, spring=4.0, amplifier_gain=0.03, sag_voltage=20e3,
          sensor_gain=0.01, sensor_zero=-3e-6, drift=1e-7 / 60, guide="level",
          weight_offset=(1e-3, -2e-3), plate_pressure=12.0, gas_pressure=-3.5,
          biases=tuple(MECHANISMS.values()), lag_voltage=70.0, friction=4e-3, plate_damping=0.2,
          added_mass=1e-4, series_resistance=1e6, leakage_resistance=2e9, sensor_lag=0.01, air=1.2,
          width_held=0.3, width_let=0.6, gauge_zero=0.02, gauge_gain=0.03, displacement_zero=1e-4,
          tester_compliance=2e-5)


@pytest.fixture
def read(tmp_path):
    def _read(specimen):
        file = tmp_path / "specimen.toml"
        file.write_text(specimen_to_toml(specimen), encoding="utf-8")
        return load_specimen(file)

    return _read


@pytest.mark.parametrize("law", LAWS)
def test_every_law(read, law) -> None:
    specimen = circular(SAMPLES[law].law)
    assert read(specimen) == specimen


@pytest.mark.parametrize("name", MATERIALS)
def test_every_library_material(read, name) -> None:
    specimen = circular(MATERIALS[name].material)
    assert read(specimen) == specimen


@pytest.mark.parametrize("shape", OUTLINES)
def test_every_shape_as_frame_plate_and_electrode(read, shape) -> None:
    outline = OUTLINES[shape]
    turned = outline if shape == "circle" else Rotated(outline, 0.3)
    around = replace(circular(), frame=Circle(90e-3))
    for specimen in (replace(circular(), frame=outline, plate=Plate(Circle(3e-3), (1e-3, -2e-3))),
                     replace(around, plate=Plate(turned, (1 / 3000, 0.0))),
                     replace(around, electrode=Electrode(outline=Region(outline, (20e-3, 1e-3))))):
        assert read(specimen) == specimen


@pytest.mark.parametrize("law", STRENGTHS)
def test_every_strength(read, law) -> None:
    for strength in FIELDS[law]:
        specimen = circular(strength=strength)
        assert read(specimen) == specimen


def test_a_specimen_with_everything(read) -> None:
    assert read(skewed()) == skewed()
    assert read(elliptical(0.1 + 0.2)) == elliptical(0.1 + 0.2)


@pytest.mark.parametrize("name", MATERIALS)
def test_a_film_of_the_library_keeps_its_name(read, name) -> None:
    film = replace(circular(), membrane=Film(1e-4, (1.2, 1.2), name, 3.0))
    assert material_name(film.membrane) == name
    assert f'material = "{name}"' in specimen_to_toml(film)
    assert read(film) == film
    other = replace(film.membrane, law_range=(0.3, 2.9))
    assert material_name(other) is None  # no file states both a name and a range


def test_a_law_of_a_narrow_range_states_it(read) -> None:
    """Its stress falls beyond a stretch of 4; where it falls at the mounted stretch no file can
    state it."""
    specimen = circular(Ogden((20e3, -500.0), (2.0, 4.0)))
    assert "range = [" in specimen_to_toml(specimen)
    stated = read(specimen)
    assert stated.membrane.law_range == (0.8, 4.0)
    assert replace(stated, membrane=replace(stated.membrane, law_range=None)) == specimen
    assert read(stated) == stated
    with pytest.raises(InputError, match="cannot be written"):
        specimen_to_toml(circular(EXAMINED["paper-table-1"]))


def test_every_number_of_a_rig(tmp_path) -> None:
    assert all(getattr(RIG, item.name) != item.default for item in fields(Rig))
    assert {bias.law for bias in RIG.biases} == set(BIASES)
    file = tmp_path / "rig.toml"
    for rig in (RIG, Rig()):
        file.write_text(rig_to_toml(rig), encoding="utf-8")
        assert Rig.read(file) == rig


@given(st.floats(-1e-3 * LARGEST, 1e-3 * LARGEST), st.sampled_from(sorted(DIMENSIONS)))
def test_a_quantity_is_read_back_bit_for_bit(value, dimension) -> None:
    assert quantity(quantity_text(value, dimension), dimension) == value
    assert quantity(quantity_text(np.float64(value), dimension), dimension) == value
