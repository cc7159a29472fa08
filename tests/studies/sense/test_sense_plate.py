"""Deflection and tilts from the capacitances of segments, against finite elements."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import tympan
from tests.support.specimens import circular
from tympan.base.errors import InputError
from tympan.fem.equilibrium.solve import equilibrium
from tympan.fem.membrane.loading import Loading
from tympan.fem.results.segments import segment_capacitances
from tympan.fem.rig import Rig
from tympan.geometry.electrode import Electrode, Segment
from tympan.geometry.specimen import Specimen
from tympan.studies.case import Settings, build_model
from tympan.studies.sense import SenseCase
from tympan.studies.sense.plate import PlateSense, plate_sense, tilted

#: Voltage of segment A [V]; the others are grounded.
VOLTAGE = 3e3


def quarters() -> Specimen:
    """Four sectors, of which one is driven."""
    segments = tuple(Segment(name=name, sector=(number * np.pi / 2, (number + 1) * np.pi / 2),
                             share=float(name == "A")) for number, name in enumerate("ABCD"))
    return replace(circular(), electrode=Electrode(gap=2e-3, segments=segments))


@cache
def sense(names: str = "ABCD") -> PlateSense:
    made = plate_sense(quarters(), Settings(), Loading(), VOLTAGE, VOLTAGE, (0.0, 4e-3), None, 1e-3,
                       names)
    assert made is not None
    return made


@cache
def solved(count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Plates at rest under weights beside their centre, (count, 3), and capacitances."""
    rng = np.random.default_rng(2)
    plates, capacitances = [], []
    for _ in range(count):
        x, y = rng.uniform(-3e-3, 3e-3, 2)
        model = build_model(quarters(), Settings(), Loading(arm=(x, y)))
        outcome = equilibrium(model, rng.uniform(0.12, 0.25), VOLTAGE)
        assert outcome.status == "equilibrium"
        plates.append([outcome.state.plate.deflection, *outcome.state.plate.slope])
        capacitances.append(segment_capacitances(model, [outcome.state])[0])
    return np.array(plates), np.array(capacitances)


@pytest.mark.study(seconds=12)
def test_plates_at_rest_are_sensed_within_the_stated_error() -> None:
    """The plates rest freely; those of the fit are held."""
    plates, capacitances = solved()
    assert np.abs(plates[:, 1:]).max() > 10e-3
    made = sense()
    off = np.abs(made.sensed(capacitances) - plates).max(axis=0)
    assert made.error_deflection_m < 1e-8
    assert made.error_tilt_rad < 1e-6
    assert off[0] <= 2 * made.error_deflection_m
    assert off[1:].max() <= 2 * made.error_tilt_rad
    np.testing.assert_allclose(made.capacitances(plates), capacitances, rtol=1e-7)


def test_noise_spreads_the_sensed_plate_as_stated() -> None:
    """Against 400 readings with a small noise."""
    plates, capacitances = solved(3)
    made, rng = sense(), np.random.default_rng(5)
    small = 1e-6
    by = made.by_capacitances(plates[:3])
    for number in range(3):
        noisy = capacitances[number] * (1 + small * rng.normal(size=(400, 4)))
        spread = (made.sensed(noisy) - plates[number]).std(axis=0)
        expected = small * np.sqrt((by[number] ** 2).sum(axis=1))
        np.testing.assert_allclose(spread, expected, rtol=0.15)
    assert made.noise_deflection_m > 0
    assert made.per_percent_prestretch_m is not None
    # A film that is stretched more has a larger capacitance, like one that is deflected more.
    assert made.per_percent_prestretch_m > made.noise_deflection_m


def test_beyond_the_range_nothing_is_sensed() -> None:
    made = sense()
    far = made.capacitances([[5e-3, 0.0, 0.0]])
    assert np.isnan(made.sensed(far)).all()


def test_plates_are_tilted_by_slopes() -> None:
    np.testing.assert_allclose(tilted(1e-3, 0.3, -0.2).slope, [0.3, -0.2], rtol=1e-12)
    np.testing.assert_array_equal(tilted(1e-3, 0.0, 0.0).rotation, np.eye(3))


def test_the_command_and_the_function_sense_tilts() -> None:
    result = tympan.sense(quarters(), voltage="A = 3 kV, B = 0 kV", to="3 mm", points=5,
                          tilt="20 mrad")
    plate, = result.plates
    assert plate.segments == ("A", "B", "C", "D")
    assert plate.tilt_rad == 0.02
    known = plate.capacitances([[2e-3, 0.01, -0.005]])[0]
    sensed = result.sensed_plate(dict(zip("ABCD", known, strict=True)), 3e3)
    assert sensed["deflection_m"] == pytest.approx(2e-3, rel=1e-6)
    assert sensed["tilt_x_rad"] == pytest.approx(0.01, rel=1e-5)
    assert sensed["tilt_y_rad"] == pytest.approx(-0.005, rel=1e-5)
    with pytest.raises(InputError, match="solved voltages: A 3 kV"):
        result.sensed_plate({}, 1e3)
    with pytest.raises(InputError, match="capacitance of B"):
        result.sensed_plate({"A": 1e-10}, 3e3)


def test_what_senses_no_tilts() -> None:
    assert SenseCase(circular()).readers == ()
    assert SenseCase(quarters(), rig=Rig(guide="level")).readers == ()
    assert SenseCase(quarters(), sensing=("B", "C", "D")).readers == ("B", "C", "D")
    for given, words in ((("A", "B"), "three different segments"), (("A", "B", "X"), "A, B, C, D")):
        with pytest.raises(InputError, match=words):
            SenseCase(quarters(), sensing=given)
    with pytest.raises(InputError, match="keeps the plate from tilting"):
        SenseCase(quarters(), sensing=("A", "B", "C"), rig=Rig(guide="vertical"))
    with pytest.raises(InputError, match="has no segments"):
        SenseCase(circular(), sensing=("A", "B", "C"))
