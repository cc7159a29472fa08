"""A rig is the sum of its records; supply and sensor have inverses."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tympan.base.errors import InputError
from tympan.base.fields import changed, fields_of
from tympan.base.file_kinds import _OF_RIG, KINDS
from tympan.fem import rig as records
from tympan.fem.rig import DIRECTIONS, MOST_VOLTAGE, Grips, Loads, PlateLoads, Rig, Sensor, Supply

RECORDS = (Loads, Supply, Sensor, records.Tester, Grips)
WAYS = sorted(DIRECTIONS.values())

supplies = st.builds(
    Supply, amplifier_gain=st.floats(-0.5, 2), lag_voltage=st.one_of(st.just(0.0),
                                                                      st.floats(0, 500)),
    sag_voltage=st.one_of(st.just(np.inf), st.floats(1e3, 1e5)),
    series_resistance=st.floats(0, 1e9), leakage_resistance=st.one_of(st.just(np.inf),
                                                                      st.floats(1e7, 1e12)))


def test_every_setting_is_declared_in_one_record() -> None:
    names = {record: {field.name for field in fields_of(record)} for record in RECORDS}
    assert not any(names[one] & names[other] for one, other in combinations(RECORDS, 2))
    assert set().union(*names.values()) == {field.name for field in fields(Rig)}
    assert Rig.__annotations__ == {}


def test_a_rig_is_each_of_its_records() -> None:
    rig = Rig(friction="10 mN", sag_voltage="7 kV", gauge_zero=0.1)
    assert all(isinstance(rig, record) for record in RECORDS)
    assert replace(rig, friction=0.0) == Rig(sag_voltage=7e3, gauge_zero=0.1)
    assert rig.film_voltage(3e3) == Supply(sag_voltage=7e3).film_voltage(3e3)
    assert [field.name for field in changed(rig, PlateLoads)] == ["friction"]
    assert [field.name for field in changed(rig)] == ["friction", "sag_voltage", "gauge_zero"]
    assert rig.hysteresis == ("friction",)
    assert Rig(lag_voltage=5.0).hysteresis == ("lag_voltage",)
    with pytest.raises(InputError, match="name the others: gravity"):
        Rig(9.81)


def test_what_a_file_of_a_rig_is_known_by_are_its_keys() -> None:
    known = {field.key for field in fields_of(Rig) if KINDS["rig"].known({field.key: 0.0})}
    assert known == _OF_RIG


@example(Supply(amplifier_gain=0.0, sag_voltage=1e3, lag_voltage=168.0, series_resistance=2e7,
                leakage_resistance=1e7), 0.0, 1.0)  # less output than the lag
@given(supplies, st.floats(0, 1), st.sampled_from(WAYS))
def test_the_nominal_voltage_is_the_inverse_of_the_film_s(supply: Supply, share: float,
                                                          way: float) -> None:
    """Wherever it is finite, up to the largest; a falling voltage leaves the lag on the film."""
    least = supply.lag_voltage if way < 0 else 0.0
    film = least + share * (supply.most_film_voltage(way) - least)
    nominal = supply.nominal_voltage(film, way)
    # Rounding at the largest film voltage may ask for more than the supply gives.
    if np.isfinite(nominal):
        assert supply.film_voltage(nominal, way) == pytest.approx(film, rel=1e-9, abs=1e-9)
        assert -1e-9 <= nominal <= supply.most_voltage * (1 + 1e-9)
    else:
        assert film >= supply.most_film_voltage(way) * (1 - 1e-9)
    shown = supply.shown_voltage(film, way)
    assert supply.film_voltage(shown, way) == pytest.approx(film, rel=1e-9, abs=1e-9)
    assert np.array_equal(supply.nominal_voltage(np.array([film, np.nan, np.inf]), way),
                          [nominal, np.nan, np.inf], equal_nan=True)


@given(supplies, st.floats(0, MOST_VOLTAGE), st.sampled_from(WAYS))
def test_no_lower_nominal_voltage_gives_the_film_s(supply: Supply, nominal: float,
                                                   way: float) -> None:
    """Above the largest output, an amplifier that sags shows the film's voltage a second time."""
    film = float(supply.film_voltage(nominal, way))
    found = supply.nominal_voltage(film, way)
    if film > 0 and np.isfinite(found):
        assert found <= nominal * (1 + 1e-9)
        assert supply.film_voltage(found, way) == pytest.approx(film, rel=1e-9)
    assert supply.nominal_voltage(1.001 * supply.most_film_voltage() + 1.0) == np.inf or np.isinf(
        supply.sag_voltage) or supply.sag_voltage > MOST_VOLTAGE


@given(st.floats(-0.5, 2), st.floats(-1e-3, 1e-3), st.floats(-1e-6, 1e-6), st.floats(-0.05, 0.05),
       st.floats(0, 1e4))
def test_a_deflection_is_found_from_its_reading(gain: float, zero: float, drift: float,
                                                deflection: float, elapsed: float) -> None:
    sensor = Sensor(sensor_gain=gain, sensor_zero=zero, drift=drift)
    reading = sensor.reading(deflection, elapsed)
    assert sensor.deflection(reading, elapsed) == pytest.approx(deflection, rel=1e-9, abs=1e-12)


def test_a_lagging_sensor_records_what_its_equation_says() -> None:
    """r' = (y - r)/T with y = sin(ω t), which begins at rest, in steps that need not be equal."""
    lag, omega = 0.03, 20.0
    time = np.linspace(0, 0.5**0.5, 20_001)**2
    shown = Sensor(sensor_lag=lag, sensor_gain=0.5).recorded(time, np.sin(omega * time))
    behind = omega * lag
    exact = (np.sin(omega * time) - behind * np.cos(omega * time)
             + behind * np.exp(-time / lag)) / (1 + behind**2)
    assert np.abs(shown / 1.5 - exact).max() < 1e-6
    at_once = Sensor(sensor_gain=0.5).recorded(time, np.sin(omega * time))
    assert np.array_equal(at_once, 1.5 * np.sin(omega * time))


@given(st.floats(0, 0.1), st.floats(0, 0.01), st.floats(-100, 100), st.floats(1e-5, 1e-3))
def test_a_mass_is_found_from_its_force(mass: float, more: float, pressure: float,
                                        area: float) -> None:
    loads = Loads(gravity=9.81, unaccounted_mass=more, plate_pressure=pressure)
    force = loads.force(mass, area)
    assert loads.nominal_mass(force, area) == pytest.approx(mass, rel=1e-9, abs=1e-12)


def test_grips_shift_a_test_to_the_other_width() -> None:
    mode = np.array(["uniaxial", "pure_shear", "equibiaxial"])
    along = np.array([1.5, 1.5, 1.5])
    free = along**-0.5
    as_said = Grips().stretch_across(mode, along, free)
    assert as_said.tolist() == [free[0], 1.0, 1.5]
    other = Grips(width_held=1.0, width_let=1.0)
    assert other.stretch_across(mode, along, free).tolist() == [1.0, free[0], 1.5]
    assert other.width_shift(mode).tolist() == [1.0, 1.0, 0.0]
